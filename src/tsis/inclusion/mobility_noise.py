"""How far the pixels' noise alone moves the centroid of the light."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from tsis.imaging.patch import pixel_noise, smoothed

if TYPE_CHECKING:
    from tsis.inclusion.relative_frames import LightChange
    from tsis.inclusion.relative_light import LitPart
    from tsis.model import TactileImage

EDGE_PX = 4  # width of the belt around the lit part in which noise may lift a pixel above the threshold
LEAST_STEP = 1e-3  # of the threshold, where a frame has next to no noise


def centroid_noise_mm(part: LitPart, change: LightChange, frame: TactileImage) -> float:
    """Standard deviation of one coordinate of the centroid by the noise of one frame, mm.

    Noise changes what a pixel inside weighs, and, twice as much, which pixels of the edge count at all. So the answer
    of the counted light to a change of grey level is a difference over the noise itself, which smears the edge as noise
    does. The reference's noise is left out: it shifts all frames of a sequence alike.
    """
    assert part.centroid_px is not None  # asked for lit parts only
    sx, sy = frame.scale()
    grey, threshold = change.image.grey, part.threshold_grey
    step = max(change.noise_grey, LEAST_STEP * threshold)
    near = ndimage.binary_dilation(part.mask, iterations=EDGE_PX)
    answer = np.zeros(grey.shape)
    for side in (step, -step):
        counted = np.where(near & (grey + side >= threshold), grey + side, 0.0)
        answer += counted / (2.0 * side)
    x = (np.arange(grey.shape[1])[None, :] - part.centroid_px[0]) * sx
    y = (np.arange(grey.shape[0])[:, None] - part.centroid_px[1]) * sy
    # The blur that the change went through is its own transpose, so it may act on the answer instead of the noise.
    pull = sum(float(np.square(change.raised * smoothed(answer * along)).sum()) for along in (x, y))
    return float(pixel_noise(frame.grey) * np.sqrt(pull / 2.0) / part.total_grey)
