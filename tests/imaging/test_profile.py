from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import ImageMismatchError, InputError
from tsis.imaging.profile import radial_profile
from tsis.model.image import TactileImage

EDGES = np.array([0.0, 0.5, 1.1, 1.5, 2.4])


def frame(scale: tuple[float, float] = (0.04, 0.07)) -> TactileImage:
    rng = np.random.default_rng(11)
    return TactileImage(grey=rng.uniform(0.0, 300.0, (90, 140)), mm_per_pixel=scale)


def test_it_agrees_with_counting_pixel_by_pixel() -> None:
    image, centre = frame(), (61.3, 40.8)
    profile = radial_profile(image, edges_mm=EDGES, centre_px=centre)
    rings: list[list[float]] = [[] for _ in EDGES[1:]]
    clipped = [0] * len(rings)
    for (row, column), grey in np.ndenumerate(image.grey):
        distance = np.hypot((column - centre[0]) * 0.04, (row - centre[1]) * 0.07)
        ring = int(np.searchsorted(EDGES, distance, side="right")) - 1
        if ring < len(rings):
            if grey >= 255.0:
                clipped[ring] += 1
            else:
                rings[ring].append(float(grey))
    assert profile.count.tolist() == [len(ring) for ring in rings]
    assert profile.clipped_count.tolist() == clipped
    np.testing.assert_allclose(profile.mean_grey, [np.mean(ring) for ring in rings], rtol=1e-12)
    errors = [np.std(ring, ddof=1) / np.sqrt(len(ring)) for ring in rings]
    np.testing.assert_allclose(profile.standard_error_grey, errors, rtol=1e-10)


def test_a_paraboloid_on_oblong_pixels_has_its_exact_ring_means() -> None:
    scale = (0.02, 0.03)
    y, x = np.mgrid[:301, :401]
    squared = ((x - 200) * scale[0]) ** 2 + ((y - 150) * scale[1]) ** 2
    profile = radial_profile(TactileImage(grey=10.0 * squared, mm_per_pixel=scale), edges_mm=EDGES)
    exact = 10.0 * (EDGES[:-1] ** 2 + EDGES[1:] ** 2) / 2.0
    np.testing.assert_allclose(profile.mean_grey, exact, rtol=0.01)


def test_the_standard_error_is_the_scatter_of_the_means() -> None:
    rng = np.random.default_rng(17)
    profiles = [
        radial_profile(TactileImage(grey=rng.normal(100.0, 8.0, (60, 60)), mm_per_pixel=(0.08, 0.08)), edges_mm=EDGES)
        for _ in range(400)
    ]
    scatter = np.std([profile.mean_grey for profile in profiles], axis=0, ddof=1)
    stated = np.mean([profile.standard_error_grey for profile in profiles], axis=0)
    np.testing.assert_allclose(scatter / stated, 1.0, atol=0.15)


def test_a_reference_is_subtracted_and_its_clipped_pixels_left_out() -> None:
    image = TactileImage(grey=np.full((50, 50), 90.0), mm_per_pixel=(0.1, 0.1))
    level = np.full((50, 50), 30.0)
    level[25, 25] = 255.0
    profile = radial_profile(image, edges_mm=EDGES, reference=TactileImage(grey=level))
    np.testing.assert_allclose(profile.mean_grey, 60.0)
    assert profile.clipped_count.tolist() == [1, 0, 0, 0]


def test_a_ring_without_pixels_says_so() -> None:
    image = TactileImage(grey=np.full((5, 5), 7.0), mm_per_pixel=(1.0, 1.0))
    profile = radial_profile(image, edges_mm=[0.0, 0.5, 0.9, 1.1])
    assert profile.count.tolist() == [1, 0, 4]
    assert np.isnan(profile.mean_grey).tolist() == [False, True, False]
    assert np.isnan(profile.standard_error_grey).tolist() == [True, True, False]


def test_radius_is_the_mean_over_the_area_of_a_ring() -> None:
    profile = radial_profile(frame(), edges_mm=[0.0, 1.0, 2.0])
    np.testing.assert_allclose(profile.radius_mm, [2.0 / 3.0, 14.0 / 9.0], rtol=1e-14)


@given(shift=st.integers(-20, 20), gain=st.floats(0.1, 3.0))
def test_moving_the_scene_with_the_centre_changes_nothing_and_gain_scales(shift: int, gain: float) -> None:
    rng = np.random.default_rng(2)
    scene = np.zeros((80, 120))
    scene[20:60, 30:90] = rng.uniform(0.0, 80.0, (40, 60))
    still = TactileImage(grey=scene, mm_per_pixel=(0.1, 0.1))
    moved = TactileImage(grey=gain * np.roll(scene, shift, axis=1), mm_per_pixel=(0.1, 0.1))
    first = radial_profile(still, edges_mm=[0.0, 0.6, 1.2], centre_px=(60.25, 40.5))
    second = radial_profile(moved, edges_mm=[0.0, 0.6, 1.2], centre_px=(60.25 + shift, 40.5))
    np.testing.assert_allclose(second.mean_grey, gain * first.mean_grey, rtol=1e-9)


@pytest.mark.parametrize("edges", [[1.0], [0.0, 0.0, 1.0], [-1.0, 1.0], [0.0, 2.0, 1.0]])
def test_edges_must_ascend(edges: list[float]) -> None:
    with pytest.raises(InputError, match="edges_mm must be at least two ascending radii"):
        radial_profile(frame(), edges_mm=edges)


def test_bad_input_is_named() -> None:
    with pytest.raises(InputError, match="mm_per_pixel is not known"):
        radial_profile(TactileImage(grey=np.ones((4, 4))), edges_mm=EDGES)
    with pytest.raises(InputError, match="centre_px must hold two numbers"):
        radial_profile(frame(), edges_mm=EDGES, centre_px=(1.0, 2.0, 3.0))  # type: ignore[arg-type]
    with pytest.raises(ImageMismatchError, match="reference must have the image's shape"):
        radial_profile(frame(), edges_mm=EDGES, reference=TactileImage(grey=np.ones((4, 4))))
