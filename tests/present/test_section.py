"""The section of the tissue has the estimate's lengths at one scale; a withheld estimate has no number in it."""

from __future__ import annotations

import re

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from tsis import Estimate
from tsis.errors import InputError
from tsis.present.figures import tissue_section
from tsis.present.inclusion import estimate_pictures

SD = {"diameter_mm": 3.0, "depth_mm": 3.0, "young_kpa": 40.0}


def samples() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(17)
    return {
        "diameter_mm": rng.normal(8, 0.3, 500),
        "depth_mm": rng.normal(5, 0.2, 500),
        "young_kpa": np.full(500, 90.0),
    }


def texts(figure: Figure) -> str:
    figure.canvas.draw()
    found = [text for ax in figure.axes for text in (*ax.texts, *ax.get_xticklabels(), *ax.get_yticklabels())]
    return " ".join(text.get_text() for text in found)


def test_the_inclusion_is_drawn_to_scale_with_its_spread() -> None:
    ax = Figure().subplots()
    tissue_section(Estimate(samples=samples(), prior_sd=SD), ax)
    circles = [patch for patch in ax.patches if isinstance(patch, Circle)]
    thick = max(circles, key=lambda circle: circle.get_linewidth())
    top_mm = thick.center[1] - thick.radius
    assert 2 * thick.radius == pytest.approx(8.0, abs=0.1)
    assert top_mm == pytest.approx(5.0, abs=0.1)
    assert np.std([2 * circle.radius for circle in circles if circle is not thick]) == pytest.approx(0.3, rel=0.35)
    assert ax.get_aspect() == 1.0
    assert ax.get_ylim()[0] > ax.get_ylim()[1]


def test_a_withheld_estimate_says_why_and_shows_no_number() -> None:
    estimate = Estimate(samples=samples(), prior_sd=SD, trusted=False, flags=("contact_cropped",))
    for picture in estimate_pictures(estimate):
        figure = Figure()
        picture.draw(figure)
        assert "contact" in texts(figure)
        assert not re.search(r"\d", texts(figure))
        assert not any(isinstance(patch, Circle) for ax in figure.axes for patch in ax.patches)


def test_a_section_needs_size_and_depth() -> None:
    with pytest.raises(InputError, match="lacks diameter_mm, depth_mm"):
        tissue_section(Estimate(samples={"young_kpa": [1.0, 2.0]}, prior_sd={"young_kpa": 1.0}), Figure().subplots())
