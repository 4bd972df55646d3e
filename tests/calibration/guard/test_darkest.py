"""Parts of a frame that nothing touches: the darkest of a change, and the quadrants beyond the face."""

from __future__ import annotations

import numpy as np
import pytest

from tsis.calibration.guard.reading import RIM, FrameShape, darkest


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
