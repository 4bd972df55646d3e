"""What the guard reads of a frame: parts that nothing touches, the lamps, light from outside."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tsis.calibration.guard.reading import RIM, FrameShape, OutsideLevel, darkest, lamps_and_ambient


@pytest.mark.parametrize("columns", [120, 121, 123])
@pytest.mark.parametrize("rows", [80, 82])
@pytest.mark.parametrize("across", [False, True], ids=["left", "top"])
def test_the_part_that_is_level_with_the_lowest_is_found(rows: int, columns: int, across: bool) -> None:
    noise = np.random.default_rng(3).normal(scale=0.5, size=(rows, columns))
    apart = (np.arange(rows)[:, None] < 32) if across else (np.arange(columns) < 40)
    untouched = np.broadcast_to(apart, noise.shape)
    lowest, found = darkest(noise + np.where(untouched, 2.0, 30.0))
    assert lowest == pytest.approx(2.0, abs=0.5)
    assert found is not None
    assert found.shape == noise.shape
    assert (found == untouched).mean() > 0.94  # to a row of blocks, of four pixels, at the border
    assert found[untouched].mean() > 0.9


def test_a_small_dark_part_is_not_taken_for_what_nothing_touches() -> None:
    change = np.full((80, 120), 30.0) + np.random.default_rng(3).normal(scale=0.5, size=(80, 120))
    change[:20, :40] -= 28.0  # a twelfth of the frame
    lowest, found = darkest(change)
    assert lowest == pytest.approx(2.0, abs=0.5)
    assert found is None


def test_the_four_corners_lie_beyond_the_face() -> None:
    """Their blocks are those beyond the rim, each in one corner, upper left and lower left first."""
    shape = FrameShape(rows=240, columns=320, full_scale=255.0, axis_px=(159.5, 119.5), mm_per_pixel=(0.1, 0.1))
    x, y = shape.positions()
    corners = shape.beyond_rim(12.0)
    assert len(corners) == 4
    far = np.hypot(x, y[:, None]) > RIM * 12.0
    np.testing.assert_array_equal(np.sum(corners, axis=0), far)
    assert far.sum() > 40
    centres = [((x * part).sum() / part.sum(), (y[:, None] * part).sum() / part.sum()) for part in corners]
    assert [(bool(column > 0), bool(row > 0)) for column, row in centres] == [
        (False, False),
        (False, True),
        (True, False),
        (True, True),
    ]
    off = FrameShape(rows=240, columns=320, full_scale=255.0, axis_px=(-10.0, -10.0), mm_per_pixel=(0.1, 0.1))
    assert len(off.beyond_rim(12.0)) == 1


PIXELS = np.zeros((2, 2))
DARK, LIT, DIM = 8.0, 120.0, 30.0  # grey levels before


def change(
    *, ratio: float, added: float, dark: float | None = DARK, patch: float | None = LIT, place: float | None = DIM
) -> tuple[float | None, float | None]:
    """What is found after the lamps changed by ``ratio`` and ambient light added ``added``."""
    base = dark or 0.0

    def now(level: float) -> float:
        return base + ratio * (level - base) + added

    prepared: Any = SimpleNamespace(
        dark_grey=dark,
        least_lit=20.0,
        patch_before=patch,
        patch_level=lambda _: None if patch is None else now(patch),
    )
    outside = (
        OutsideLevel(level=0.0) if place is None else OutsideLevel(level=0.0, before=place, since=now(place) - place)
    )
    return lamps_and_ambient(PIXELS, outside, prepared)


@pytest.mark.parametrize("ratio", [0.9, 1.0, 1.25])
@pytest.mark.parametrize("added", [0.0, 6.0])
@pytest.mark.parametrize("dark", [None, DARK])
def test_two_levels_give_lamps_and_ambient_light(ratio: float, added: float, dark: float | None) -> None:
    lamps, ambient = change(ratio=ratio, added=added, dark=dark)
    assert lamps == pytest.approx(ratio - 1)
    assert ambient == pytest.approx(added)


@pytest.mark.parametrize("ratio", [0.9, 1.25])
@pytest.mark.parametrize("place", [None, LIT - 10.0], ids=["no place", "a place as bright"])
def test_a_patch_alone_gives_the_change_of_the_lamps(ratio: float, place: float | None) -> None:
    lamps, ambient = change(ratio=ratio, added=0.0, place=place)
    assert lamps == pytest.approx(ratio - 1)
    assert ambient is None


def test_a_place_alone_gives_one_of_the_two() -> None:
    """A lit place gives the change of the lamps, a dark one the ambient light."""
    lamps, ambient = change(ratio=1.1, added=0.0, patch=None, place=60.0)
    assert lamps == pytest.approx(0.1)
    assert ambient is None
    for dark, place in ((DARK, 12.0), (None, 60.0)):
        lamps, ambient = change(ratio=1.0, added=5.0, patch=None, dark=dark, place=place)
        assert lamps is None
        assert ambient == pytest.approx(5.0)
    assert change(ratio=1.0, added=5.0, patch=None, place=None) == (None, None)
