"""Flags of a hardness estimate: each is declared once, with its sentences, threshold and cure.

`Flag.finding` raises a flag with the numbers of one estimate: flags on presses of a probe are raised by the functions
below, those on contacts of a gel sensor, with sentences of their own, in `tsis.hardness.gel`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.model.estimate import IMPROBABLE, NOT_IDENTIFIED, probability_bound
from tsis.model.flag import Flag, declared, withholding

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from tsis.hardness.posterior import ContactPress, HardnessLikelihood, HardnessPosterior, HardnessPrior, RadiusPrior
    from tsis.model.flag import Finding

WIDE = 2.0  # ratio of the 90 % interval's ends beyond which a modulus is not identified
MODULUS_NOT_IDENTIFIED = Flag(
    name="young_kpa_not_identified",
    means="the presses do not determine the modulus",
    cure="press with more force, or give radius_mm",
    raised=f"ends of the 90 % interval further apart than a factor of {WIDE:g}, or posterior over prior sd above "
    f"{NOT_IDENTIFIED:g}",
    says="The modulus is not identifiable from these presses: {low:.3g} to {high:.3g} kPa.",
)
FLAT_OBJECT = replace(
    MODULUS_NOT_IDENTIFIED,
    says="The modulus is not identifiable: the contact of a flat object does not change with its modulus.",
)
FORCE_AND_RADIUS_UNKNOWN = replace(
    MODULUS_NOT_IDENTIFIED,
    says="The modulus is not identifiable: force and radius of the object are both unknown (give one of them).",
)
FORCE_AND_DEPTH_UNKNOWN = replace(
    MODULUS_NOT_IDENTIFIED,
    says="The modulus is not identifiable: without a force each contact needs radius_mm and depth_mm.",
)

CUT_OFF, EDGE = 0.2, 0.02  # fraction of the samples within this fraction of the prior's range at an end
MODULUS_CUT_OFF = Flag(
    name="young_kpa_cut_off",
    means="the modulus piles up at an end of the prior: it may lie beyond",
    cure="give a prior that holds it",
    raised=f"more than {CUT_OFF:g} of the samples in the outer {EDGE:.0%} of the range".replace("%", " %"),
    says="The modulus piles up at the prior's {side} end of {end:g} kPa: it may lie beyond.",
)

RADIUS_UNKNOWN = Flag(
    name="radius_unknown",
    means="the object's radius is not given",
    cure="give radius_mm",
    says="The object's radius is unknown within [1, {largest_mm:.3g}] mm: small contacts determine the modulus over "
    "the radius, and large ones little more ({cure}).",
)
GEL_RADIUS_UNKNOWN = replace(RADIUS_UNKNOWN, says="The object's radius is unknown; its modulus grows with it: {cure}.")

SAME_FORCE = 0.02  # relative difference of forces that count as equal
ONE_FORCE = Flag(
    name="one_force",
    means="all presses have one force, so that the model is not tested",
    cure="press with a second force",
    raised=f"forces within {SAME_FORCE:.0%} of each other".replace("%", " %"),
    says="All presses have one force: a second one would test whether the contact grows as that of a sphere.",
)
GEL_ONE_FORCE = replace(ONE_FORCE, says="All contacts have one force: a second one would test the model.")

CLIPPED = 1e-3  # fraction of the contact's pixels
SATURATED = Flag(
    name="saturated",
    means="pixels of a contact are clipped",
    cure="expose shorter",
    raised=f"more than {CLIPPED:g} of a contact's pixels",
    withholds=True,
    says="{percent:.2g} % of a contact's pixels clip, so its pressure is unknown: {cure}.",
)
OVAL = 1.1  # long over short axis: a sphere on a round probe lights a round patch
NOT_ROUND = Flag(
    name="not_round",
    means="a contact is not round: no sphere on the probe's axis",
    cure="press the object's top, straight down",
    raised=f"long over short axis above {OVAL:g}",
    withholds=True,
    says="A contact is {axis_ratio:.2f} times as long as wide: this is no sphere on the probe's axis, which the model "
    "assumes.",
)
BEYOND = 0.05  # fraction of the moduli for which a press lies outside the table
OUTSIDE_TABLE = Flag(
    name="outside_table",
    means="the sphere is flattened further than the mechanics were solved for",
    cure="press less",
    raised=f"for more than {BEYOND:.0%} of the moduli".replace("%", " %"),
    withholds=True,
    says="For {percent:.0f} % of the moduli a force flattens the sphere further than the mechanics were solved for: "
    "{cure}.",
)

CONTACTS_LEFT_OUT = Flag(
    name="contacts_left_out",
    means="contacts that are not good, of a release, or wider than the model holds, were left out",
    says="{left_out} contacts are not good and were left out.",
)
WIDEST_CONTACT = 0.6  # of half the face's smaller side
CONTACT_TOO_WIDE = Flag(
    name="contact_too_wide",
    means=f"all contacts are wider than {WIDEST_CONTACT:g} of the face",
    cure="press less",
    raised=f"every radius above {WIDEST_CONTACT:g} of half the face's smaller side",
    withholds=True,
    says=f"A contact of {{radius_mm:.3g}} mm is wider than {{widest_mm:.3g}} mm, {WIDEST_CONTACT:g} of the face: "
    "{cure}.",
)
DEEPEST_CONTACT = 0.9  # of the object's radius: the model was compared with finite strain up to there
CONTACTS_BEYOND = replace(
    CONTACTS_LEFT_OUT,
    says=f"Contacts wider than {WIDEST_CONTACT:g} of the face or {DEEPEST_CONTACT:g} of the object's radius were left "
    "out: {beyond}.",
)
CONTACTS_OF_RELEASE = replace(
    CONTACTS_LEFT_OUT,
    says="Contacts after the largest of their press, where it is released, were left out: {released}.",
)
CONTACT_TOO_DEEP = Flag(
    name="contact_too_deep",
    means=f"all contacts are wider than {DEEPEST_CONTACT:g} of the object's radius",
    cure="press less",
    raised=f"every radius above {DEEPEST_CONTACT:g} of the object's: finite strain was compared up to there",
    withholds=True,
    says="A contact of {radius_mm:.3g} mm on a radius of {object_mm:.3g} mm is too deep: {cure}.",
)
GEL_NOT_FLAT = Flag(
    name="gel_not_flat",
    means="the gel is not flat, so that its compliance is not that of a layer",
    withholds=True,
    says="The gel of {sensor} is not flat: as a layer its compliance is only estimated.",
)

MODEL_DOES_NOT_FIT = Flag(
    name="model_does_not_fit",
    means="forces, light and contact radii contradict each other",
    cure="check radius, forces, calibration and probe",
    raised=f"chance of the misfit below {IMPROBABLE:g}",
    withholds=True,
    says="Forces, light and contact radii contradict each other (chance below {chance}): this is no homogeneous sphere "
    "of that radius, or force, calibration or probe are wrong.",
)
GEL_MODEL_DOES_NOT_FIT = replace(
    MODEL_DOES_NOT_FIT,
    says="Forces, radii and dents contradict each other (chance below {chance}): the object is not of that shape, or "
    "force, scale or sensor are wrong.",
)

HARDNESS_FLAGS = declared(
    MODULUS_NOT_IDENTIFIED,
    MODULUS_CUT_OFF,
    RADIUS_UNKNOWN,
    ONE_FORCE,
    SATURATED,
    NOT_ROUND,
    OUTSIDE_TABLE,
    CONTACTS_LEFT_OUT,
    CONTACT_TOO_WIDE,
    CONTACT_TOO_DEEP,
    GEL_NOT_FLAT,
    MODEL_DOES_NOT_FIT,
)
UNTRUSTED_FLAGS = withholding(HARDNESS_FLAGS)


def press_findings(
    presses: Sequence[ContactPress],
    likelihood: HardnessLikelihood,
    posterior: HardnessPosterior,
    prior: HardnessPrior,
    radius: RadiusPrior,
) -> list[Finding]:
    """All findings on presses of one object and, as reference, of a rigid ball."""
    objects = [press for press in presses if press.ball_radius_mm is None]
    return [
        *_frame_findings(presses),
        *modulus_findings(posterior.young_kpa, prior),
        *_object_findings(objects, radius),
        *_table_findings(objects, likelihood, posterior),
        *_misfit_findings(presses, posterior, radius),
    ]


def identifiability(posterior: HardnessPosterior, prior: HardnessPrior) -> str:
    """Message on how well the data determine the modulus."""
    low, high = np.quantile(posterior.young_kpa, [0.05, 0.95])
    narrowing = float(posterior.young_kpa.std()) / prior.young_sd_kpa
    return (
        f"The modulus lies between {low:.3g} and {high:.3g} kPa with a probability of 90 %; "
        f"its standard deviation is {narrowing:.2g} of the prior's."
    )


def modulus_findings(young_kpa: NDArray[np.float64], prior: HardnessPrior) -> Iterator[Finding]:
    """Whether samples of the modulus identify it, and whether they pile up at an end of the prior."""
    low, high = np.quantile(young_kpa, [0.05, 0.95])
    if young_kpa.std() > NOT_IDENTIFIED * prior.young_sd_kpa or high > WIDE * low:
        yield MODULUS_NOT_IDENTIFIED.finding(low=low, high=high)
    ends = np.log(prior.young_kpa)
    position = (np.log(young_kpa) - ends[0]) / (ends[1] - ends[0])
    for fraction, side, end in (
        (np.mean(position < EDGE), "lower", prior.young_kpa[0]),
        (np.mean(position > 1 - EDGE), "upper", prior.young_kpa[1]),
    ):
        if fraction > CUT_OFF:
            yield MODULUS_CUT_OFF.finding(side=side, end=end)


def _frame_findings(presses: Sequence[ContactPress]) -> Iterator[Finding]:
    clipped = max(press.seen.clipped_fraction for press in presses)
    if clipped > CLIPPED:
        yield SATURATED.finding(percent=100 * clipped)
    oval = max(press.seen.axis_ratio for press in presses)
    if oval > OVAL:
        yield NOT_ROUND.finding(axis_ratio=oval)


def _object_findings(objects: Sequence[ContactPress], radius: RadiusPrior) -> Iterator[Finding]:
    forces = [press.force_n for press in objects]
    if max(forces) < (1 + SAME_FORCE) * min(forces):
        yield ONE_FORCE.finding()
    if radius.radius_mm is None:
        yield RADIUS_UNKNOWN.finding(largest_mm=radius.largest_mm)


def _table_findings(
    objects: Sequence[ContactPress], likelihood: HardnessLikelihood, posterior: HardnessPosterior
) -> Iterator[Finding]:
    _, poisson, radius = posterior.best
    table = likelihood.table
    outside = 0.0
    for press in objects:
        softness, depth = table.coordinates(posterior.young_kpa, poisson, radius, press.force_n)
        outside = max(outside, float(np.mean(depth > table.deepest_at(softness))))
    if outside > BEYOND:
        yield OUTSIDE_TABLE.finding(percent=100 * outside)


def _misfit_findings(
    presses: Sequence[ContactPress], posterior: HardnessPosterior, radius: RadiusPrior
) -> Iterator[Finding]:
    fitted = 2 if radius.radius_mm is None else 1
    chance = float(scipy.stats.chi2.sf(posterior.misfit, 2 * len(presses) - fitted))
    if chance < IMPROBABLE:
        yield MODEL_DOES_NOT_FIT.finding(chance=probability_bound(chance))
