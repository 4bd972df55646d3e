"""Flags of a hardness estimate: each is declared once, with its meaning, threshold and cure.

A finding raises one: its name, and a message with the numbers of this estimate. Contacts of gel sensors raise theirs in
`tsis.hardness.gel`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.model.estimate import IMPROBABLE, NOT_IDENTIFIED, probability_bound
from tsis.model.flag import Flag, declared, withholding

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from tsis.hardness.posterior import ContactPress, HardnessLikelihood, HardnessPosterior, HardnessPrior, RadiusPrior

    Finding = tuple[str, str]

WIDE = 2.0  # ratio of the 90 % interval's ends beyond which a modulus is not identified
CUT_OFF, EDGE = 0.2, 0.02  # fraction of the samples within this fraction of the prior's range at an end
CLIPPED = 1e-3  # fraction of the contact's pixels
NOT_ROUND = 1.1  # long over short axis: a sphere on a round probe lights a round patch
BEYOND = 0.05  # fraction of the moduli for which a press lies outside the table
SAME_FORCE = 0.02  # relative difference of forces that count as equal
WIDEST_CONTACT = 0.6  # of half the face's smaller side
DEEPEST_CONTACT = 0.9  # of the object's radius: the model was compared with finite strain up to there
HARDNESS_FLAGS = declared(
    Flag(
        name="young_kpa_not_identified",
        means="the presses do not determine the modulus",
        cure="press with more force, or give radius_mm",
        raised=f"ends of the 90 % interval further apart than a factor of {WIDE:g}, or posterior over prior sd above "
        f"{NOT_IDENTIFIED:g}",
    ),
    Flag(
        name="young_kpa_cut_off",
        means="the modulus piles up at an end of the prior: it may lie beyond",
        cure="give a prior that holds it",
        raised=f"more than {CUT_OFF:g} of the samples in the outer {EDGE:.0%} of the range".replace("%", " %"),
    ),
    Flag(name="radius_unknown", means="the object's radius is not given", cure="give radius_mm"),
    Flag(
        name="one_force",
        means="all presses have one force, so that the model is not tested",
        cure="press with a second force",
        raised=f"forces within {SAME_FORCE:.0%} of each other".replace("%", " %"),
    ),
    Flag(
        name="saturated",
        means="pixels of a contact are clipped",
        cure="expose shorter",
        raised=f"more than {CLIPPED:g} of a contact's pixels",
        withholds=True,
    ),
    Flag(
        name="not_round",
        means="a contact is not round: no sphere on the probe's axis",
        cure="press the object's top, straight down",
        raised=f"long over short axis above {NOT_ROUND:g}",
        withholds=True,
    ),
    Flag(
        name="outside_table",
        means="the sphere is flattened further than the mechanics were solved for",
        cure="press less",
        raised=f"for more than {BEYOND:.0%} of the moduli".replace("%", " %"),
        withholds=True,
    ),
    Flag(name="contacts_left_out", means="contacts that are not good were left out"),
    Flag(
        name="contact_too_wide",
        means=f"a contact is wider than {WIDEST_CONTACT:g} of the face",
        cure="press less",
        raised=f"radius above {WIDEST_CONTACT:g} of half the face's smaller side",
        withholds=True,
    ),
    Flag(
        name="contact_too_deep",
        means=f"a contact is wider than {DEEPEST_CONTACT:g} of the object's radius",
        cure="press less",
        raised=f"radius above {DEEPEST_CONTACT:g} of the object's: the model was compared with finite strain up to "
        "there",
        withholds=True,
    ),
    Flag(
        name="gel_not_flat",
        means="the gel is not flat, so that its compliance is not that of a layer",
        withholds=True,
    ),
    Flag(
        name="model_does_not_fit",
        means="forces, light and contact radii contradict each other",
        cure="check radius, forces, calibration and probe",
        raised=f"chance of the misfit below {IMPROBABLE:g}",
        withholds=True,
    ),
)
UNTRUSTED_FLAGS = withholding(HARDNESS_FLAGS)


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
        cure = HARDNESS_FLAGS["saturated"].cure
        note = f"{100 * clipped:.2g} % of a contact's pixels clip, so its pressure is unknown: {cure}."
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
            f"solved for: {HARDNESS_FLAGS['outside_table'].cure}.",
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
