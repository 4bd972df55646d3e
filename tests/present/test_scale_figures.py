from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from tsis.calibration.dot_board import DotDiagnostics
from tsis.calibration.measured import MeasuredValue
from tsis.calibration.scale import PixelScale
from tsis.model.image import TactileImage
from tsis.present.figures import dot_board

CELLS = np.array([(i, j) for j in range(3) for i in range(4)], dtype=float)
CENTRES = 30.0 + 60.0 * CELLS
RESIDUALS = np.zeros_like(CENTRES)
RESIDUALS[5] = (0.5, -0.25)


def found(residuals: np.ndarray[tuple[int, ...], np.dtype[np.float64]] = RESIDUALS, strays: int = 1) -> DotDiagnostics:
    return DotDiagnostics(
        centres_px=CENTRES,
        cells=CELLS,
        residuals_px=residuals,
        strays_px=np.full((strays, 2), 11.0),
        bright=False,
        width_px=8.0,
        order=3,
        distortion_chance=0.5,
        distorted=False,
        largest_change=0.01,
    )


def labels(figure: Figure) -> list[str]:
    legend = figure.axes[0].get_legend()
    assert legend is not None
    return [text.get_text() for text in legend.get_texts()]


def test_lattice_dots_and_residuals_are_where_they_were_found() -> None:
    figure = Figure()
    ax = figure.subplots()
    assert dot_board(found(), ax, magnified=40.0) is ax
    lattice, dots, residuals, strays = (np.array(line.get_data()) for line in ax.lines)
    assert lattice.shape == (2, 3 * (3 * 3 + 4 * 2))  # lines between neighbours, each with a gap
    np.testing.assert_allclose(dots.T, CENTRES)
    np.testing.assert_allclose(residuals[:, 3 * 5 : 3 * 5 + 2].T, [CENTRES[5], CENTRES[5] + (20.0, -10.0)])
    np.testing.assert_allclose(strays.ravel(), [11.0, 11.0])
    assert labels(figure) == ["lattice", "dots (12)", "residuals, 40 times", "no dots (1)"]
    low, high = ax.get_ylim()
    assert low > high  # as in an image


def test_the_longest_residual_is_a_third_of_the_dots_distance() -> None:
    figure = Figure()
    ax = dot_board(found(strays=0), figure.subplots())
    drawn = np.array(ax.lines[2].get_data()).T.reshape(-1, 3, 2)
    lengths = np.linalg.norm(drawn[:, 1] - drawn[:, 0], axis=1)
    assert lengths.max() == pytest.approx(20.0, rel=0.03)
    assert "no dots" not in " ".join(labels(figure))
    still = Figure()
    dot_board(found(np.zeros_like(CENTRES)), still.subplots())
    assert "residuals, 1 times" in labels(still)


def test_image_and_scale_are_drawn_too() -> None:
    size = MeasuredValue(value=0.05, sd=0.0002, unit="mm/px")
    scale = PixelScale(
        mm_per_pixel_x=size, mm_per_pixel_y=size, shape=(180, 240), at_px=(90.0, 100.0), method="dots", count=12
    )
    figure = Figure()
    ax = dot_board(found(), figure.subplots(), image=TactileImage(grey=np.zeros((180, 240))), scale=scale)
    assert len(ax.images) == 1
    assert ax.get_title() == "x: 0.05000 ± 0.00020 mm/px, y: 0.05000 ± 0.00020 mm/px"
    assert labels(figure)[-1] == "position of the scale"
    np.testing.assert_allclose(np.array(ax.lines[-1].get_data()).ravel(), [90.0, 100.0])
