"""Colour maps as the browser takes them."""

from __future__ import annotations

import re

import numpy as np
import pytest
from matplotlib import colormaps

from tsis.console.live.hub import GREY, MAPS, checked_ends, packed_colours
from tsis.errors import InputError, UnknownNameError
from tsis.imaging.colour import colour_map
from tsis.model.image import TactileImage


def unpacked(name: str) -> np.ndarray:
    """Bytes as a canvas holds them: red, green, blue, alpha."""
    return np.array(packed_colours(name), dtype="<u4").view(np.uint8).reshape(256, 4)


@pytest.mark.parametrize("name", [item for item in MAPS if item != GREY])
def test_each_level_gets_the_colour_of_the_saved_picture(name: str) -> None:
    whole = colour_map(TactileImage(grey=np.arange(256.0)[None, :]), name=name)[0]
    assert np.array_equal(unpacked(name)[:, :3], whole)
    assert (unpacked(name)[:, 3] == 255).all()


@pytest.mark.parametrize("name", MAPS)
def test_maps_are_those_that_matplotlib_names_so(name: str) -> None:
    theirs = colormaps["gray" if name == GREY else name](np.arange(256), bytes=True)[:, :3].astype(int)
    assert np.abs(unpacked(name)[:, :3] - theirs).max() <= 2


def test_an_unknown_map_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="jet"):
        packed_colours("jet")


def test_ends_are_two_levels_or_auto() -> None:
    assert checked_ends((10, 200)) == [10.0, 200.0]
    assert checked_ends("auto") == "auto"


@pytest.mark.parametrize("ends", [(10, 10), (200, 10), (-1, 10), (0, 256), (float("nan"), 3), (0, float("inf"))])
def test_ends_that_make_no_map_are_refused(ends: tuple[float, float]) -> None:
    with pytest.raises(InputError, match=re.compile("low|high")):
        checked_ends(ends)


def test_a_word_that_is_not_auto_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="automatic"):
        checked_ends("automatic")
