"""Analysis of a frame: contact, grey levels, exposure, and flags of the press."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.calibration.guard import GuardFlag
from tsis.console.services._subject import PressForce
from tsis.imaging import block_means, segment
from tsis.imaging.depth import GelReading
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.calibration.guard import PressWatch, WatchState
    from tsis.instrument import Frame

BINS, OUTLINE_POINTS = 64, 96  # of the histogram, and of a contact
LARGEST_SIDE_PX = 192  # to which a frame is reduced before the search for its contact
CLIPPED = 0.001  # share of pixels at full scale
DIM, BRIGHT_QUANTILE = 0.15, 0.99  # of the scale, which the brightest hundredth reaches


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactView:
    """The contact in a frame, in its pixels.

    Attributes
    ----------
    centroid_px
        Mean position (x, y) weighted by the signal.
    outline_px
        Points (x, y) of its boundary.
    """

    centroid_px: tuple[float, float]
    outline_px: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameAnalysis:
    """Analysis of the newest frame.

    Attributes
    ----------
    number
        How many frames had come when it was looked at.
    flags
        What speaks against the press.
    force
        That of the press; None where unknown.
    still
        ``"settled"``, ``"moving"``, ``"wait 4 s"``, or empty where nobody can tell.
    contact
        None when nothing stands out.
    histogram
        Pixels in `BINS` equal bins of grey levels from 0 to full scale.
    clipped_share
        Of the pixels at full scale.
    warnings
        A message for each problem of the exposure.
    gel
        What a gel sensor before the camera shows; None without one.
    """

    number: int
    flags: tuple[GuardFlag, ...]
    force: PressForce | None
    still: str
    contact: ContactView | None
    histogram: tuple[int, ...]
    clipped_share: float
    warnings: tuple[str, ...]
    gel: GelReading | None = None


def analyse_frame(
    watch: PressWatch,
    state: WatchState,
    frame: Frame,
    *,
    number: int,
    force: PressForce | None,
    untouched: NDArray[np.float64] | None,
) -> tuple[FrameAnalysis, WatchState]:
    """Analyse frame ``number`` with the press guard and its state; returns the analysis and the next state.

    ``untouched`` are grey levels of the untouched probe, `reduced`; None when unknown.
    """
    flags, after = watch.step(state, frame, None if force is None else force.value_n)
    counts = histogram(frame)
    clipped = float(np.count_nonzero(frame.pixels >= frame.full_scale) / frame.pixels.size)
    analysis = FrameAnalysis(
        number=number,
        flags=flags,
        force=force,
        still="" if after.settling is None else after.settling.text,
        contact=None if any(flag.name == "no-contact" for flag in flags) else contact(frame, untouched),
        histogram=tuple(counts.tolist()),
        clipped_share=clipped,
        warnings=exposure_warnings(counts, clipped),
    )
    return analysis, after


def histogram(frame: Frame) -> NDArray[np.int64]:
    """Pixels in equal bins of grey levels from 0 to full scale, shape (BINS,)."""
    return np.histogram(frame.pixels, BINS, (0.0, frame.full_scale + 1.0))[0]


def exposure_warnings(counts: NDArray[np.int64], clipped_fraction: float) -> tuple[str, ...]:
    """Problems of the exposure, with a cure."""
    bright = int(np.searchsorted(np.cumsum(counts), BRIGHT_QUANTILE * counts.sum())) / BINS
    if clipped_fraction > CLIPPED:
        return (f"{clipped_fraction:.1%} of the pixels are at full scale: shorten the exposure or lower the gain",)
    if bright < DIM:
        return (f"the frame uses {bright:.0%} of the scale: lengthen the exposure, or press",)
    return ()


def reduced(levels: NDArray[Any]) -> NDArray[np.float64]:
    """A frame reduced by means over equal areas to at most `LARGEST_SIDE_PX`."""
    shrink = max(1.0, max(levels.shape) / LARGEST_SIDE_PX)
    return block_means(levels, (max(3, round(levels.shape[0] / shrink)), max(3, round(levels.shape[1] / shrink))))


def contact(frame: Frame, untouched: NDArray[np.float64] | None) -> ContactView | None:
    """The contact in a `reduced` frame; None without one."""
    small = reduced(frame.pixels)
    if untouched is not None and untouched.shape == small.shape:
        small -= untouched
    patch = segment(TactileImage(grey=small, full_scale=frame.full_scale))
    weight = np.where(patch.mask, np.maximum(small - patch.background_grey, 0.0), 0.0)
    if not patch.is_contact or (total := float(weight.sum())) <= 0.0:
        return None
    down, span = (np.arange(count, dtype=float) for count in small.shape)
    back = frame.pixels.shape[1] / small.shape[1], frame.pixels.shape[0] / small.shape[0]

    def full_size(x: float, y: float) -> tuple[float, float]:
        return round((x + 0.5) * back[0] - 0.5, 2), round((y + 0.5) * back[1] - 0.5, 2)

    outline = patch.contour_px[:: max(1, len(patch.contour_px) // OUTLINE_POINTS)]
    return ContactView(
        centroid_px=full_size(float(weight.sum(axis=0) @ span) / total, float(weight.sum(axis=1) @ down) / total),
        outline_px=tuple(full_size(float(x), float(y)) for x, y in outline),
    )
