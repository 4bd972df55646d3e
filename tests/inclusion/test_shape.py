"""Two means from the corners, and shapes of drawn objects."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.cluster.vq import kmeans2
from skimage.filters import threshold_otsu
from skimage.measure import label, regionprops

from tsis.errors import ImageMismatchError, InputError, UnknownNameError
from tsis.inclusion.frames import binary_image
from tsis.inclusion.shape import object_shape, two_means
from tsis.model.image import TactileImage

SHAPE = (120, 160)
UNTOUCHED, PLAIN = "untouched probe", "plain tissue"

grey_levels = arrays(
    np.float64, st.tuples(st.integers(2, 12), st.integers(2, 12)), elements=st.integers(0, 255).map(float)
)


@given(grey_levels)
def test_every_level_is_nearer_to_the_mean_of_its_own_class(grey: np.ndarray) -> None:
    """Conditions (6.12) and (6.13), with the means of the two classes that the threshold makes."""
    found = two_means(grey)
    objects = grey[grey >= found.threshold_grey]
    background = grey[grey < found.threshold_grey]
    if objects.size and background.size:
        assert found.object_grey == pytest.approx(objects.mean())
        assert found.background_grey == pytest.approx(background.mean())
        assert (np.abs(objects - background.mean()) <= np.abs(objects - objects.mean()) + 1e-9).sum() <= np.sum(
            np.isclose(objects, found.threshold_grey)
        )
        assert (np.abs(background - background.mean()) <= np.abs(background - objects.mean())).all()
    else:
        assert np.ptp(grey) == 0


@given(st.integers(0, 2**32 - 1), st.floats(0.1, 10.0), st.floats(-50.0, 50.0))
def test_threshold_follows_brightness_and_contrast_of_levels_without_ties(
    seed: int, gain: float, offset: float
) -> None:
    grey = np.random.default_rng(seed).uniform(0.0, 255.0, (6, 7))
    before, after = two_means(grey), two_means(gain * grey + offset)
    assert after.threshold_grey == pytest.approx(gain * before.threshold_grey + offset, rel=1e-9, abs=1e-9)


@given(grey_levels, st.integers(-3, 3))
def test_threshold_follows_contrast_exactly_where_no_digit_is_rounded(grey: np.ndarray, power: int) -> None:
    assert two_means(2.0**power * grey).threshold_grey == 2.0**power * two_means(grey).threshold_grey


@given(grey_levels, st.floats(0.1, 10.0), st.floats(-50.0, 50.0))
def test_level_midway_between_the_means_may_fall_on_either_side(grey: np.ndarray, gain: float, offset: float) -> None:
    """Whole levels tie often. Rounding then decides, so brightness and contrast matter: but only at such a tie."""
    before, after = two_means(grey), two_means(gain * grey + offset)
    if after.threshold_grey != pytest.approx(gain * before.threshold_grey + offset, rel=1e-6, abs=1e-6):
        midways = set()
        low, high = before.corners_grey, (grey.sum() - 4 * before.corners_grey) / (grey.size - 4)
        for _ in range(grey.size):
            midways.add((low + high) / 2)
            below, above = grey[grey < (low + high) / 2], grey[grey >= (low + high) / 2]
            if not below.size or not above.size:
                break
            low, high = below.mean(), above.mean()
        assert any(np.isclose(grey, midway, rtol=1e-12, atol=1e-9).any() for midway in midways)


@pytest.mark.parametrize("seed", range(5))
def test_it_ends_where_k_means_ends_from_the_same_start(seed: int) -> None:
    rng = np.random.default_rng(seed)
    grey = rng.normal(20.0, 6.0, (40, 50))
    grey[10:30, 15:40] += rng.uniform(40.0, 90.0)
    corners = grey[[0, 0, -1, -1], [0, -1, 0, -1]]
    start = np.array([[corners.mean()], [(grey.sum() - corners.sum()) / (grey.size - 4)]])
    means, _ = kmeans2(grey.reshape(-1, 1), start, iter=50, minit="matrix")
    found = two_means(grey)
    assert [found.background_grey, found.object_grey] == pytest.approx(means.ravel().tolist())


@pytest.mark.parametrize("grey", [np.zeros(5), np.zeros((1, 5)), np.full((4, 4), np.nan), "grey"])
def test_levels_must_be_a_picture(grey: Any) -> None:
    with pytest.raises(InputError, match="grey"):
        two_means(grey)


def test_a_binary_image_has_two_levels() -> None:
    image = TactileImage(grey=np.arange(12.0).reshape(3, 4), full_scale=100.0, mm_per_pixel=(0.1, 0.1))
    binary = binary_image(image, 5.0)
    assert set(np.unique(binary.grey)) == {0.0, 100.0}
    np.testing.assert_array_equal(binary.grey > 0, image.grey >= 5.0)
    with pytest.raises(InputError, match="threshold_grey"):
        binary_image(image, float("nan"))


def ellipse(
    *,
    semi_axes_mm: tuple[float, float] = (2.0, 1.2),
    angle_deg: float = 0.0,
    centre_mm: tuple[float, float] = (0.3, -0.2),
    level: float = 60.0,
    scale: tuple[float, float] = (0.05, 0.06),
) -> TactileImage:
    """An ellipse of light with a steep edge half a pixel wide."""
    x = (np.arange(SHAPE[1])[None, :] - (SHAPE[1] - 1) / 2) * scale[0] - centre_mm[0]
    y = (np.arange(SHAPE[0])[:, None] - (SHAPE[0] - 1) / 2) * scale[1] - centre_mm[1]
    turn = np.radians(angle_deg)
    along, across = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    outside = np.hypot(along / semi_axes_mm[0], across / semi_axes_mm[1]) - 1.0
    return TactileImage(grey=10.0 + level * np.clip(0.5 - 40.0 * outside, 0.0, 1.0), mm_per_pixel=scale)


def dark(image: TactileImage) -> TactileImage:
    return replace(image, grey=np.full(SHAPE, 10.0))


@given(st.floats(1.0, 2.5), st.floats(0.4, 0.9), st.floats(0.0, 179.0))
@settings(max_examples=20)
def test_ellipse_has_its_closed_form_numbers(long: float, aspect: float, angle: float) -> None:
    """Whole pixels blur an outline: every length is right to a quarter of a pixel."""
    image = ellipse(semi_axes_mm=(long, aspect * long), angle_deg=angle)
    quarter_mm = 0.25 * max(image.scale())
    ramanujan = 3 * (1 + aspect) - np.sqrt((3 + aspect) * (1 + 3 * aspect))  # perimeter over pi times the longer axis
    shape = object_shape(image, dark(image), against=UNTOUCHED)
    assert shape.flags == ()
    assert shape.area_mm2 == pytest.approx(np.pi * aspect * long**2, abs=np.pi * long * ramanujan * quarter_mm / 2)
    assert shape.centre_mm == pytest.approx((0.3, -0.2), abs=quarter_mm)
    assert shape.semi_axes_mm == pytest.approx((long, aspect * long), abs=quarter_mm)
    assert shape.eccentricity == pytest.approx(np.sqrt(1 - aspect**2), abs=0.03)
    assert shape.angle_deg is not None
    assert (shape.angle_deg - angle + 90.0) % 180.0 == pytest.approx(90.0, abs=3.0)
    assert shape.circularity == pytest.approx(4 * aspect / ramanujan**2, abs=0.02)


def test_the_outline_encloses_the_area() -> None:
    image = ellipse(angle_deg=30.0)
    shape = object_shape(image, dark(image), against=UNTOUCHED)
    x, y = shape.contour_mm.T
    assert (x[0], y[0]) == (x[-1], y[-1])
    enclosed = abs(np.sum(x[:-1] * np.diff(y) - y[:-1] * np.diff(x))) / 2
    assert enclosed == pytest.approx(shape.area_mm2, rel=0.01)
    assert (x.mean(), y.mean()) == pytest.approx((0.3, -0.2), abs=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_it_agrees_with_scikit_image_on_noisy_objects(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = ellipse(angle_deg=20.0)
    image = replace(image, grey=np.rint(image.grey + rng.normal(0.0, 3.0, SHAPE)))
    shape = object_shape(image, dark(image), against=UNTOUCHED)
    lit = image.grey > threshold_otsu(image.grey)  # type: ignore[no-untyped-call]
    regions = regionprops(label(lit), spacing=(0.06, 0.05))  # type: ignore[no-untyped-call]
    largest = max(regions, key=lambda region: region.area)
    assert shape.area_mm2 == pytest.approx(largest.area, rel=0.02)
    assert shape.semi_axes_mm is not None
    axes = largest.axis_major_length / 2, largest.axis_minor_length / 2
    assert shape.semi_axes_mm == pytest.approx(axes, rel=0.02)
    assert shape.eccentricity == pytest.approx(largest.eccentricity, abs=0.02)


def test_a_circle_is_rounder_than_a_bar() -> None:
    x, y = np.meshgrid(np.arange(160), np.arange(120))
    bar = np.where((np.abs(x - 80) < 50) & (np.abs(y - 60) < 8), 70.0, 10.0)
    image = TactileImage(grey=bar, mm_per_pixel=(0.05, 0.05))
    shape = object_shape(image, dark(image), against=UNTOUCHED)
    round_one = object_shape(ellipse(semi_axes_mm=(1.5, 1.5)), dark(ellipse()), against=UNTOUCHED)
    assert shape.circularity is not None
    assert shape.circularity < 0.55
    assert round_one.circularity == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("seed", range(5))
def test_noise_has_no_shape(seed: int) -> None:
    rng = np.random.default_rng(seed)
    frames = [
        TactileImage(grey=np.rint(10.0 + rng.normal(0.0, 1.0, SHAPE)), mm_per_pixel=(0.05, 0.05)) for _ in range(2)
    ]
    shape = object_shape(frames[0], frames[1], against=UNTOUCHED)
    assert shape.flags == ("no_contact",)
    assert (shape.area_mm2, shape.eccentricity, shape.contour_mm.shape) == (None, None, (0, 2))
    assert "nothing to measure" in shape.notes[0]


def test_two_even_frames_have_no_shape() -> None:
    image = dark(ellipse())
    assert object_shape(image, image, against=UNTOUCHED).flags == ("no_contact",)


def test_what_is_wrong_is_flagged() -> None:
    def flags(image: TactileImage) -> tuple[str, ...]:
        return object_shape(image, dark(image), against=UNTOUCHED).flags

    assert flags(ellipse(centre_mm=(3.5, 0.0))) == ("cropped",)
    bright = ellipse(level=400.0)
    assert flags(replace(bright, grey=np.minimum(bright.grey, 255.0))) == ("saturated",)
    middle = ellipse()
    inverted = replace(middle, grey=80.0 - middle.grey)
    assert set(flags(inverted)) == {"cropped", "corners_lit"}


@pytest.mark.parametrize(
    ("reference", "against", "error"),
    [
        (dark(ellipse()), "nothing", UnknownNameError),
        (replace(dark(ellipse()), mm_per_pixel=(0.1, 0.1)), PLAIN, ImageMismatchError),
        (TactileImage(grey=np.zeros((4, 4)), mm_per_pixel=(0.05, 0.06)), PLAIN, ImageMismatchError),
        ([], PLAIN, InputError),
    ],
)
def test_frames_that_do_not_belong_together_are_refused(reference: Any, against: str, error: type[Exception]) -> None:
    with pytest.raises(error):
        object_shape(ellipse(), reference, against=against)
