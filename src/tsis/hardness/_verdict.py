"""Findings of a hardness estimate: a flag and a message each."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.model.estimate import IMPROBABLE, NOT_IDENTIFIED, probability_bound

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from tsis.hardness._exploration import HardnessPosterior, HardnessPrior, RadiusPrior
    from tsis.hardness._likelihood import ContactPress, HardnessLikelihood

    Finding = tuple[str, str]

WIDE = 2.0  # ratio of the 90 % interval's ends beyond which a modulus is not identified
CUT_OFF, EDGE = 0.2, 0.02  # fraction of the samples within this fraction of the prior's range at an end
CLIPPED = 1e-3  # fraction of the contact's pixels
NOT_ROUND = 1.1  # long over short axis: a sphere on a round probe lights a round patch
BEYOND = 0.05  # fraction of the moduli for which a press lies outside the table
SAME_FORCE = 0.02  # relative difference of forces that count as equal
UNTRUSTED_FLAGS = frozenset(
    {"model_does_not_fit", "saturated", "not_round", "outside_table"}
    | {"contact_too_wide", "contact_too_deep", "gel_not_flat"}
)


def findings(
    presses: Sequence[ContactPress],
    likelihood: HardnessLikelihood,
    posterior: HardnessPosterior,
    prior: HardnessPrior,
    radius: RadiusPrior,
) -> list[Finding]:
    """All findings of an estimate."""
    objects = [press for press in presses if press.ball_radius_mm is None]
    return [
        *_about_frames(presses),
        *modulus_findings(posterior.young_kpa, prior),
        *_about_presses(objects, radius),
        *_about_table(objects, likelihood, posterior),
        *_about_fit(presses, posterior, radius),
    ]


def identifiability(posterior: HardnessPosterior, prior: HardnessPrior) -> str:
    """Message on how well the data determine the modulus."""
    low, high = np.quantile(posterior.young_kpa, [0.05, 0.95])
    narrowing = float(posterior.young_kpa.std()) / prior.young_sd_kpa
    return (
        f"The modulus lies between {low:.3g} and {high:.3g} kPa with a probability of 90 %; "
        f"its standard deviation is {narrowing:.2g} of the prior's."
    )


def _about_frames(presses: Sequence[ContactPress]) -> Iterator[Finding]:
    clipped = max(press.seen.clipped_fraction for press in presses)
    if clipped > CLIPPED:
        note = f"{100 * clipped:.2g} % of a contact's pixels clip, so its pressure is unknown: expose shorter."
        yield "saturated", note
    oval = max(press.seen.axis_ratio for press in presses)
    if oval > NOT_ROUND:
        shape = f"A contact is {oval:.2f} times as long as wide"
        yield "not_round", f"{shape}: this is no sphere on the probe's axis, which the model assumes."


def modulus_findings(young_kpa: NDArray[np.float64], prior: HardnessPrior) -> Iterator[Finding]:
    """Whether samples of the modulus identify it, and whether they pile up at an end of the prior."""
    low, high = np.quantile(young_kpa, [0.05, 0.95])
    if young_kpa.std() > NOT_IDENTIFIED * prior.young_sd_kpa or high > WIDE * low:
        note = f"The modulus is not identifiable from these presses: {low:.3g} to {high:.3g} kPa."
        yield "young_kpa_not_identified", note
    ends = np.log(prior.young_kpa)
    position = (np.log(young_kpa) - ends[0]) / (ends[1] - ends[0])
    for fraction, side, end in (
        (np.mean(position < EDGE), "lower", prior.young_kpa[0]),
        (np.mean(position > 1 - EDGE), "upper", prior.young_kpa[1]),
    ):
        if fraction > CUT_OFF:
            note = f"The modulus piles up at the prior's {side} end of {end:g} kPa: it may lie beyond."
            yield "young_kpa_cut_off", note


def _about_presses(objects: Sequence[ContactPress], radius: RadiusPrior) -> Iterator[Finding]:
    forces = [press.force_n for press in objects]
    if max(forces) < (1 + SAME_FORCE) * min(forces):
        note = "All presses have one force: a second one would test whether the contact grows as that of a sphere."
        yield "one_force", note
    if radius.radius_mm is None:
        yield (
            "radius_unknown",
            f"The object's radius is unknown within [1, {radius.largest_mm:.3g}] mm: small contacts determine the "
            "modulus over the radius, and large ones little more (give radius_mm).",
        )


def _about_table(
    objects: Sequence[ContactPress], likelihood: HardnessLikelihood, posterior: HardnessPosterior
) -> Iterator[Finding]:
    _, poisson, radius = posterior.best
    table = likelihood.table
    outside = 0.0
    for press in objects:
        softness, depth = table.coordinates(posterior.young_kpa, poisson, radius, press.force_n)
        outside = max(outside, float(np.mean(depth > table.deepest_at(softness))))
    if outside > BEYOND:
        yield (
            "outside_table",
            f"For {100 * outside:.0f} % of the moduli a force flattens the sphere further than the mechanics were "
            "solved for: press less.",
        )


def _about_fit(presses: Sequence[ContactPress], posterior: HardnessPosterior, radius: RadiusPrior) -> Iterator[Finding]:
    fitted = 2 if radius.radius_mm is None else 1
    chance = float(scipy.stats.chi2.sf(posterior.misfit, 2 * len(presses) - fitted))
    if chance < IMPROBABLE:
        yield (
            "model_does_not_fit",
            f"Forces, light and contact radii contradict each other (chance below {probability_bound(chance)}): "
            "this is no homogeneous sphere of that radius, or force, calibration or probe are wrong.",
        )


HARDNESS_FLAGS = MappingProxyType(
    {
        "young_kpa_not_identified": "the presses do not determine the modulus",
        "young_kpa_cut_off": "the modulus piles up at an end of the prior",
        "radius_unknown": "the object's radius is not given",
        "one_force": "all presses have one force, so that the model is not tested",
        "saturated": "pixels of a contact are clipped",
        "not_round": "a contact is not round: no sphere on the probe's axis",
        "outside_table": "the sphere is flattened further than the mechanics were solved for",
        "contacts_left_out": "contacts that are not good were left out",
        "contact_too_wide": "a contact is wider than 0.6 of the face",
        "contact_too_deep": "a contact is wider than 0.9 of the object's radius",
        "gel_not_flat": "the gel is not flat, so that its compliance is not that of a layer",
        "model_does_not_fit": "forces, light and contact radii contradict each other",
    }
)
