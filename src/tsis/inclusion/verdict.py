"""What the reader of an estimate must know: one flag and one sentence each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import chi2

from tsis.imaging import subtract_background
from tsis.inclusion.prior import PARAMETERS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.inclusion.likelihood import Fit, Profiles
    from tsis.inclusion.prior import InclusionPrior
    from tsis.model import TactileImage

NOT_IDENTIFIED = 0.85  # posterior over prior standard deviation from which the data told next to nothing
MODULUS_SD_KPA = 20.0  # a modulus this uncertain is not reported as a number
PILED_UP = 0.3  # share of the samples in the outer twentieth of the prior's range that says that it cuts them off
EDGE = 0.05
UNLIKELY = 1e-4  # chance of a misfit this large if the model were true
OFF_AXIS_MM = 1.0
UNITS = {"diameter_mm": "mm", "depth_mm": "mm", "young_kpa": "kPa"}
NAMES = {"diameter_mm": "diameter", "depth_mm": "depth", "young_kpa": "modulus"}


def verdict(
    samples: NDArray[np.float64],
    *,
    prior: InclusionPrior,
    targets: list[TactileImage],
    references: list[TactileImage],
    data: Profiles,
    best: Fit,
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Flags and their sentences.

    Parameters
    ----------
    samples
        Posterior samples (n, 3).
    prior, targets, references, data
        What the estimate rests on.
    best
        The fit at the posterior mean.
    """
    found: list[tuple[str, str]] = []
    for column, name in zip(samples.T, PARAMETERS, strict=True):
        low, high = np.quantile(column, [0.05, 0.95])
        loose = column.std() > NOT_IDENTIFIED * prior.sd[name]
        if loose or (name == "young_kpa" and column.std() > MODULUS_SD_KPA):
            found.append(
                (
                    f"{name}_not_identified",
                    f"The {NAMES[name]} is not identifiable from this press: {low:.3g} to {high:.3g} {UNITS[name]}.",
                )
            )
        found += _cut_off(column, name, getattr(prior, name))
    chance = float(chi2.sf(best.misfit[0], int(data.usable.sum())))
    if chance < UNLIKELY:
        found.append(
            (
                "model_does_not_fit",
                f"The model does not explain the image (chance {chance:.1e}): the intervals cannot be trusted.",
            )
        )
    if not references:
        found.append(
            ("no_reference", "No reference press on plain tissue: size and depth are less certain than they could be.")
        )
    else:
        offset = max(off_axis_mm(target, references[0]) for target in targets)
        if offset > OFF_AXIS_MM:
            found.append(
                (
                    "off_axis",
                    f"The signal lies {offset:.1f} mm from the probe's axis; the model assumes that it lies on it.",
                )
            )
    if not data.usable.all():
        found.append(
            (
                "rings_left_out",
                f"{int((~data.usable).sum())} of {data.usable.size} rings are clipped or outside the picture.",
            )
        )
    return tuple(flag for flag, _ in found), tuple(note for _, note in found)


def _cut_off(column: NDArray[np.float64], name: str, interval: tuple[float, float]) -> list[tuple[str, str]]:
    """A flag when the samples pile up against an end of the prior: the truth may well lie beyond it."""
    low, high = interval
    margin = EDGE * (high - low)
    for end, share in ((low, np.mean(column < low + margin)), (high, np.mean(column > high - margin))):
        if share > PILED_UP:
            sentence = (
                f"The {NAMES[name]} piles up at the prior's end of {end:g} {UNITS[name]}: it may lie beyond, or there "
                "may be no such inclusion, and then the other intervals are wrong too."
            )
            return [(f"{name}_at_prior_end", sentence)]
    return []


def off_axis_mm(target: TactileImage, reference: TactileImage) -> float:
    """Distance in mm from the probe's axis to the centroid of what the target adds to the reference."""
    change = subtract_background(target, reference)
    sx, sy = change.scale()
    axis = change.axis()
    x = (np.arange(change.grey.shape[1]) - axis[0]) * sx
    y = (np.arange(change.grey.shape[0]) - axis[1]) * sy
    near = np.hypot(x[None, :], y[:, None]) < 0.8 * min(np.abs(x[[0, -1]]).min(), np.abs(y[[0, -1]]).min())
    if not near.any():
        return 0.0
    level = change.grey[near].max() / 2
    # Half of the peak keeps the far field and the noise out of the centroid.
    lit = np.where(near & (change.grey > level), change.grey - level, 0.0)
    total = lit.sum()
    if total <= 0:
        return 0.0
    return float(np.hypot((lit.sum(axis=0) @ x) / total, (lit.sum(axis=1) @ y) / total))
