"""A frame as a small coloured picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from tsis.imaging import colour_map
from tsis.imaging.colour import COLOUR_MAPS
from tsis.model import TactileImage
from tsis.model.check import require_integer, require_one_of

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

SMALLEST_PX, LARGEST_PX = 16, 1024  # of the longer side
GREY = "grey"
MAPS = (GREY, *sorted(COLOUR_MAPS))


def thumbnail_png(levels: NDArray[Any], *, full_scale: float, size: int, name: str) -> bytes:
    """A frame made small by averaging over its pixels, coloured from black to its full scale, as a PNG file.

    Parameters
    ----------
    levels
        Grey levels, shape (rows, columns).
    full_scale
        Grey level of the map's upper end.
    size
        Of the longer side in pixels, in [16, 1024]; a frame that is smaller stays as it is.
    name
        ``"grey"``, ``"cividis"``, ``"inferno"`` or ``"viridis"``.

    Raises
    ------
    InputError
        When the size lies outside its range.
    UnknownNameError
        When no map has that name.
    """
    require_integer("size", size, SMALLEST_PX, LARGEST_PX, hint="pixels of the longer side")
    require_one_of("colour map", name, MAPS)
    grey = levels.astype(np.float64)
    share = size / max(grey.shape)
    if share < 1.0:
        rows, columns = (max(1, round(side * share)) for side in grey.shape)
        grey = np.asarray(cv2.resize(grey, (columns, rows), interpolation=cv2.INTER_AREA), dtype=np.float64)
    return _png(grey, full_scale, name)


def _png(grey: NDArray[np.float64], full_scale: float, name: str) -> bytes:
    if name == GREY:
        shown: NDArray[np.uint8] = np.rint(np.clip(grey / full_scale, 0.0, 1.0) * 255.0).astype(np.uint8)
    else:
        shown = colour_map(TactileImage(grey=grey, full_scale=full_scale), name=name)[..., ::-1]
    _, content = cv2.imencode(".png", shown)
    return content.tobytes()
