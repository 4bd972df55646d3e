"""Flags of an inclusion estimate: each is declared once, with its meaning, threshold and cure, and raised by a finding.

A finding is the name of a flag and a message with the numbers of this estimate. Frames raise theirs in
`tsis.inclusion.checks`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.inclusion.posterior.likelihood import least_sd
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

    Finding = tuple[str, str]

MODULUS_SD_KPA = 20.0  # a modulus this uncertain is not reported as a number
PILED_UP, EDGE = 0.3, 0.05  # fraction of the samples in this outer fraction of the prior's range that is flagged
OFF_AXIS_MM = 3.0  # limit of the off-axis model
LAYER_LIKELY = 0.5  # probability of a superficial layer from which it is stated
LAYER_LIMIT_MM = 0.6  # size of the layer up to which its effect is linear enough in the logarithm of the modulus
NEARLY_CERTAIN = 0.95  # probability of an inclusion below which presence is flagged
UNITS = {"diameter_mm": "mm", "depth_mm": "mm", "young_kpa": "kPa"}
NAMES = {"diameter_mm": "diameter", "depth_mm": "depth", "young_kpa": "modulus"}
INCLUSION_FLAGS = declared(
    *(
        Flag(
            name=f"{name}_not_identified",
            means=f"the presses hardly determine the {text}: only an interval is printed",
            cure="press harder, or with several forces",
            raised=f"posterior over prior sd above {NOT_IDENTIFIED:g}"
            + (f", or sd above {MODULUS_SD_KPA:g} kPa" if name == "young_kpa" else ""),
        )
        for name, text in NAMES.items()
    ),
    *(
        Flag(
            name=f"{name}_at_prior_end",
            means=f"the {text} piles up at an end of the prior: it may lie beyond, and then other intervals are wrong "
            "too",
            cure="give a prior that holds it",
            raised=f"more than {PILED_UP:g} of the samples in the outer {EDGE:.0%} of the range".replace("%", " %"),
        )
        for name, text in NAMES.items()
    ),
    Flag(
        name="inclusion_uncertain",
        means="whether there is an inclusion is uncertain",
        cure="press harder, or beside it for reference",
        raised=f"probability of an inclusion between {1 - NEARLY_CERTAIN:.2g} and {NEARLY_CERTAIN:g}",
    ),
    Flag(
        name="no_reference",
        means="there is no press on plain tissue: size, depth and place are less certain",
        cure="press plain tissue at the same forces",
    ),
    Flag(
        name="light_not_measured",
        means="the calibration does not state what a dent does to the light: usual lamps are assumed, with wide errors",
        cure="measure it on soft pads: tsis calibrate --pad-kpa 5 --pad-kpa 10",
    ),
    Flag(
        name="layer_corrected",
        means="a superficial layer of another modulus shows; the intervals allow for it",
        raised=f"probability of a layer from {LAYER_LIKELY:g}",
    ),
    Flag(
        name="superficial_layer",
        means="a superficial layer of another modulus is too strong to be corrected for",
        cure="remove a film or a dried skin, or press where there is none; light on a dent that differs from the "
        "calibration looks alike: calibrate anew",
        raised=f"size of the layer beyond {LAYER_LIMIT_MM:g} mm, where its effect is no longer linear",
        withholds=True,
    ),
    Flag(name="rings_left_out", means="rings that are clipped or outside the picture were not used"),
    Flag(
        name="saturated",
        means="pixels that the profile uses are clipped",
        cure="expose shorter or press less",
        raised="from one pixel on",
    ),
    Flag(
        name="cropped",
        means="a part of the profile's disc lies outside the picture",
        cure="centre the probe in the picture",
    ),
    Flag(
        name="tilted",
        means="a reference press is brighter on one side: the probe is tilted",
        cure="hold the probe square to the tissue, or check axis_px",
        raised=f"chance below {IMPROBABLE:g} over all presses",
    ),
    Flag(
        name="roundness_not_checked",
        means="too few rings are visible to check whether the change is round",
        raised="fewer than 4 rings complete and without clipping",
    ),
    Flag(
        name=ABSENCE_FLAG,
        means="tissue without inclusion explains the frames",
        cure="to detect a smaller or deeper one, press harder",
        raised=f"probability of an inclusion below {1 - NEARLY_CERTAIN:.2g}",
        withholds=True,
    ),
    Flag(
        name="off_axis",
        means="the inclusion lies too far from the probe's axis",
        cure="move the probe over it",
        raised=f"more than {OFF_AXIS_MM:g} mm beyond two standard deviations: the limit of the off-axis model",
        withholds=True,
    ),
    Flag(
        name="contact_not_whole",
        means="the dome touches the estimated inclusion only in part",
        cure="press harder",
        raised="force below 0.9 of that of full contact, where the rings err by 0.3 % of the mean pressure",
        withholds=True,
    ),
    Flag(
        name="not_one_round_inclusion",
        means="the change between target and reference is not round",
        cure="press where there is one lump",
        raised=f"chance below {IMPROBABLE:g} over all rings",
        withholds=True,
    ),
    Flag(
        name="presses_disagree",
        means="each press fits an inclusion, but not the same inclusion",
        cure="press one place, and only along the axis",
        raised=f"chance of the misfit below {IMPROBABLE:g} together, not alone",
        withholds=True,
    ),
    Flag(
        name="model_does_not_fit",
        means="no inclusion explains the frames",
        cure="calibrate this probe anew, and press where the tissue is even",
        raised=f"chance of the misfit below {IMPROBABLE:g}",
        withholds=True,
    ),
)
UNTRUSTED_FLAGS = withholding(INCLUSION_FLAGS)  # the model is not valid, or nothing can be measured


def presence_caveats(flags: Iterable[str]) -> frozenset[str]:
    """The flags for which the probability of an inclusion is not to be trusted."""
    return UNTRUSTED_FLAGS.intersection(flags) - {ABSENCE_FLAG}


def findings(posterior: InclusionPosterior, prior: InclusionPrior, data: Profiles) -> list[Finding]:
    """Findings on the posterior: parameters not identified or at the prior's end, unused rings, presence."""
    findings = []
    for column, name in zip(posterior.samples.T, PARAMETERS, strict=True):
        if _is_loose(column, name, prior):
            low, high = np.quantile(column, [0.05, 0.95])
            findings.append(
                (
                    f"{name}_not_identified",
                    f"The {NAMES[name]} is not identifiable from this press: {low:.3g} to {high:.3g} {UNITS[name]}.",
                )
            )
        findings += _cut_off(column, name, getattr(prior, name))
    if not data.usable.all():
        findings.append(
            (
                "rings_left_out",
                f"{int((~data.usable).sum())} of {data.usable.size} rings are clipped or outside the picture.",
            )
        )
    return [*findings, *_presence_findings(posterior.presence)]


def misfit_chance(posterior: InclusionPosterior, data: Profiles) -> float:
    """Probability of at least this misfit for one sphere in a uniform slab."""
    return float(scipy.stats.chi2.sf(posterior.fit.misfit[0], int(data.usable.sum())))


def misfit_finding(chance: float, *, disagree: bool) -> Finding:
    """Finding for frames that the model does not explain; with ``disagree`` it explains each press by itself."""
    if disagree:
        return (
            "presses_disagree",
            f"The presses contradict each other (chance below {probability_bound(chance)}): each fits an inclusion, "
            f"but not the same inclusion: {INCLUSION_FLAGS['presses_disagree'].cure}.",
        )
    return (
        "model_does_not_fit",
        f"The model does not explain the frames (chance below {probability_bound(chance)}): this is not a single "
        f"sphere in a uniform slab, or the calibration is wrong. {INCLUSION_FLAGS['model_does_not_fit'].advice}",
    )


def layer_findings(layer: SuperficialLayer) -> list[Finding]:
    """Findings for a superficial layer, which is corrected for up to a limit."""
    if layer.probability < LAYER_LIKELY:
        return []
    if layer.size_mm <= LAYER_LIMIT_MM:
        return [
            (
                "layer_corrected",
                "The tissue has a superficial layer of another modulus: the intervals allow for it and are wider.",
            )
        ]
    return [
        (
            "superficial_layer",
            f"The tissue has a superficial layer of another modulus, too strong to be corrected for: depth times the "
            f"logarithm of the ratio of the moduli is {layer.size_mm:.2g} mm, at most {LAYER_LIMIT_MM:g} is valid. "
            f"{INCLUSION_FLAGS['superficial_layer'].advice}",
        )
    ]


def light_findings(calibration: Calibration) -> list[Finding]:
    """Finding for a calibration that does not state what a dent does to the light."""
    if calibration.light is not None:
        return []
    return [
        (
            "light_not_measured",
            "The calibration does not state what a dent does to the light: the intervals allow for usual lamps and are "
            f"wide. {INCLUSION_FLAGS['light_not_measured'].advice}",
        )
    ]


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


def cramer_rao_sd(posterior: InclusionPosterior) -> dict[str, float]:
    """Cramér–Rao bound of each parameter's standard deviation; infinite where the data have no information."""
    return dict(zip(PARAMETERS, least_sd(posterior.information).tolist(), strict=True))


def _is_loose(column: Floats, name: str, prior: InclusionPrior) -> bool:
    sd = float(column.std())
    return sd > NOT_IDENTIFIED * prior.sd[name] or (name == "young_kpa" and sd > MODULUS_SD_KPA)


def _presence_findings(presence: float) -> list[Finding]:
    if presence >= NEARLY_CERTAIN:
        return []
    if presence >= 1 - NEARLY_CERTAIN:
        return [
            (
                "inclusion_uncertain",
                "Whether there is an inclusion is uncertain; the numbers assume one.",
            )
        ]
    return [
        (
            ABSENCE_FLAG,
            "Tissue without inclusion explains the frames: the numbers describe an inclusion that could remain "
            f"undetected. {INCLUSION_FLAGS[ABSENCE_FLAG].advice}",
        )
    ]


def _cut_off(column: Floats, name: str, interval: tuple[float, float]) -> list[Finding]:
    """Flag samples that pile up at an end of the prior: the true value may lie beyond."""
    low, high = interval
    margin = EDGE * (high - low)
    for end, fraction in ((low, np.mean(column < low + margin)), (high, np.mean(column > high - margin))):
        if fraction > PILED_UP:
            message = (
                f"The {NAMES[name]} piles up at the prior's end of {end:g} {UNITS[name]}: it may lie beyond, or there "
                "may be no such inclusion, and then the other intervals are wrong too."
            )
            return [(f"{name}_at_prior_end", message)]
    return []
