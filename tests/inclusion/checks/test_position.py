"""Places of changes that were put where the tests say, under even and uneven light."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tsis
from tsis.errors import ImageMismatchError, InputError
from tsis.imaging.rendering import render
from tsis.imaging.sensor import Sensor, expose
from tsis.inclusion import InclusionPrior
from tsis.inclusion.checks.position import APPARENT_FRACTION, APPARENT_SD, InclusionPosition, inclusion_position
from tsis.inclusion.posterior.rings import FARTHEST
from tsis.inclusion.reading import _offset
from tsis.mechanics import press
from tsis.model.calibration import LightMap
from tsis.model.image import TactileImage
from tsis.virtual.probe import nominal_calibration

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.press import PressMap

PROBE = tsis.load_probe("tsis-2011")
GRID = np.arange(-12.0, 12.01, 0.25)
SENSOR = Sensor()
EVEN = LightMap.uniform()
ALIKE = replace(nominal_calibration(SENSOR, EVEN), pattern_sd=0.0, repeatability_sd=0.0)


@cache
def slanted() -> LightMap:
    """Light twice as strong on one side as on the other."""
    none = np.zeros((2, 2))
    ends = np.array([-12.0, 12.0])
    relative = np.array([[2 / 3, 4 / 3], [2 / 3, 4 / 3]])
    return LightMap(x_mm=ends, y_mm=ends, relative=relative, flux_x=none, flux_y=none, growth_per_mm=none, error=0.0)


@cache
def plain() -> PressMap:
    return press(PROBE, tsis.Phantom(young_kpa=5.0, thickness_mm=30.0), force_n=1.0).on_grid(GRID, GRID)


def pressed(x_mm: float, y_mm: float, *, peak_kpa: float = 0.4, width_mm: float = 3.0) -> PressMap:
    """A bell of pressure around a point on the plain press, which gives way by the force that the bell takes."""
    squared = (GRID - x_mm) ** 2 + (GRID[:, None] - y_mm) ** 2
    bell = peak_kpa * np.exp(-squared / 2 / width_mm**2) * (plain().pressure_kpa > 0)
    left = 1 - bell.sum() / plain().pressure_kpa.sum()
    return replace(plain(), pressure_kpa=left * plain().pressure_kpa + bell)


def shown(light: NDArray[np.float64], *, seed: int) -> TactileImage:
    grey = expose(light, SENSOR, np.random.default_rng(seed))
    return TactileImage(grey=grey, mm_per_pixel=SENSOR.mm_per_pixel, force_n=1.0)


def frame(press_map: PressMap, *, seed: int, light: LightMap = EVEN) -> TactileImage:
    return shown(render(press_map, SENSOR, ALIKE, light=light), seed=seed)


@pytest.mark.parametrize("centre", [(0.0, 0.0), (0.5, 0.0), (1.0, -0.5), (-2.5, 1.5), (0.0, 3.0)])
@pytest.mark.parametrize("light", [EVEN, slanted()], ids=["even", "slanted"])
def test_a_moved_change_is_found(centre: tuple[float, float], light: LightMap) -> None:
    answer = replace(ALIKE, light=light)
    target, reference = frame(pressed(*centre), seed=1, light=light), frame(plain(), seed=2, light=light)
    found = inclusion_position(target, reference, answer, radius_mm=PROBE.radius_mm)
    assert 0 < found.noise_mm < 0.02
    assert found.sd_mm == pytest.approx(np.hypot(found.noise_mm, APPARENT_SD * found.distance_mm))
    # Rounding of the rendered grid adds a little to the noise.
    np.testing.assert_allclose(
        [APPARENT_FRACTION * found.x_mm, APPARENT_FRACTION * found.y_mm], centre, atol=4 * found.noise_mm + 0.01
    )
    assert found.distance_mm == pytest.approx(np.hypot(found.x_mm, found.y_mm))


def test_the_sd_is_that_of_many_frames() -> None:
    weak, bare = (render(one, SENSOR, ALIKE) for one in (pressed(0.0, 0.0, peak_kpa=0.15), plain()))
    found = [
        inclusion_position(shown(weak, seed=2 * n), shown(bare, seed=2 * n + 1), ALIKE, radius_mm=12.0)
        for n in range(40)
    ]
    over_sd = np.array([[one.x_mm, one.y_mm] for one in found]) / np.array([[one.sd_mm] for one in found])
    assert 0.65 < np.mean(over_sd**2) < 1.45, "80 values: three standard deviations of a mean square"


def test_the_sd_grows_with_what_presses_do_not_repeat() -> None:
    target, reference = frame(pressed(1.0, 0.0), seed=1), frame(plain(), seed=2)
    quiet, uneven = (
        inclusion_position(target, reference, replace(ALIKE, repeatability_sd=sd), radius_mm=12.0).sd_mm
        for sd in (0.0, 0.01)
    )
    assert uneven > 2 * quiet


@pytest.mark.parametrize("share", [1.0, 1.03])
def test_nothing_is_placed_where_nothing_is(share: float) -> None:
    """Nor where one press is a little stronger: the plain press lies on the axis and tells nothing."""
    stronger = replace(plain(), pressure_kpa=share * plain().pressure_kpa)
    found = inclusion_position(frame(stronger, seed=1), frame(plain(), seed=2), ALIKE, radius_mm=12.0)
    assert (found.x_mm, found.y_mm, found.sd_mm) == (0.0, 0.0, np.inf)


@settings(max_examples=8)
@given(x=st.floats(-2.5, 2.5), y=st.floats(-2.5, 2.5))
def test_a_turned_picture_has_the_turned_place(x: float, y: float) -> None:
    target, reference = frame(pressed(x, y), seed=1), frame(plain(), seed=2)
    turned = [replace(one, grey=one.grey[::-1, ::-1]) for one in (target, reference)]
    found = inclusion_position(target, reference, ALIKE, radius_mm=12.0)
    mirrored = inclusion_position(turned[0], turned[1], ALIKE, radius_mm=12.0)
    # Cells begin at the other edge and hold other pixels.
    close = 2 * found.noise_mm
    np.testing.assert_allclose([mirrored.x_mm, mirrored.y_mm], [-found.x_mm, -found.y_mm], atol=close)


def test_a_place_is_at_most_half_of_the_face_away() -> None:
    found = inclusion_position(frame(pressed(9.0, 0.0), seed=1), frame(plain(), seed=2), ALIKE, radius_mm=12.0)
    assert 4.0 < found.distance_mm <= FARTHEST * 12.0 + 1e-9


def test_clipped_pixels_are_left_out() -> None:
    target, reference = frame(pressed(1.0, 0.5), seed=1), frame(plain(), seed=2)
    grey = target.grey.copy()
    grey[200:220, 300:330] = 255.0
    found, clipped = (
        inclusion_position(one, reference, ALIKE, radius_mm=12.0) for one in (target, replace(target, grey=grey))
    )
    close = 3 * found.noise_mm
    np.testing.assert_allclose([clipped.x_mm, clipped.y_mm], [found.x_mm, found.y_mm], atol=close)


@pytest.mark.parametrize("sd", [0.4, 1.5])
def test_a_place_is_joined_with_the_aim(sd: float) -> None:
    """Beside places drawn from the prior, of which those are taken that are seen at (2, 0)."""
    rng = np.random.default_rng(3)
    place = rng.normal(0.0, 1.0, (2, 4_000_000))
    near = np.hypot(*(place + rng.normal(0.0, sd, place.shape) - [[2.0], [0.0]])) < 0.1
    drawn = place[:, near]
    found = InclusionPosition(x_mm=2.0, y_mm=0.0, sd_mm=sd, noise_mm=sd)
    distance, spread = _offset(found, InclusionPrior(offset_sd_mm=1.0))
    assert distance == pytest.approx(np.hypot(*drawn.mean(axis=1)), abs=0.03)
    assert spread == pytest.approx((drawn**2).sum(axis=0).std(), rel=0.06)


def test_a_place_that_is_not_seen_is_the_aim() -> None:
    unseen = InclusionPosition(x_mm=0.0, y_mm=0.0, sd_mm=np.inf, noise_mm=np.inf)
    assert _offset(unseen, InclusionPrior(offset_sd_mm=1.5)) == (0.0, 4.5)
    assert _offset(None, InclusionPrior(offset_sd_mm=1.5)) == (0.0, 4.5)
    assert _offset(unseen, InclusionPrior(offset_sd_mm=0.0)) == (0.0, 0.0)


def test_wrong_input_is_refused() -> None:
    target, reference = frame(pressed(1.0, 0.0), seed=1), frame(plain(), seed=2)
    white = replace(target, grey=np.full_like(target.grey, 255.0))
    with pytest.raises(InputError, match="without clipping in at least"):
        inclusion_position(white, reference, ALIKE, radius_mm=12.0)
    with pytest.raises(InputError, match="radius_mm must lie in"):
        inclusion_position(target, reference, ALIKE, radius_mm=0.0)
    with pytest.raises(InputError, match="mm_per_pixel is not known"):
        inclusion_position(replace(target, mm_per_pixel=None), reference, ALIKE, radius_mm=12.0)
    with pytest.raises(ImageMismatchError, match="reference must have the image's shape"):
        inclusion_position(target, replace(reference, grey=reference.grey[1:]), ALIKE, radius_mm=12.0)
    with pytest.raises(InputError, match="calibration must be a Calibration"):
        inclusion_position(target, reference, "none", radius_mm=12.0)  # type: ignore[arg-type]
