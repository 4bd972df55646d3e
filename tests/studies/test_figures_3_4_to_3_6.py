"""What the study says of the light out of a pressed guide."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from studies.figures_3_4_to_3_6 import Result, draw, run

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="module")
def result() -> Result:
    return run()


def test_what_the_study_says(result: Result) -> None:
    both = result.top + result.bottom
    assert result.growth(result.top) == pytest.approx(1.23, abs=0.01)
    assert result.growth(both) == pytest.approx(0.73, abs=0.01)
    assert 0.15 < result.off_proportion(result.top) < 0.205
    assert (result.bottom[1:] > result.top[1:]).all()
    assert result.falling_modes == 2
    assert result.top[0] == pytest.approx(0.0, abs=1e-9)


def test_the_mean_out_of_the_top_grows_with_every_depth(result: Result) -> None:
    assert (np.diff(result.top) > 0.01).all()
    assert (np.diff(result.guided) < 0).all()
    np.testing.assert_allclose(result.guided + result.top + result.bottom, 1.0, atol=1e-4)  # the rest goes back


def test_the_picture_is_written(result: Result, tmp_path: Path) -> None:
    draw(result, tmp_path / "guide.png")
    assert (tmp_path / "guide.png").read_bytes().startswith(b"\x89PNG")
