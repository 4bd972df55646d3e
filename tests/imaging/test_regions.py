"""Profiles, regions and distances against SciPy's interpolation, scikit-image's drawing and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
import skimage
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from tsis.errors import InputError, UnknownNameError
from tsis.imaging.regions import distance, line_profile, region_mask, region_statistics
from tsis.model.image import TactileImage

ROWS, COLUMNS = 40, 60
points = st.tuples(st.floats(0, COLUMNS - 1), st.floats(0, ROWS - 1))


def noise(seed: int = 11, **more: object) -> TactileImage:
    grey = np.random.default_rng(seed).integers(0, 256, (ROWS, COLUMNS)).astype(float)
    return TactileImage(grey=grey, **more)  # type: ignore[arg-type]


@settings(max_examples=60)
@given(start=points, end=points)
def test_a_profile_is_the_frame_interpolated_along_the_line(
    start: tuple[float, float], end: tuple[float, float]
) -> None:
    if math.dist(start, end) < 1e-3:
        return
    image = noise()
    profile = line_profile(image, start, end)
    share = profile.distance / math.dist(start, end)
    x, y = (a + share * (b - a) for a, b in zip(start, end, strict=True))
    expected = ndimage.map_coordinates(image.grey, [y, x], order=1, mode="nearest")
    assert profile.grey == pytest.approx(expected, abs=1e-6)
    assert (profile.distance[0], profile.unit) == (0.0, "px")
    assert profile.distance[-1] == pytest.approx(math.dist(start, end))
    assert np.diff(profile.distance).max() <= 1.0 + 1e-9  # at least one a pixel


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.2, 2.9])
def test_a_profile_of_a_ramp_is_a_straight_line_whatever_its_width(angle: float) -> None:
    x, y = np.meshgrid(np.arange(90.0), np.arange(90.0))
    image = TactileImage(grey=2.0 * x + 0.5 * y, mm_per_pixel=(0.1, 0.1))
    run, rise = 30 * math.cos(angle), 30 * math.sin(angle)
    start, end = (45 - run, 45 - rise), (45 + run, 45 + rise)
    for width in (1, 5):
        profile = line_profile(image, start, end, width_px=width)
        first = 2.0 * start[0] + 0.5 * start[1]
        slope = (2.0 * run + 0.5 * rise) / 3.0  # grey levels a millimetre: 60 pixels are 6 mm
        assert profile.unit == "mm"
        assert profile.distance[-1] == pytest.approx(6.0)
        assert profile.grey == pytest.approx(first + slope * profile.distance, abs=1e-6)


def test_a_wider_profile_averages_across_the_line() -> None:
    image = noise()
    profile = line_profile(image, (10, 20), (40, 20), width_px=5)
    assert profile.grey == pytest.approx(image.grey[18:23, 10:41].mean(axis=0))


@settings(max_examples=60)
@given(corner=points, other=points)
def test_a_rectangle_has_the_pixels_whose_centres_lie_in_it(
    corner: tuple[float, float], other: tuple[float, float]
) -> None:
    left, right = sorted((corner[0], other[0]))
    top, bottom = sorted((corner[1], other[1]))
    slow = [[left <= x <= right and top <= y <= bottom for x in range(COLUMNS)] for y in range(ROWS)]
    assert np.array_equal(region_mask((ROWS, COLUMNS), "rectangle", corner, other), slow)


@pytest.mark.parametrize(("centre", "radii"), [((30.2, 20.1), (12.3, 7.7)), ((5.0, 30.0), (9.4, 15.2))])
def test_an_ellipse_has_the_pixels_that_scikit_image_draws(
    centre: tuple[float, float], radii: tuple[float, float]
) -> None:
    corner, other = (tuple(c + sign * r for c, r in zip(centre, radii, strict=True)) for sign in (-1, 1))
    expected = np.zeros((ROWS, COLUMNS), dtype=bool)
    expected[skimage.draw.ellipse(centre[1], centre[0], radii[1], radii[0], shape=(ROWS, COLUMNS))] = True  # type: ignore[no-untyped-call]
    assert np.array_equal(region_mask((ROWS, COLUMNS), "ellipse", corner, other), expected)  # type: ignore[arg-type]


def test_statistics_are_those_of_numpy_over_the_cut_out() -> None:
    image = noise(mm_per_pixel=(0.1, 0.2))
    found = region_statistics(image, "rectangle", (30.4, 25.4), (9.6, 11.6))
    cut = image.grey[12:26, 10:31]
    assert (found.count, found.unit) == (cut.size, "mm")
    assert (found.minimum, found.maximum, found.median) == (cut.min(), cut.max(), np.median(cut))
    assert found.mean == pytest.approx(cut.mean())
    assert found.sd == pytest.approx(cut.std(ddof=1))
    assert found.area == pytest.approx(cut.size * 0.02)
    assert found.clipped_count == int((cut == 255).sum())


def test_an_ellipse_fills_a_quarter_of_pi_of_its_rectangle() -> None:
    image = TactileImage(grey=np.ones((400, 600)))
    inside, around = (region_statistics(image, kind, (20, 30), (580, 370)) for kind in ("ellipse", "rectangle"))
    assert inside.area / around.area == pytest.approx(math.pi / 4, rel=0.005)
    assert (inside.mean, inside.sd) == (1.0, 0.0)


def test_a_distance_is_in_millimetres_where_the_scale_is_known() -> None:
    scaled, unit = distance(noise(mm_per_pixel=(0.1, 0.2)), (0, 0), (30, 20))
    assert unit == "mm"
    assert scaled == pytest.approx(5.0)
    bare, unit = distance(noise(), (0, 0), (3, 4))
    assert unit == "px"
    assert bare == pytest.approx(5.0)


def test_one_pixel_and_a_flat_ellipse_are_regions() -> None:
    image = noise()
    one = region_statistics(image, "rectangle", (5, 7), (5, 7))
    assert (one.count, one.sd, one.mean) == (1, 0.0, image.grey[7, 5])
    assert region_statistics(image, "ellipse", (5, 7), (9, 7)).count == 5


@pytest.mark.parametrize("end", [(math.nan, 1.0), (math.inf, 1.0), (1.0, 1.0), (1e6, 1.0), (1.0,), ("a", 2)])
def test_a_line_to_nowhere_is_refused(end: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="end_px"):
        line_profile(noise(), (1.0, 1.0), end)


def test_a_region_beside_the_frame_and_an_unknown_kind_are_refused() -> None:
    with pytest.raises(InputError, match="pixels of the frame"):
        region_statistics(noise(), "ellipse", (-20, -20), (-10, -10))
    with pytest.raises(UnknownNameError, match="star"):
        region_statistics(noise(), "star", (1, 1), (5, 5))
