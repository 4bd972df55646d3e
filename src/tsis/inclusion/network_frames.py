"""The three outputs of section 6.3.2, read off frames of the camera: as printed, and as they carry something."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.imaging import radial_profile
from tsis.inclusion.network_outputs import OutputReading
from tsis.model import Calibration
from tsis.model.check import require_number, require_type
from tsis.model.errors import InputError
from tsis.model.image_series import as_images, require_image_series

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.model import TactileImage


def printed_frame_outputs(
    images: TactileImage | Sequence[TactileImage], *, threshold_grey: float
) -> NDArray[np.float64]:
    """The outputs as section 6.3.2 prints them, of raw frames.

    Parameters
    ----------
    images
        Frames of the pressed probe.
    threshold_grey
        Grey level above which a pixel counts as deformed, in [0, 65535]; the source's k, which it does not give.

    Returns
    -------
    Grey level at the centroid, sum of grey levels, and number of pixels above the threshold; shape (n, 3).

    Raises
    ------
    InputError
        When there is no frame, or one is dark all over and so has no centroid.

    Examples
    --------
    >>> from tsis.model import TactileImage
    >>> printed_frame_outputs(TactileImage(grey=[[0.0, 2.0, 0.0], [2.0, 9.0, 2.0]]), threshold_grey=5.0).tolist()
    [[9.0, 15.0, 1.0]]
    """
    threshold = require_number("threshold_grey", threshold_grey, 0.0, 65535.0, hint="grey levels")
    frames = as_images("images", images)
    if not frames:
        raise InputError("images must hold a frame at least; got none")
    return np.array([_printed(frame, threshold) for frame in frames])


def _printed(frame: TactileImage, threshold: float) -> tuple[float, float, float]:
    grey, total = frame.grey, float(frame.grey.sum())
    if not total > 0:
        raise InputError(f"every frame must hold light; {frame.name or 'an image'!r} sums to {total:g} grey levels")
    rows, columns = np.indices(grey.shape)
    row, column = round(float((rows * grey).sum()) / total), round(float((columns * grey).sum()) / total)
    row, column = min(max(row, 0), grey.shape[0] - 1), min(max(column, 0), grey.shape[1] - 1)  # negative noise
    return float(grey[row, column]), total, float(np.count_nonzero(grey > threshold))


def frame_outputs(
    images: TactileImage | Sequence[TactileImage],
    reference: TactileImage,
    reading: OutputReading,
    *,
    calibration: Calibration,
) -> NDArray[np.float64]:
    """The three outputs of frames, in grey levels at even light; section 6.3.2.

    Parameters
    ----------
    images
        Frames of the pressed probe over inclusions, of known force and scale.
    reference
        The same press on plain tissue, with the same force.
    reading
        How the outputs are read.
    calibration
        Background, and how unevenly the face is lit.

    Returns
    -------
    Outputs of shape (n, 3): grey levels, grey levels times mm², and mm².

    Raises
    ------
    InputError
        When a force or scale is unknown, forces differ, or a ring lies outside the picture or is clipped all around.
    ImageMismatchError
        When the frames do not belong together.
    """
    require_type("calibration", calibration, Calibration)
    require_type("reading", reading, OutputReading)
    frames = [*as_images("images", images), *as_images("reference", reference)]
    if len(frames) < 2:
        raise InputError(f"images must hold a frame at least, beside the reference; got {len(frames) - 1}")
    require_image_series(frames)
    forces = {frame.force_n for frame in frames}
    if len(forces) > 1:
        raise InputError(f"force_n must be the same for all frames; got {sorted(str(force) for force in forces)}")
    rings = np.array([_ring_means(frame, reading.edges_mm, calibration) for frame in frames])
    unseen = int(np.isnan(rings).any(axis=0).sum())
    if unseen:
        raise InputError(
            f"every ring to {reading.edges_mm[-1]:g} mm must have lit pixels in the picture that are not clipped; "
            f"got {unseen} of {rings.shape[1]} rings without (lower the exposure or the reach)"
        )
    return reading(rings[:-1], rings[-1])


def _ring_means(frame: TactileImage, edges_mm: NDArray[np.float64], calibration: Calibration) -> NDArray[np.float64]:
    """Mean grey above the background in rings, at even light; NaN in rings that show nothing.

    Where a lamp makes pixels clip, the others of the ring stand for them: the press is round. Their sum over the sum of
    their light is, with photon noise, their best mean.
    """
    light: NDArray[np.floating[Any]] = np.ones(frame.grey.shape)
    if calibration.light is not None:
        (rows, columns), (x, y), (wide, high) = frame.grey.shape, frame.axis(), frame.scale()
        light = calibration.light.at((np.arange(columns) - x) * wide, (np.arange(rows) - y) * high)
    clipped = frame.grey >= frame.full_scale
    lit = replace(frame, grey=np.where(clipped, frame.full_scale, light))  # leaves the same pixels out
    seen, light_there = (radial_profile(one, edges_mm=edges_mm).mean_grey for one in (frame, lit))
    return np.asarray((seen - calibration.background_grey) / np.where(light_there > 0, light_there, np.nan))
