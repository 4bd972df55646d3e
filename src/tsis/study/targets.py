"""Lists of targets for a study: those of the catalog, or drawn by chance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tsis.inclusion import InclusionPrior
from tsis.model import Inclusion, Phantom, load_phantom
from tsis.model.check import require_integer, require_type
from tsis.study.truth import TargetTruth

MOST_TARGETS = 100_000  # of one kind
PRINTED = 8  # inclusions of the catalog for studies of detection
DIAMETER_MM, DEPTH_MM, YOUNG_KPA = (2.0, 15.0), (4.0, 12.0), (40.0, 120.0)
LARGEST_POISSON = 0.4949
CLEARANCE = 0.97  # of the slab that an inclusion may reach down to


def printed_targets(present: int = PRINTED, blank: int = PRINTED) -> tuple[TargetTruth, ...]:
    """Phantoms ``detection-1`` to ``detection-8`` of the catalog, over and over, and ``detection-blank``.

    Parameters
    ----------
    present, blank
        How many with and without an inclusion; one at least in all.

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
    """Inclusions of 2 to 15 mm, 4 to 12 mm deep, of 40 to 120 kPa, and blanks; tissue varies alike in both.

    Tissue is drawn from what the estimator believes of it, `tsis.inclusion.InclusionPrior`; the slab's thickness is
    drawn again until the inclusion fits.

    Parameters
    ----------
    present, blank
        How many with and without an inclusion; one at least in all.
    rng
        Source of the draws.

    Raises
    ------
    InputError
        When a number is negative or too large, or both are 0.
    """
    _check_numbers(present, blank)
    require_type("rng", rng, np.random.Generator)
    prior = InclusionPrior()
    with_one = [
        TargetTruth(label=f"random-{number + 1}", phantom=_drawn_with_inclusion(prior, rng))
        for number in range(present)
    ]
    without = [
        TargetTruth(label=f"blank-{number + 1}", phantom=_drawn_tissue(prior, rng, at_least_mm=0.0))
        for number in range(blank)
    ]
    return (*with_one, *without)


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
    """Without what would tell who it is, or what of it was assumed: the label says where it came from."""
    lump = phantom.inclusion
    return Phantom(
        young_kpa=phantom.young_kpa, thickness_mm=phantom.thickness_mm, poisson=phantom.poisson, inclusion=lump
    )


__all__ = ["printed_targets", "random_targets"]
