"""Flags of an inclusion estimate: each is declared once, with its sentences, threshold and cure.

`Flag.finding` raises a flag with the numbers of one estimate: flags on the posterior are raised by the functions below,
those on frames in `tsis.inclusion.checks.images` and `tsis.inclusion.checks.position`, that on partial contact in
`tsis.inclusion.estimation`, which collects all of them as the estimate's notes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.inclusion.prior import PARAMETERS, Floats
from tsis.model.estimate import ABSENCE_FLAG, IMPROBABLE, NOT_IDENTIFIED, probability_bound
from tsis.model.flag import Flag, declared, withholding

if TYPE_CHECKING:
    from collections.abc import Iterable

    from tsis.inclusion.posterior.exploration import InclusionPosterior
    from tsis.inclusion.posterior.likelihood import Profiles
    from tsis.inclusion.posterior.uneven_tissue import SuperficialLayer
    from tsis.inclusion.prior import InclusionPrior
    from tsis.model.calibration import Calibration
    from tsis.model.flag import Finding

UNITS = {"diameter_mm": "mm", "depth_mm": "mm", "young_kpa": "kPa"}
NAMES = {"diameter_mm": "diameter", "depth_mm": "depth", "young_kpa": "modulus"}

MODULUS_SD_KPA = 20.0  # a modulus this uncertain is not reported as a number
PARAMETER_NOT_IDENTIFIED = {
    name: Flag(
        name=f"{name}_not_identified",
        means=f"the presses hardly determine the {text}: only an interval is printed",
        cure="press harder, or with several forces",
        raised=f"posterior over prior sd above {NOT_IDENTIFIED:g}"
        + (f", or sd above {MODULUS_SD_KPA:g} kPa" if name == "young_kpa" else ""),
        says=f"The {text} is not identifiable from this press: {{low:.3g}} to {{high:.3g}} {UNITS[name]}.",
    )
    for name, text in NAMES.items()
}

PILED_UP, EDGE = 0.3, 0.05  # fraction of the samples in this outer fraction of the prior's range that is flagged
AT_PRIOR_END = {
    name: Flag(
        name=f"{name}_at_prior_end",
        means=f"the {text} piles up at an end of the prior: it may lie beyond, and then other intervals are wrong too",
        cure="give a prior that holds it",
        raised=f"more than {PILED_UP:g} of the samples in the outer {EDGE:.0%} of the range".replace("%", " %"),
        says=f"The {text} piles up at the prior's end of {{end:g}} {UNITS[name]}: it may lie beyond, or there may be "
        "no such inclusion, and then the other intervals are wrong too.",
    )
    for name, text in NAMES.items()
}

NEARLY_CERTAIN = 0.95  # probability of an inclusion below which presence is flagged
INCLUSION_UNCERTAIN = Flag(
    name="inclusion_uncertain",
    means="whether there is an inclusion is uncertain",
    cure="press harder, or beside it for reference",
    raised=f"probability of an inclusion between {1 - NEARLY_CERTAIN:.2g} and {NEARLY_CERTAIN:g}",
    says="Whether there is an inclusion is uncertain; the numbers assume one.",
)
NO_INCLUSION = Flag(
    name=ABSENCE_FLAG,
    means="tissue without inclusion explains the frames",
    cure="to detect a smaller or deeper one, press harder",
    raised=f"probability of an inclusion below {1 - NEARLY_CERTAIN:.2g}",
    withholds=True,
    says="Tissue without inclusion explains the frames: the numbers describe an inclusion that could remain "
    "undetected. {advice}",
)

NO_REFERENCE = Flag(
    name="no_reference",
    means="there is no press on plain tissue: size, depth and place are less certain",
    cure="press plain tissue at the same forces",
    says="No reference press: size and depth are less certain than with one.",
)
LIGHT_NOT_MEASURED = Flag(
    name="light_not_measured",
    means="the calibration does not state what a dent does to the light: usual lamps are assumed, with wide errors",
    cure="measure it on soft pads: tsis calibrate --pad-kpa 5 --pad-kpa 10",
    says="The calibration does not state what a dent does to the light: the intervals allow for usual lamps and are "
    "wide. {advice}",
)

LAYER_LIKELY = 0.5  # probability of a superficial layer from which it is stated
LAYER_LIMIT_MM = 0.6  # size of the layer up to which its effect is linear enough in the logarithm of the modulus
LAYER_CORRECTED = Flag(
    name="layer_corrected",
    means="a superficial layer of another modulus shows; the intervals allow for it",
    raised=f"probability of a layer from {LAYER_LIKELY:g}",
    says="The tissue has a superficial layer of another modulus: the intervals allow for it and are wider.",
)
LAYER_TOO_STRONG = Flag(
    name="superficial_layer",
    means="a superficial layer of another modulus is too strong to be corrected for",
    cure="remove a film or a dried skin, or press where there is none; light on a dent that differs from the "
    "calibration looks alike: calibrate anew",
    raised=f"size of the layer beyond {LAYER_LIMIT_MM:g} mm, where its effect is no longer linear",
    withholds=True,
    says="The tissue has a superficial layer of another modulus, too strong to be corrected for: depth times the "
    f"logarithm of the ratio of the moduli is {{size_mm:.2g}} mm, at most {LAYER_LIMIT_MM:g} is valid. {{advice}}",
)

RINGS_LEFT_OUT = Flag(
    name="rings_left_out",
    means="rings that are clipped or outside the picture were not used",
    says="{unused} of {rings} rings are clipped or outside the picture.",
)
SATURATED = Flag(
    name="saturated",
    means="pixels that the profile uses are clipped",
    cure="expose shorter or press less",
    raised="from one pixel on",
    says="{percent:.2g} % of the profile's pixels clip at {full_scale:g} in {frame!r}: {cure}.",
)
CROPPED_FRACTION = 1e-3  # fraction of the profile's disc that may be outside the picture without a flag
CROPPED = Flag(
    name="cropped",
    means="a part of the profile's disc lies outside the picture",
    cure="centre the probe in the picture",
    raised=f"more than {CROPPED_FRACTION:g} of the disc",
    says="{percent:.2g} % of the profile's disc of {radius_mm:.2g} mm lies outside the picture: incomplete rings are "
    "biased by anything off the centre.",
)
TILTED = Flag(
    name="tilted",
    means="a reference press is brighter on one side: the probe is tilted",
    cure="hold the probe square to the tissue, or check axis_px",
    raised=f"chance below {IMPROBABLE:g} over all presses",
    says="A reference press is not symmetric: {radius_mm:.1f} mm from the axis one side is brighter by {excess:.2g} "
    "grey levels, {over_noise:.1f} times the noise; {cure}.",
)
FEWEST_RINGS = 4  # least number of rings for a test of roundness or tilt
ROUNDNESS_NOT_CHECKED = Flag(
    name="roundness_not_checked",
    means="too few rings are visible to check whether the change is round",
    raised=f"fewer than {FEWEST_RINGS} rings complete and without clipping",
    says=f"Whether the inclusion is round was not checked: fewer than {FEWEST_RINGS} rings are complete and without "
    "clipping.",
)
NOT_ROUND = Flag(
    name="not_one_round_inclusion",
    means="the change between target and reference is not round",
    cure="press where there is one lump",
    raised=f"chance below {IMPROBABLE:g} over all rings",
    withholds=True,
    says="This is not a single sphere in a uniform slab: {radius_mm:.1f} mm from the axis the second harmonic around "
    "it is {size:.2g} grey levels, {over_noise:.1f} times its noise (chance over all rings below {chance}); size, "
    "depth and modulus of one sphere do not describe it.",
)

OFF_AXIS_MM = 3.0  # limit of the off-axis model
OFF_AXIS = Flag(
    name="off_axis",
    means="the inclusion lies too far from the probe's axis",
    cure="move the probe over it",
    raised=f"more than {OFF_AXIS_MM:g} mm beyond two standard deviations: the limit of the off-axis model",
    withholds=True,
    says="The inclusion lies {distance_mm:.1f} mm from the probe's axis; the model is valid up to "
    f"{OFF_AXIS_MM:g} mm: {{cure}}.",
)
NEARLY_COVERED = 0.9  # of the force of full contact: there the rings err by 0.3 % of the mean pressure
PARTIAL_CONTACT = Flag(
    name="partial_contact",
    means="the dome touches the estimated inclusion only in part",
    cure="press harder",
    raised=f"force below {NEARLY_COVERED:g} of that of full contact, where the rings err by 0.3 % of the mean pressure",
    withholds=True,
    says="At {force_n:g} N the dome touches the estimated inclusion only in part; the model assumes full contact, from "
    "{needed_n:.2g} N on: {cure}.",
)

PRESSES_DISAGREE = Flag(
    name="presses_disagree",
    means="each press fits an inclusion, but not the same inclusion; or repeats of one force differ",
    cure="press one place, and only along the axis",
    raised=f"chance of the misfit below {IMPROBABLE:g} together, not alone; chance of the scatter of repeats below it",
    withholds=True,
    says="The presses contradict each other (chance below {chance}): each fits an inclusion, but not the same "
    "inclusion: {cure}.",
)
REPEATS_DISAGREE = replace(
    PRESSES_DISAGREE,
    says="Presses of one force contradict each other (chance below {chance}): they are not repeats at one place, or a "
    "force or the role of a press is wrong: {cure}.",
)
MODEL_DOES_NOT_FIT = Flag(
    name="model_does_not_fit",
    means="no inclusion explains the frames",
    cure="calibrate this probe anew, and press where the tissue is even",
    raised=f"chance of the misfit below {IMPROBABLE:g}",
    withholds=True,
    says="The model does not explain the frames (chance below {chance}): this is not a single sphere in a uniform "
    "slab, or the calibration is wrong. {advice}",
)

INCLUSION_FLAGS = declared(
    *PARAMETER_NOT_IDENTIFIED.values(),
    *AT_PRIOR_END.values(),
    INCLUSION_UNCERTAIN,
    NO_REFERENCE,
    LIGHT_NOT_MEASURED,
    LAYER_CORRECTED,
    LAYER_TOO_STRONG,
    RINGS_LEFT_OUT,
    SATURATED,
    CROPPED,
    TILTED,
    ROUNDNESS_NOT_CHECKED,
    NO_INCLUSION,
    OFF_AXIS,
    PARTIAL_CONTACT,
    NOT_ROUND,
    PRESSES_DISAGREE,
    MODEL_DOES_NOT_FIT,
)
UNTRUSTED_FLAGS = withholding(INCLUSION_FLAGS)  # the model is not valid, or nothing can be measured


def presence_caveats(flags: Iterable[str]) -> frozenset[str]:
    """The flags for which the probability of an inclusion is not to be trusted."""
    return UNTRUSTED_FLAGS.intersection(flags) - {ABSENCE_FLAG}


def posterior_findings(posterior: InclusionPosterior, prior: InclusionPrior, data: Profiles) -> list[Finding]:
    """Findings on the posterior: parameters not identified or at the prior's end, unused rings, presence."""
    findings = []
    for column, name in zip(posterior.samples.T, PARAMETERS, strict=True):
        if _is_loose(column, name, prior):
            low, high = np.quantile(column, [0.05, 0.95])
            findings.append(PARAMETER_NOT_IDENTIFIED[name].finding(low=low, high=high))
        findings += _prior_end_findings(column, name, getattr(prior, name))
    if not data.usable.all():
        findings.append(RINGS_LEFT_OUT.finding(unused=int((~data.usable).sum()), rings=data.usable.size))
    if posterior.presence < 1 - NEARLY_CERTAIN:
        findings.append(NO_INCLUSION.finding())
    elif posterior.presence < NEARLY_CERTAIN:
        findings.append(INCLUSION_UNCERTAIN.finding())
    return findings


def misfit_finding(chance: float, *, disagree: bool) -> Finding:
    """Finding for frames that the model does not explain; with ``disagree`` it explains each press by itself."""
    flag = PRESSES_DISAGREE if disagree else MODEL_DOES_NOT_FIT
    return flag.finding(chance=probability_bound(chance))


def layer_findings(layer: SuperficialLayer) -> list[Finding]:
    """Findings for a superficial layer, which is corrected for up to a limit."""
    if layer.probability < LAYER_LIKELY:
        return []
    if layer.size_mm <= LAYER_LIMIT_MM:
        return [LAYER_CORRECTED.finding()]
    return [LAYER_TOO_STRONG.finding(size_mm=layer.size_mm)]


def light_findings(calibration: Calibration) -> list[Finding]:
    """Finding for a calibration that does not state what a dent does to the light."""
    return [LIGHT_NOT_MEASURED.finding()] if calibration.light is None else []


def identifiability(posterior: InclusionPosterior, prior: InclusionPrior) -> str:
    """Message with the estimate of each parameter, and the interval of those not identified."""
    identified, loose = [], []
    for column, name in zip(posterior.samples.T, PARAMETERS, strict=True):
        low, high = np.quantile(column, [0.05, 0.95])
        if _is_loose(column, name, prior):
            loose.append(f"{NAMES[name]} is not identifiable: {low:.3g} to {high:.3g} {UNITS[name]}")
        else:
            identified.append(f"{NAMES[name]} {column.mean():.3g} ± {column.std():.2g} {UNITS[name]}")
    text = "; ".join(([", ".join(identified)] if identified else []) + loose) + "."
    return text.capitalize().replace(" kpa", " kPa")


def _is_loose(column: Floats, name: str, prior: InclusionPrior) -> bool:
    sd = float(column.std())
    return sd > NOT_IDENTIFIED * prior.sd[name] or (name == "young_kpa" and sd > MODULUS_SD_KPA)


def _prior_end_findings(column: Floats, name: str, interval: tuple[float, float]) -> list[Finding]:
    """Flag samples that pile up at an end of the prior: the true value may lie beyond."""
    low, high = interval
    margin = EDGE * (high - low)
    for end, fraction in ((low, np.mean(column < low + margin)), (high, np.mean(column > high - margin))):
        if fraction > PILED_UP:
            return [AT_PRIOR_END[name].finding(end=end)]
    return []
