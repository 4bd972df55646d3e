"""What the reader of an estimate must know: one flag and one sentence each, and one sentence of what it tells."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.inclusion._prior import PARAMETERS
from tsis.inclusion.posterior import least_sd
from tsis.model import NOT_IDENTIFIED, probability_bound

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.inclusion._prior import InclusionPrior
    from tsis.inclusion.checks import InclusionPosition
    from tsis.inclusion.posterior import InclusionPosterior, Profiles

    Finding = tuple[str, str]

MODULUS_SD_KPA = 20.0  # a modulus this uncertain is not reported as a number
PILED_UP = 0.3  # share of the samples in the outer twentieth of the prior's range that says that it cuts them off
EDGE = 0.05
OFF_AXIS_MM = 3.0  # beyond it the change no longer moves as the model says
NEARLY_CERTAIN = 0.95  # probability of an inclusion below which it is said
UNITS = {"diameter_mm": "mm", "depth_mm": "mm", "young_kpa": "kPa"}
NAMES = {"diameter_mm": "diameter", "depth_mm": "depth", "young_kpa": "modulus"}
UNTRUSTED_FLAGS = frozenset(  # with any of these the model does not hold, or there is nothing to measure
    (
        "model_does_not_fit",
        "presses_disagree",
        "not_one_round_inclusion",
        "off_axis",
        "contact_not_whole",
        "no_inclusion",
    )
)


def findings(posterior: InclusionPosterior, prior: InclusionPrior, data: Profiles) -> list[Finding]:
    """Flags and sentences about the posterior: what is not identified or cut off, rings left out, doubt about any."""
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
    """Chance that noise and nuisances alone make a misfit this large, if there is one sphere in a uniform slab."""
    return float(scipy.stats.chi2.sf(posterior.fit.misfit[0], int(data.usable.sum())))


def misfit_finding(chance: float, *, disagree: bool) -> Finding:
    """The flag for frames that the model does not explain; ``disagree`` says that it explains each on its own."""
    if disagree:
        return (
            "presses_disagree",
            f"The presses contradict each other (chance below {probability_bound(chance)}): each fits an "
            f"inclusion, but not "
            "the same one.",
        )
    return (
        "model_does_not_fit",
        f"This is not a single sphere in a uniform slab, or the calibration is wrong: the model does not explain the "
        f"frames (chance below {probability_bound(chance)}), and the intervals cannot be trusted.",
    )


def position_findings(inclusion: InclusionPosition | None) -> list[Finding]:
    """What a missing reference, or an inclusion beside the axis, means."""
    if inclusion is None:
        return [
            ("no_reference", "No reference press on plain tissue: size and depth are less certain than they could be.")
        ]
    if np.isfinite(inclusion.sd_mm) and inclusion.distance_mm - 2 * inclusion.noise_mm > OFF_AXIS_MM:
        return [
            (
                "off_axis",
                f"The inclusion lies {inclusion.distance_mm:.1f} mm from the probe's axis; the model holds up to "
                f"{OFF_AXIS_MM:g} mm: move the probe over it.",
            )
        ]
    return []


def identifiability(posterior: InclusionPosterior, prior: InclusionPrior) -> str:
    """One sentence: what the frames tell of each parameter, and what they do not."""
    reported, loose = [], []
    for column, name in zip(posterior.samples.T, PARAMETERS, strict=True):
        low, high = np.quantile(column, [0.05, 0.95])
        if _is_loose(column, name, prior):
            loose.append(f"{NAMES[name]} is not identifiable: {low:.3g} to {high:.3g} {UNITS[name]}")
        else:
            reported.append(f"{NAMES[name]} {column.mean():.3g} ± {column.std():.2g} {UNITS[name]}")
    return (
        ("; ".join(([f"{', '.join(reported)}"] if reported else []) + loose) + ".").capitalize().replace(" kpa", " kPa")
    )


def cramer_rao_sd(posterior: InclusionPosterior) -> dict[str, float]:
    """Least standard deviation of an unbiased estimate of each parameter; infinite where the data tell nothing."""
    return dict(zip(PARAMETERS, least_sd(posterior.information).tolist(), strict=True))


def _is_loose(column: NDArray[np.float64], name: str, prior: InclusionPrior) -> bool:
    sd = float(column.std())
    return sd > NOT_IDENTIFIED * prior.sd[name] or (name == "young_kpa" and sd > MODULUS_SD_KPA)


def _presence_findings(presence: float) -> list[Finding]:
    if presence >= NEARLY_CERTAIN:
        return []
    if presence >= 1 - NEARLY_CERTAIN:
        return [
            (
                "inclusion_uncertain",
                f"Whether there is an inclusion at all is uncertain: probability {presence:.2g}; the numbers describe "
                "the one that there would be.",
            )
        ]
    return [
        (
            "no_inclusion",
            f"Plain tissue explains the frames: the probability of an inclusion is {presence:.1e}; the numbers "
            "describe one that could hide.",
        )
    ]


def _cut_off(column: NDArray[np.float64], name: str, interval: tuple[float, float]) -> list[Finding]:
    """A flag when the samples pile up against an end of the prior: the truth may well lie beyond it."""
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


INCLUSION_FLAGS = MappingProxyType(
    {f"{name}_not_identified": f"the presses tell next to nothing of the {text}" for name, text in NAMES.items()}
    | {f"{name}_at_prior_end": f"the {text} piles up at an end of the prior" for name, text in NAMES.items()}
    | {
        "inclusion_uncertain": "whether there is an inclusion at all is uncertain",
        "no_reference": "there is no press on plain tissue: size and depth are less certain",
        "rings_left_out": "rings that are clipped or outside the picture were not used",
        "saturated": "pixels that the profile is read from are clipped",
        "cropped": "a part of the disc that the profile is read from lies outside the picture",
        "tilted": "a press on plain tissue is brighter on one side: the probe leans",
        "roundness_not_checked": "too little is seen to tell whether the change is round",
        "no_inclusion": "plain tissue explains the frames",
        "off_axis": "the inclusion lies too far from the probe's axis",
        "contact_not_whole": "the dome touches only in part on what was found",
        "not_one_round_inclusion": "what the target adds to plain tissue is not round",
        "presses_disagree": "each press fits an inclusion, but not the same one",
        "model_does_not_fit": "no inclusion explains the frames",
    }
)
