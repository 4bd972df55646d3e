"""The centroid of the light over a sequence of frames."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import ImageMismatchError, InputError
from tsis.imaging.corrections import require_same_frame
from tsis.imaging.patch import pixel_noise, smoothed
from tsis.inclusion.relative import (
    COMPARED_WITH,
    SPHERE_ASSUMPTION,
    change_of_light,
    equal_light_assumption,
    lit_part,
    notes_of,
)
from tsis.model.image import as_images
from tsis.model.require import freeze_arrays

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.inclusion.prior import Floats
    from tsis.inclusion.relative import LightChange, LitPart
    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage


EDGE_PX = 4  # width of the belt around the lit part in which noise may lift a pixel above the threshold
LEAST_STEP = 1e-3  # of the threshold, where a frame has next to no noise


def centroid_noise_mm(part: LitPart, change: LightChange, frame: TactileImage) -> float:
    """Standard deviation of one coordinate of the centroid by the noise of one frame, mm.

    Noise changes the weights of the pixels inside and, with twice the effect, which pixels of the edge count. The
    derivative of the counted light is therefore a difference over the noise, which smears the edge as noise does. The
    reference's noise is omitted: it shifts all frames of a sequence equally.
    """
    assert part.centroid_px is not None  # callers pass only frames with a lit part
    sx, sy = frame.scale()
    grey, threshold = change.image.grey, part.threshold_grey
    step = max(change.noise_grey, LEAST_STEP * threshold)
    near = scipy.ndimage.binary_dilation(part.mask, iterations=EDGE_PX)
    derivative = np.zeros(grey.shape)
    for side in (step, -step):
        counted = np.where(near & (grey + side >= threshold), grey + side, 0.0)
        derivative += counted / (2.0 * side)
    x = (np.arange(grey.shape[1])[None, :] - part.centroid_px[0]) * sx
    y = (np.arange(grey.shape[0])[:, None] - part.centroid_px[1]) * sy
    # The blur is its own transpose: it may act on the derivative instead of the noise.
    pull = sum(float(np.square(change.raised * smoothed(derivative * along)).sum()) for along in (x, y))
    return float(pixel_noise(frame.grey) * np.sqrt(pull / 2.0) / part.total_grey)


CLEAR_MOVEMENT = 6.0  # standard deviations of a position, more than the range of many positions at rest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mobility:
    """Positions of the light over a sequence, with steps, path and excursion.

    Attributes
    ----------
    position_mm
        Centroid (x, y) from the probe's axis in each frame, shape (frames, 2); NaN without contact.
    step_mm
        Distance from each frame to the next (6.14), shape (frames - 1,); NaN next to a frame without contact.
    path_mm
        Sum of the steps, which grows with each frame by noise. None without steps.
    excursion_mm
        Greatest distance between any two positions: the measure of mobility. None without steps.
    noise_mm
        Standard deviation of one coordinate by the pixels' noise alone, the mean over the frames.
    noise_path_mm
        Apparent path of an object at rest by that noise.
    against
        Content of the reference.
    assumptions
        Assumptions of the numbers, a message each.
    flags
        Short names of the defects.
    """

    position_mm: Floats
    step_mm: Floats
    path_mm: float | None
    excursion_mm: float | None
    noise_mm: float
    noise_path_mm: float
    against: str
    assumptions: tuple[str, ...]
    flags: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze_arrays(self, "position_mm", "step_mm")

    @property
    def notes(self) -> tuple[str, ...]:
        """The message of each flag."""
        return notes_of(self.flags)


def mobility(
    images: Sequence[TactileImage],
    reference: TactileImage | Sequence[TactileImage],
    *,
    against: str,
    calibration: Calibration | None = None,
    threshold_grey: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Mobility:
    """Follow the centroid of the light through a sequence of frames, from one to the next by the source's (6.14).

    Parameters
    ----------
    images
        At least two frames of one camera and one force, in the order of time.
    reference, against, calibration, threshold_grey
        As for `relative_size`.
    progress
        Called with (frames read, all frames).

    Returns
    -------
    Mobility
        Steps, path and excursion in mm.

    Raises
    ------
    InputError
        As `relative_size`, and when there are fewer than two frames or their known forces differ by more than 5 %.
    ImageMismatchError
        When the frames differ in size, scale, full scale or axis.

    Examples
    --------
    >>> from tsis.model.image import TactileImage
    >>> y, x = np.mgrid[:120, :160]
    >>> def frame(column, level=80.0):
    ...     hill = level * np.exp(-((x - column) ** 2 + (y - 60) ** 2) / 400.0)
    ...     return TactileImage(grey=hill, mm_per_pixel=(0.1, 0.1))
    >>> moved = mobility([frame(70), frame(90), frame(80)], frame(80, 0.0), against="untouched probe")
    >>> round(moved.path_mm, 2), round(moved.excursion_mm, 2)
    (3.0, 2.0)
    """
    frames = as_images("images", images)
    _check_sequence(frames)
    positions, spread, flags_of = list[tuple[float, float]](), list[float](), list[tuple[str, ...]]()
    for number, frame in enumerate(frames):  # frame by frame, to limit memory
        change = change_of_light(frame, reference, against=against, calibration=calibration)
        part = lit_part(change, threshold_grey)
        positions.append(_position_mm(part, frame))
        flags_of.append(part.flags)
        if part.centroid_px:
            spread.append(centroid_noise_mm(part, change, frame))
        if progress is not None:
            progress(number + 1, len(frames))
    position = np.array(positions)
    step = np.hypot(*np.diff(position, axis=0).T)  # (6.14)
    observed = np.isfinite(position[:, 0])
    noise = float(np.mean(spread)) if spread else 0.0
    any_step = bool(np.isfinite(step).any())
    excursion = float(scipy.spatial.distance.pdist(position[observed]).max()) if any_step else None
    sequence_flags = {
        "contact_lost": not observed.all() and bool(observed.any()),
        "repeated_frames": any(np.array_equal(one.grey, other.grey) for one, other in pairwise(frames)),
        "no_movement": excursion is not None and excursion <= CLEAR_MOVEMENT * noise,
    }
    part_flags = [flag for flags in flags_of for flag in flags if flag != "no_contact" or not observed.any()]
    return Mobility(
        position_mm=position,
        step_mm=step,
        path_mm=float(np.nansum(step)) if any_step else None,
        excursion_mm=excursion,
        noise_mm=noise,
        # The mean distance of two points with a standard deviation s along both axes is s sqrt(pi).
        noise_path_mm=float(np.count_nonzero(np.isfinite(step)) * noise * np.sqrt(np.pi)),
        against=against,
        assumptions=(
            SPHERE_ASSUMPTION,
            COMPARED_WITH[against],
            equal_light_assumption(calibration),
            "Probe and force are constant: a sliding probe shifts the light as an object does.",
        ),
        flags=tuple(dict.fromkeys([*part_flags, *(flag for flag, is_so in sequence_flags.items() if is_so)])),
    )


def _check_sequence(frames: list[TactileImage]) -> None:
    """Refuse fewer than two frames, and frames of different cameras or forces."""
    if len(frames) < 2:
        raise InputError(f"images must hold at least two frames to measure a movement; got {len(frames)}")
    forces = [frame.force_n for frame in frames if frame.force_n is not None]
    if forces and max(forces) > 1.05 * min(forces):
        raise InputError(f"images must be pressed with one force, within 5 %; got {min(forces):g} to {max(forces):g} N")
    for frame in frames[1:]:
        require_same_frame(frames[0], frame, "each of the images")
        if frame.axis() != frames[0].axis():
            raise ImageMismatchError(f"images must share axis_px {frames[0].axis()}; got {frame.axis()}")


def _position_mm(part: LitPart, frame: TactileImage) -> tuple[float, float]:
    """Centroid from the probe's axis; NaN when nothing is lit."""
    if part.centroid_px is None:
        return float("nan"), float("nan")
    axis, scale = frame.axis(), frame.scale()
    return (part.centroid_px[0] - axis[0]) * scale[0], (part.centroid_px[1] - axis[1]) * scale[1]
