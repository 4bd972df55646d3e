"""A new study: codes, order, seal, plan and the first line of the log, in a folder that appears whole or not at all."""

from __future__ import annotations

import os
import secrets
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from tsis.__about__ import __version__
from tsis.instrument.file_bytes import as_path, one_line, printable_path
from tsis.model import load_probe
from tsis.model.check import LARGEST_SEED, require_integer, require_number, require_type
from tsis.model.errors import InputError, RecordsError
from tsis.model.whole import atomic_folder
from tsis.study.chain import Chain, Draft, link_entries
from tsis.study.codes import coded
from tsis.study.folder import CREATED, PLAN, SEAL, open_study, user
from tsis.study.log import LOG_FILE
from tsis.study.plan import StudyPlan
from tsis.study.reading import require_short_name
from tsis.study.seal import SealedTruth, commitment
from tsis.study.truth import TargetTruth

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.study.folder import Study

THRESHOLD = 0.5


def new_study(
    folder: str | os.PathLike[str],
    targets: Sequence[TargetTruth] | Callable[[int], Sequence[TargetTruth]],
    *,
    name: str = "",
    seed: int | None = None,
    probe: str = "tsis-domed",
    forces_n: Sequence[float] | None = None,
    with_reference: bool = True,
    repeats: int = 1,
    threshold: float = THRESHOLD,
    actor: str = "",
) -> Study:
    """Make a study: its folder appears whole or not at all.

    Parameters
    ----------
    folder
        A new one.
    targets
        What is to be read, in any order; or what gives the targets for a seed, where they are drawn.
    name
        Of the study; that of the folder by default.
    seed
        What codes and order follow from. Whoever knows it can make the same study and read its truth; None draws one
        and keeps it in the seal.
    probe, forces_n, with_reference
        How the virtual probe presses: by default with 0.5 and 1 N under a dome, else 1 N.
    repeats
        How often an operator reads every target.
    threshold
        From which score on a target is called one with an inclusion.
    actor
        Who makes it; the user of this machine by default.

    Raises
    ------
    InputError
        When a value lies outside its range, or there is no target.
    RecordsError
        When the folder exists or cannot be made.
    """
    place = as_path(folder)
    given = seed
    seed = secrets.randbelow(LARGEST_SEED) if seed is None else require_integer("seed", seed, 0, LARGEST_SEED)
    listed = tuple(targets(seed) if callable(targets) else targets)
    if not listed:
        raise InputError("targets must be at least one; got none")
    for each in listed:
        require_type("targets", each, TargetTruth)
    truths = coded(listed, seed)
    sealed = SealedTruth(salt=secrets.token_hex(32), seed=seed, truths=truths).content()
    if forces_n is None:
        forces_n = (1.0,) if load_probe(probe).face_curvature_mm is None else (0.5, 1.0)
    plan = StudyPlan(
        name=name or place.resolve().name,
        seed=given,
        probe=probe,
        forces_n=tuple(forces_n),
        with_reference=with_reference,
        repeats=repeats,
        threshold=float(require_number("threshold", threshold, -1e12, 1e12)),
        codes=tuple(truths),
        commitment=commitment(sealed),
        made=datetime.now(UTC),
        tsis=__version__,
    )
    planned = plan.content()
    begun = {"study_sha256": commitment(planned), "truth_sha256": plan.commitment, "tsis": __version__}
    nothing = Chain(entries=(), lines=0, breaks={})
    first = link_entries(
        nothing, [Draft(actor=require_short_name("actor", actor or user()), action=CREATED, content=begun)], plan.made
    )
    try:
        with atomic_folder(place) as draft:
            (draft / PLAN).write_bytes(planned)
            handle = os.open(draft / SEAL, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(handle, "wb") as file:
                file.write(sealed)
            (draft / LOG_FILE).write_bytes(f"{first[0].line()}\n".encode())
    except FileExistsError as error:
        raise RecordsError(
            f"{printable_path(place)} must be a new name; there is such a file or folder (choose another)"
        ) from error
    except (OSError, ValueError) as error:
        raise RecordsError(
            f"{printable_path(place)} must be a place that can be written; got: {one_line(error)}"
        ) from error
    return open_study(place)


__all__ = ["new_study"]
