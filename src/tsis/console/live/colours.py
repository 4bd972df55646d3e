"""Colour maps as the browser takes them: 256 words of 4 bytes, and the levels of their two ends."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from tsis.imaging import colour_map
from tsis.imaging.colour import COLOUR_MAPS
from tsis.model import TactileImage
from tsis.model.check import require_number, require_one_of
from tsis.model.errors import InputError

GREY = "grey"
MAPS = (*COLOUR_MAPS, GREY)
AUTO = "auto"
FULL = 255.0


@lru_cache(maxsize=len(MAPS))
def packed_colours(map_name: str) -> tuple[int, ...]:
    """256 colours as the words of 4 bytes that a canvas holds: red lowest, alpha 255."""
    if require_one_of("colour map", map_name, MAPS) == GREY:
        rgb = np.repeat(np.arange(256, dtype=np.uint32)[:, None], 3, axis=1)
    else:
        levels = np.arange(256, dtype=float)[None, :]
        rgb = colour_map(TactileImage(grey=levels), name=map_name)[0].astype(np.uint32)
    packed = rgb[:, 0] | rgb[:, 1] << 8 | rgb[:, 2] << 16 | np.uint32(255 << 24)
    return tuple(packed.tolist())


def checked_ends(ends: str | tuple[float, float]) -> str | list[float]:
    """The two ends of a colour map in levels of 255, or ``"auto"``.

    Raises
    ------
    InputError
        When they are neither, or lie outside [0, 255], or the upper one does not exceed the lower one.
    """
    if isinstance(ends, str):
        return require_one_of("ends", ends, (AUTO,))
    low, high = (require_number(name, end, 0.0, FULL) for name, end in zip(("low", "high"), ends, strict=True))
    if high <= low:
        raise InputError(f"high must exceed low = {low:g}; got {high:g}")
    return [low, high]
