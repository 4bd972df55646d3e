"""Creation of a study: its targets, from the catalog or drawn at random, and its folder."""

from __future__ import annotations

import os
import secrets
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np

from tsis.__about__ import LARGEST_SEED, __version__
from tsis.catalog import load_phantom, load_probe
from tsis.errors import InputError, RecordsError
from tsis.files import EMPTY_CHAIN, LogDraft, as_path, atomic_folder, file_error, link_entries, one_line
from tsis.inclusion import InclusionPrior, protocol_forces
from tsis.model import Inclusion, Phantom, require_integer, require_number, require_type
from tsis.study._folder import CREATED, PLAN, SEAL, open_study, user
from tsis.study._log import LOG_FILE, SealedTruth, commitment
from tsis.study._plan import StudyPlan, coded
from tsis.study._values import TargetTruth, require_short_name

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.study._folder import Study


MOST_TARGETS = 100_000  # of one kind
PRINTED = 8  # inclusions of the catalog for studies of detection
DIAMETER_MM, DEPTH_MM, YOUNG_KPA = (2.0, 15.0), (4.0, 12.0), (40.0, 120.0)
LARGEST_POISSON = 0.4949
CLEARANCE = 0.97  # of the slab: deepest end of an inclusion


def printed_targets(present: int = PRINTED, blank: int = PRINTED) -> tuple[TargetTruth, ...]:
    """Phantoms ``detection-1`` to ``detection-8`` of the catalog in turn, and ``detection-blank``; at least one target.

    Raises
    ------
    InputError
        When a number is negative or too large, or both are 0.

    Examples
    --------
    >>> [target.has_inclusion for target in printed_targets(1, 2)]
    [True, False, False]
    """
    _check_numbers(present, blank)
    names = [f"detection-{1 + number % PRINTED}" for number in range(present)] + ["detection-blank"] * blank
    return tuple(TargetTruth(label=name, phantom=_unnamed(load_phantom(name))) for name in names)


def random_targets(present: int, blank: int, *, rng: np.random.Generator) -> tuple[TargetTruth, ...]:
    """Inclusions of 2 to 15 mm, 4 to 12 mm deep, of 40 to 120 kPa, and blanks, at least one target in all.

    Tissue of both is drawn from what the estimator assumes, `tsis.inclusion.InclusionPrior`; the slab's thickness is
    drawn again until the inclusion fits.

    Raises
    ------
    InputError
        When a number is negative or too large, or both are 0.
    """
    _check_numbers(present, blank)
    require_type("rng", rng, np.random.Generator)
    prior = InclusionPrior()
    drawn = {f"random-{number}": _drawn_with_inclusion(prior, rng) for number in range(1, present + 1)}
    drawn |= {f"blank-{number}": _drawn_tissue(prior, rng, at_least_mm=0.0) for number in range(1, blank + 1)}
    return tuple(TargetTruth(label=label, phantom=phantom) for label, phantom in drawn.items())


def _drawn_with_inclusion(prior: InclusionPrior, rng: np.random.Generator) -> Phantom:
    diameter, depth, young = (float(rng.uniform(*ends)) for ends in (DIAMETER_MM, DEPTH_MM, YOUNG_KPA))
    tissue = _drawn_tissue(prior, rng, at_least_mm=(diameter + depth) / CLEARANCE)
    lump = Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=young, poisson=tissue.poisson)
    return replace(tissue, inclusion=lump)


def _drawn_tissue(prior: InclusionPrior, rng: np.random.Generator, *, at_least_mm: float) -> Phantom:
    young = prior.tissue_young_kpa * float(np.exp(prior.tissue_young_sd * rng.standard_normal()))
    poisson = min(prior.poisson + prior.poisson_sd * float(rng.standard_normal()), LARGEST_POISSON)
    while True:
        thickness = prior.thickness_mm * float(np.exp(prior.thickness_sd * rng.standard_normal()))
        if thickness > at_least_mm:
            return Phantom(young_kpa=young, thickness_mm=thickness, poisson=poisson)


def _check_numbers(present: int, blank: int) -> None:
    require_integer("present", present, 0, MOST_TARGETS)
    require_integer("blank", blank, 0 if present else 1, MOST_TARGETS, hint="a study needs a target")


def _unnamed(phantom: Phantom) -> Phantom:
    """The phantom without its name and note, which would identify it."""
    return replace(phantom, name="", assumed=())


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
    progress: Callable[[int, int], None] = lambda _done, _all: None,
) -> Study:
    """Create a study atomically.

    Parameters
    ----------
    folder
        A new one.
    targets
        The targets in any order, or a function that draws them for a seed.
    name
        Of the study; that of the folder by default.
    seed
        Determines codes and order. Anyone with the seed can recreate the study and read its truth; None draws one
        and stores it in the seal.
    probe, forces_n, with_reference
        Protocol of the virtual probe: by default 0.5 and 1 N with a dome, else 1 N.
    repeats
        Readings of every target by an operator.
    threshold
        Least score of a target that is called one with an inclusion, in [0, 1]: the virtual probe's score is a
        probability. Other devices bring their own threshold (`import_readings`).
    actor
        Who creates it; the user of this machine by default.
    progress
        Called with (targets sealed, all): 100,000 take seconds.

    Raises
    ------
    InputError
        When a value lies outside its range, or there is no target.
    RecordsError
        When the folder exists or cannot be created.
    """
    root = as_path(folder)
    published_seed = seed
    seed = secrets.randbelow(LARGEST_SEED) if seed is None else require_integer("seed", seed, 0, LARGEST_SEED)
    listed = tuple(targets(seed) if callable(targets) else targets)
    if not listed:
        raise InputError("targets must be at least one; got none")
    for item in listed:
        require_type("targets", item, TargetTruth)
    truths = coded(listed, seed)
    sealed = SealedTruth(salt=secrets.token_hex(32), seed=seed, truths=truths).content(progress)
    if forces_n is None:
        forces_n = protocol_forces(load_probe(probe), tissue_young_kpa=InclusionPrior().tissue_young_kpa)
    plan = StudyPlan(
        name=name or root.absolute().name,  # to resolve fails at loops of links
        seed=published_seed,
        probe=probe,
        forces_n=tuple(forces_n),
        with_reference=with_reference,
        repeats=repeats,
        threshold=require_number("threshold", threshold, 0.0, 1.0, hint="probability of an inclusion"),
        codes=tuple(truths),
        commitment=commitment(sealed),
        made=datetime.now(UTC),
        tsis=__version__,
    )
    planned = plan.content()
    begun = {"study_sha256": commitment(planned), "truth_sha256": plan.commitment, "tsis": __version__}
    draft_entry = LogDraft(actor=require_short_name("actor", actor or user()), action=CREATED, content=begun)
    first = link_entries(EMPTY_CHAIN, [draft_entry], plan.made)
    try:
        with atomic_folder(root) as draft:
            (draft / PLAN).write_bytes(planned)
            handle = os.open(draft / SEAL, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(handle, "wb") as file:
                file.write(sealed)
            (draft / LOG_FILE).write_bytes(f"{first[0].line()}\n".encode())
    except FileExistsError as error:
        raise file_error(
            root, "must be a new name; there is such a file or folder (choose another)", RecordsError
        ) from error
    except (OSError, ValueError) as error:
        raise file_error(root, f"must be a folder that can be written; got: {one_line(error)}", RecordsError) from error
    return open_study(root)
