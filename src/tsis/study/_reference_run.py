"""The guided run of a performance card: reference phantoms read by one probe, several operators and repeats."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.__about__ import LARGEST_SEED
from tsis.catalog import load_phantom, load_probe
from tsis.model import require_integer
from tsis.study._making import new_study
from tsis.study._pressing import StudyInstrument, press_study
from tsis.study._values import TargetTruth, require_short_name
from tsis.study._verification import unblind
from tsis.virtual import VirtualProbe

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Sequence

    from tsis.study._folder import Study


REFERENCES = ("size-8", "size-14", "depth-4", "depth-8", "hardness-40", "hardness-70", "hardness-100")
BLANKS = 2


def reference_targets() -> tuple[TargetTruth, ...]:
    """Seven phantoms of the catalog that vary in size, depth and modulus, and two blanks.

    Examples
    --------
    >>> sum(target.has_inclusion for target in reference_targets()), len(reference_targets())
    (7, 9)
    """
    names = (*REFERENCES, *["plain"] * BLANKS)
    return tuple(TargetTruth(label=name, phantom=replace(load_phantom(name), name="", assumed=())) for name in names)


def rehearse_reference_run(
    folder: str | os.PathLike[str],
    *,
    probe: str = "tsis-domed",
    operators: Sequence[str] = ("A", "B"),
    repeats: int = 3,
    seed: int = 1,
    strain: str = "finite",
    preparing: Callable[[int, int], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Study:
    """Read the reference phantoms with one virtual probe, and unblind.

    Parameters
    ----------
    folder
        A new one, of the study.
    probe
        Name of a probe in the catalog; its errors follow from the ``seed``.
    operators
        Who read every phantom in turn.
    repeats
        Readings of a phantom by an operator, 2 or more.
    strain
        Mechanics of presses and estimates, ``"finite"`` or ``"small"``.
    preparing, progress
        Called with (done, total).

    Raises
    ------
    InputError
        When a value lies outside its range.
    RecordsError
        When the folder exists or cannot be created.
    """
    require_integer("repeats", repeats, 2, 100, hint="a card shows how well readings repeat")
    require_integer("seed", seed, 0, LARGEST_SEED)
    names = [require_short_name("operator", name) for name in operators]
    virtual = VirtualProbe(load_probe(probe), rng=np.random.default_rng(seed), strain=strain)
    study = new_study(folder, reference_targets(), seed=seed, probe=probe, repeats=repeats)
    each = len(study.plan.codes) * repeats
    for number, name in enumerate(names):

        def advance(done: int, _: int, start: int = number * each) -> None:
            if progress is not None:
                progress(start + done, len(names) * each)

        study = press_study(
            study,
            operator=name,
            seed=seed,
            strain=strain,
            instrument=StudyInstrument(virtual=virtual),
            preparing=preparing if number == 0 else None,
            progress=advance,
        ).study
    return unblind(study, by=names[0])
