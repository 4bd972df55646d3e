"""The guided run of a performance card: reference phantoms read by one probe, several operators and repeats."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.__about__ import LARGEST_SEED
from tsis.catalog import load_phantom, load_probe
from tsis.model import Inclusion, require_integer
from tsis.study._making import new_study
from tsis.study._pressing import StudyInstrument, press_study
from tsis.study._values import TargetTruth, require_short_name
from tsis.study._verification import unblind
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Sequence

    from tsis.study._folder import Study


# Well inside the default prior: phantoms of the catalog at 4 mm, 40 and 120 kPa lie on the ends of what is believed,
# where no interval of 90 % holds the truth.
REFERENCES = {  # diameter and depth in mm, modulus in kPa
    "diameter 7": (7.0, 6.0, 80.0),
    "diameter 13": (13.0, 6.0, 80.0),
    "depth 5": (10.0, 5.0, 80.0),
    "depth 9": (10.0, 9.0, 80.0),
    "modulus 55": (10.0, 6.0, 55.0),
    "modulus 80": (10.0, 6.0, 80.0),
    "modulus 105": (10.0, 6.0, 105.0),
}
BLANKS = 2


def reference_targets() -> tuple[TargetTruth, ...]:
    """Seven phantoms that vary in size, depth and modulus, and two blanks, in the tissue of ``plain``.

    Examples
    --------
    >>> sum(target.has_inclusion for target in reference_targets()), len(reference_targets())
    (7, 9)
    """
    tissue = replace(load_phantom("plain"), name="", assumed=())
    stiff = {
        label: Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=young, poisson=tissue.poisson)
        for label, (diameter, depth, young) in REFERENCES.items()
    }
    targets = [TargetTruth(label=label, phantom=replace(tissue, inclusion=lump)) for label, lump in stiff.items()]
    return (*targets, *[TargetTruth(label="plain", phantom=tissue)] * BLANKS)


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
    return press_by_operators(
        study, virtual=virtual, operators=names, seed=seed, strain=strain, preparing=preparing, progress=progress
    )


def press_by_operators(
    study: Study,
    *,
    virtual: VirtualProbe,
    operators: Sequence[str],
    seed: int,
    strain: str = "finite",
    preparing: Callable[[int, int], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Study:
    """Let operators read all targets of a study in turn with one virtual probe, and unblind.

    Parameters
    ----------
    study
        One that is not unblinded; readings that it holds already are not taken again.
    virtual
        The probe.
    operators
        Their names.
    seed
        Of all errors of readings.
    strain
        Mechanics of the estimates, ``"finite"`` or ``"small"``.
    preparing, progress
        Called with (done, total).
    """
    readings = len(study.plan.codes) * study.plan.repeats
    for number, name in enumerate(operators):

        def advance(done: int, _: int, start: int = number * readings) -> None:
            if progress is not None:
                progress(start + done, len(operators) * readings)

        study = press_study(
            study,
            operator=name,
            seed=seed,
            strain=strain,
            instrument=StudyInstrument(virtual=virtual),
            preparing=preparing if number == 0 else None,
            progress=advance,
        ).study
    return unblind(study, by=operators[0])
