from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.measure import regionprops

import tsis
from tsis.errors import ImageMismatchError, InputError, UnknownNameError
from tsis.imaging import features
from tsis.imaging.patch import segment
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from tests.imaging.conftest import DrawEllipse

SCALES = [(0.05, 0.05), (0.04, 0.07), (0.08, 0.05)]


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("method", ["otsu", "half"])
def test_a_disc_has_its_closed_form_numbers(draw_ellipse: DrawEllipse, scale: tuple[float, float], method: str) -> None:
    image = draw_ellipse(centre_mm=(0.313, -0.171), semi_axes_mm=(1.7, 1.7), level=80.0, mm_per_pixel=scale)
    found = features(image, method=method)
    area = np.pi * 1.7**2
    assert found.contact
    assert not found.cropped
    assert found.centroid_mm == pytest.approx((0.313, -0.171), abs=0.005)
    assert found.area_mm2 == pytest.approx(area, rel=0.01)
    assert found.equivalent_diameter_mm == pytest.approx(3.4, rel=0.005)
    assert found.semi_axes_mm == pytest.approx((1.7, 1.7), rel=0.01)
    assert found.eccentricity == pytest.approx(0.0, abs=0.12)
    assert found.circularity == pytest.approx(1.0, abs=0.005)
    assert found.peak == pytest.approx(80.0, rel=1e-6)
    assert found.total == pytest.approx(80.0 * area / (scale[0] * scale[1]), rel=0.015)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0, 135.0])
def test_an_ellipse_has_its_closed_form_shape_on_the_face(
    draw_ellipse: DrawEllipse, scale: tuple[float, float], angle: float
) -> None:
    found = features(draw_ellipse(semi_axes_mm=(2.0, 1.0), angle_deg=angle, mm_per_pixel=scale))
    assert found.semi_axes_mm == pytest.approx((2.0, 1.0), rel=0.01)
    assert found.eccentricity == pytest.approx(np.sqrt(0.75), abs=0.01)
    assert found.angle_deg is not None
    assert (found.angle_deg - angle + 90.0) % 180.0 == pytest.approx(90.0, abs=1.0)
    # Ramanujan's perimeter of an ellipse, good to 1e-5 here.
    perimeter = np.pi * (9.0 - np.sqrt(7.0 * 5.0))
    assert found.circularity == pytest.approx(4.0 * np.pi * (2.0 * np.pi) / perimeter**2, abs=0.005)


def test_it_agrees_with_scikit_image(draw_ellipse: DrawEllipse) -> None:
    image = draw_ellipse(centre_mm=(0.4, 0.2), semi_axes_mm=(2.3, 1.2), angle_deg=25.0)
    ramp = np.linspace(0.5, 1.0, image.grey.shape[1])
    image = replace(image, grey=image.grey * ramp)
    found = features(image)
    (region,) = regionprops(found.patch.mask.astype(np.int32), intensity_image=image.grey)  # type: ignore[no-untyped-call]
    assert found.area_px == region.area
    assert found.centroid_px == pytest.approx(region.centroid_weighted[::-1])
    # Some releases of scikit-image take pixels as points and not as squares.
    assert found.semi_axes_px == pytest.approx((region.axis_major_length / 2, region.axis_minor_length / 2), abs=0.01)
    assert found.eccentricity == pytest.approx(region.eccentricity, abs=1e-3)
    assert found.equivalent_diameter_px == pytest.approx(region.equivalent_diameter_area)
    assert found.total == pytest.approx(region.image_intensity.sum())


@settings(max_examples=25)
@given(dx=st.integers(-25, 25), dy=st.integers(-15, 15), gain=st.floats(0.2, 2.4))
def test_moving_moves_the_centroid_and_gain_scales_the_levels(dx: int, dy: int, gain: float) -> None:
    y, x = np.mgrid[:100, :140]
    hill = np.maximum(0.0, 1.0 - ((x - 70) ** 2 + (y - 50) ** 2) / 20.0**2)
    hill *= 1.0 + 0.3 * (x - 70) / 20.0
    still = features(TactileImage(grey=90.0 * hill))
    moved = features(TactileImage(grey=90.0 * gain * np.roll(hill, (dy, dx), axis=(0, 1))))
    assert still.centroid_px is not None
    assert moved.centroid_px == pytest.approx((still.centroid_px[0] + dx, still.centroid_px[1] + dy), abs=1e-6)
    assert moved.peak == pytest.approx(gain * still.peak, rel=1e-9)
    assert moved.total == pytest.approx(gain * still.total, rel=1e-9)
    assert moved.area_px == still.area_px


def test_reference_and_inversion_give_the_numbers_of_the_bare_change(draw_ellipse: DrawEllipse) -> None:
    touch = draw_ellipse(semi_axes_mm=(1.5, 1.5), level=60.0)
    y, x = np.mgrid[: touch.grey.shape[0], : touch.grey.shape[1]]
    reference = replace(touch, grey=120.0 + 20.0 * np.cos(x / 50.0) * np.cos(y / 40.0))
    bare = features(touch)
    for sign in (1.0, -1.0):
        pressed = replace(reference, grey=reference.grey + sign * touch.grey)
        found = features(pressed, reference, invert=sign < 0)
        assert found.total == pytest.approx(bare.total, rel=1e-9)
        assert found.centroid_px == pytest.approx(bare.centroid_px)
        assert found.area_px == bare.area_px


@pytest.mark.parametrize("method", ["otsu", "half", "noise"])
@pytest.mark.parametrize("whole_levels", [True, False])
def test_no_contact_reads_zero(method: str, whole_levels: bool) -> None:
    rng = np.random.default_rng(23)
    for _ in range(5):
        grey = 40.0 + rng.normal(0.0, 3.0, (2, 240, 320))
        frames = [TactileImage(grey=np.rint(part) if whole_levels else part, mm_per_pixel=(0.1, 0.1)) for part in grey]
        found = features(*frames, method=method)
        assert not found.contact
        assert (found.peak, found.total, found.area_px, found.area_mm2) == (0.0, 0.0, 0.0, 0.0)
        assert found.centroid_px is None
        assert found.patch.contour_px.shape == (0, 2)


def test_a_flat_frame_is_no_contact() -> None:
    assert not features(TactileImage(grey=np.full((30, 30), 77.0))).contact
    assert not features(TactileImage(grey=np.array([[5.0]]))).contact


def test_a_faint_press_is_found_above_the_noise(draw_ellipse: DrawEllipse) -> None:
    rng = np.random.default_rng(29)
    touch = draw_ellipse(centre_mm=(1.0, 0.5), semi_axes_mm=(1.5, 1.5), level=8.0)
    noisy = replace(touch, grey=touch.grey + rng.normal(0.0, 2.0, touch.grey.shape))
    found = features(noisy)
    assert found.centroid_mm == pytest.approx((1.0, 0.5), abs=0.05)
    assert found.equivalent_diameter_mm == pytest.approx(3.0, rel=0.05)
    assert not features(noisy, least_grey=20.0).contact


def test_a_frame_lit_all_over_still_has_its_patch() -> None:
    y, x = np.mgrid[:120, :160]
    found = features(TactileImage(grey=250.0 - ((x - 90) ** 2 + (y - 55) ** 2) / 60.0))
    assert found.contact
    assert found.cropped
    assert found.peak == pytest.approx(250.0, abs=0.1)


def test_of_two_parts_the_stronger_is_kept_and_holes_are_filled() -> None:
    y, x = np.mgrid[:100, :160]
    wide_and_weak = np.where(np.hypot(x - 40, y - 50) < 20, 50.0, 0.0)
    distance = np.hypot(x - 115, y - 50)
    ring = np.where((distance < 18) & (distance > 8), 200.0, 0.0)
    patch = segment(TactileImage(grey=wide_and_weak + ring), method="noise")
    assert patch.mask[50, 115]
    assert not patch.mask[50, 40]
    assert patch.mask[distance < 18.0].all()
    assert not patch.mask[distance > 22.0].any()


def test_cropping_and_saturation_are_told(draw_ellipse: DrawEllipse) -> None:
    inside = draw_ellipse(semi_axes_mm=(1.5, 1.5), level=300.0)
    clipped = replace(inside, grey=np.minimum(inside.grey, 255.0))
    found = features(clipped, replace(clipped, grey=np.full_like(clipped.grey, 10.0)))
    assert found.saturated_fraction == pytest.approx(1.0, abs=0.05)
    assert not found.cropped
    beyond = features(draw_ellipse(centre_mm=(3.5, 0.0), semi_axes_mm=(1.5, 1.5)))
    assert beyond.cropped
    assert beyond.saturated_fraction == 0.0


def test_without_a_scale_nothing_is_said_in_millimetres(draw_ellipse: DrawEllipse) -> None:
    found = features(replace(draw_ellipse(), mm_per_pixel=None))
    assert found.area_px == pytest.approx(np.pi * 40.0**2, rel=0.01)
    for value in (found.centroid_mm, found.area_mm2, found.equivalent_diameter_mm, found.semi_axes_mm, found.profile):
        assert value is None


def test_the_profile_of_a_disc_steps_at_its_radius(draw_ellipse: DrawEllipse) -> None:
    profile = features(draw_ellipse(semi_axes_mm=(1.5, 1.5), level=60.0, mm_per_pixel=(0.04, 0.06))).profile
    assert profile is not None
    np.testing.assert_allclose(profile.mean_grey[profile.radius_mm < 1.4], 60.0)
    np.testing.assert_allclose(profile.mean_grey[profile.radius_mm > 1.65], 0.0)


def test_the_call_is_public_and_refuses_what_it_cannot_read(draw_ellipse: DrawEllipse) -> None:
    image = draw_ellipse()
    assert tsis.imaging.features(image).contact
    with pytest.raises(InputError, match="image must be a TactileImage; got ndarray"):
        features(image.grey)  # type: ignore[arg-type]
    with pytest.raises(ImageMismatchError, match="reference must have the image's shape"):
        features(image, TactileImage(grey=np.ones((3, 3))))
    with pytest.raises(UnknownNameError, match="did you mean 'otsu'"):
        features(image, method="otsus")
    with pytest.raises(InputError, match="least_grey must lie in"):
        features(image, least_grey=-1.0)


def test_circularity_does_not_depend_on_the_unit_nor_on_noise_along_the_outline() -> None:
    y, x = np.mgrid[:240, :240]
    soft = 60.0 / (1 + np.exp((np.hypot(x - 120, y - 118) - 70) / 12))
    noisy = soft + np.random.default_rng(7).normal(0.0, 2.0, soft.shape)
    scales = (None, (1.0, 1.0), (0.01, 0.01))
    found = [features(TactileImage(grey=noisy, mm_per_pixel=scale)).circularity for scale in scales]
    assert found[0] is not None
    assert found == pytest.approx([found[0]] * 3, rel=1e-9)
    assert found[0] > 0.97
