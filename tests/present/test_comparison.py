"""Two frames compared: one scale for both, the difference as it is, and features that are those of each alone."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from matplotlib.figure import Figure
from tests.records.sample import levels

from tsis.imaging import features
from tsis.model.image import TactileImage
from tsis.present.images import comparison

if TYPE_CHECKING:
    from tsis.present.page import Picture

SCALE = (0.12, 0.14)


def image(seed: int, height: float, name: str) -> TactileImage:
    return TactileImage(
        grey=levels(seed, height=height).astype(float), full_scale=255.0, force_n=1.0, mm_per_pixel=SCALE, name=name
    )


def shown(picture: Picture) -> tuple[np.ndarray, tuple[float, float], str]:
    """Pixels, ends of the colour map, and its name, as they are drawn."""
    figure = Figure()
    picture.draw(figure)
    (drawn,) = figure.axes[0].get_images()
    return np.asarray(drawn.get_array()), drawn.get_clim(), drawn.get_cmap().name


def test_both_frames_are_drawn_in_one_scale_and_the_difference_about_zero() -> None:
    one, other = image(1, 0.5, "a"), image(2, 0.2, "b")
    page = comparison(one, other)
    (first, limits, colours), (second, same, _), (change, about, diverging) = (shown(each) for each in page.pictures)
    top = max(one.grey.max(), other.grey.max())
    assert limits == same == (0.0, top)
    np.testing.assert_array_equal(first, one.grey)
    np.testing.assert_array_equal(second, other.grey)
    np.testing.assert_array_equal(change, one.grey - other.grey)
    assert about[0] == -about[1] == -np.abs(one.grey - other.grey).max()
    assert (colours, diverging) == ("viridis", "RdBu_r")


def test_lamps_that_have_warmed_up_differ_until_they_are_brought_to_the_same_light() -> None:
    rng = np.random.default_rng(5)
    cold = TactileImage(grey=100.0 + rng.normal(0, 0.01, (40, 60)), name="cold")
    warm = replace(cold, grey=1.05 * cold.grey, name="warm")
    assert "mean 5," in comparison(warm, cold).notes[0]
    matched = shown(comparison(warm, cold, match_light=True).pictures[2])[0]
    assert np.abs(matched).max() < 1e-9


def test_features_are_those_of_each_frame() -> None:
    one, other = image(1, 0.5, "a"), image(2, 0.2, "b")
    (table,) = comparison(one, other).tables
    assert table.headings == ("quantity", "a", "b")
    rows = {row[0]: row[1:] for row in table.rows}
    assert rows["peak"] == tuple(f"{features(each).peak:.1f} grey levels" for each in (one, other))


@pytest.mark.parametrize(
    ("other", "sentence"),
    [
        (TactileImage(grey=np.ones((3, 4)), name="b"), "must have the image's shape"),
        (replace(image(1, 0.5, "b"), full_scale=1023.0), "must have the image's full_scale"),
        (replace(image(1, 0.5, "b"), mm_per_pixel=(0.1, 0.1)), "must have the image's mm_per_pixel"),
    ],
)
def test_frames_that_cannot_be_subtracted_are_shown_all_the_same(other: TactileImage, sentence: str) -> None:
    page = comparison(image(2, 0.3, "a"), other)
    assert len(page.pictures) == 2
    assert "These two cannot be subtracted" in page.notes[0]
    assert sentence in page.notes[0]


def test_equal_frames_without_contact_are_compared() -> None:
    flat = TactileImage(grey=np.zeros((5, 6)), name="flat")
    page = comparison(flat, replace(flat, name="flat too"))
    assert "root mean square 0" in page.notes[0]
    assert page.tables[0].rows[0][1:] == ("none found: nothing stands out of the noise",) * 2
    assert shown(page.pictures[2])[1] == (-1.0, 1.0)
