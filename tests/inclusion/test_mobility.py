"""Movement of a bump of light along known paths."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tsis.errors import ImageMismatchError, InputError
from tsis.inclusion.mobility import mobility
from tsis.model.calibration import Calibration, LightMap
from tsis.model.image import TactileImage

SHAPE = (100, 120)
SCALE = (0.1, 0.12)
UNTOUCHED = "untouched probe"


def hill(x_mm: float = 0.0, y_mm: float = 0.0, *, peak: float = 80.0, **fields: Any) -> TactileImage:
    x = (np.arange(SHAPE[1]) - (SHAPE[1] - 1) / 2) * SCALE[0] - x_mm
    y = (np.arange(SHAPE[0]) - (SHAPE[0] - 1) / 2) * SCALE[1] - y_mm
    bump = np.exp(-(x[None, :] ** 2 + y[:, None] ** 2) / 2.0)
    return TactileImage(grey=8.0 + peak * bump, mm_per_pixel=SCALE, **fields)


FLAT = hill(peak=0.0)


def test_a_walk_around_a_circle() -> None:
    angle = np.linspace(0.0, 2 * np.pi, 13)
    moved = mobility([hill(1.5 * np.cos(a), 1.5 * np.sin(a)) for a in angle], FLAT, against=UNTOUCHED)
    chord = 2 * 1.5 * np.sin(np.pi / 12)
    assert moved.step_mm == pytest.approx(np.full(12, chord), rel=0.02)
    assert moved.path_mm == pytest.approx(12 * chord, rel=0.005)
    assert moved.excursion_mm == pytest.approx(3.0, rel=0.005)
    np.testing.assert_allclose(moved.position_mm, 1.5 * np.transpose([np.cos(angle), np.sin(angle)]), atol=0.02)
    assert moved.flags == ()


places = st.lists(st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5)), min_size=2, max_size=6)


@given(places)
@settings(max_examples=25)
def test_path_and_excursion_are_those_of_the_positions(spots: list[tuple[float, float]]) -> None:
    frames = [hill(x, y) for x, y in spots]
    moved, back = (mobility(order, FLAT, against=UNTOUCHED) for order in (frames, frames[::-1]))
    assert moved.path_mm is not None
    assert moved.excursion_mm is not None
    apart = max(np.hypot(x - u, y - v) for x, y in spots for u, v in spots)
    length = sum(np.hypot(x - u, y - v) for (x, y), (u, v) in pairwise(spots))
    assert moved.excursion_mm == pytest.approx(apart, abs=0.02)
    assert moved.path_mm == pytest.approx(length, abs=0.02 * len(spots))
    assert moved.excursion_mm <= moved.path_mm + 1e-9
    assert (back.path_mm, back.excursion_mm) == pytest.approx((moved.path_mm, moved.excursion_mm))


@pytest.mark.parametrize("forces", [(0.5, 0.5), (1.0, 1.04), (2.0, None), (20.0, 19.1)])
def test_forces_within_five_per_cent_are_one_force(forces: tuple[float, float | None]) -> None:
    first, second = forces
    assert mobility([hill(force_n=first), hill(1.0, force_n=second)], FLAT, against=UNTOUCHED).flags == ()


@pytest.mark.parametrize("seed", range(3))
def test_an_object_at_rest_walks_as_far_as_noise_drives_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    frames = [replace(hill(), grey=hill().grey + rng.normal(0.0, 1.0, SHAPE)) for _ in range(40)]
    rest = mobility(frames, FLAT, against=UNTOUCHED)
    assert rest.flags == ("no_movement",)
    assert rest.noise_mm == pytest.approx(rest.position_mm.std(axis=0).mean(), rel=0.3)
    assert rest.path_mm == pytest.approx(rest.noise_path_mm, rel=0.3)
    assert rest.excursion_mm is not None
    assert rest.path_mm is not None
    assert rest.excursion_mm < 0.2 * rest.path_mm
    assert mobility([*frames, hill(0.2)], FLAT, against=UNTOUCHED).flags == ()


def test_known_light_is_divided_out() -> None:
    """Under light that falls to a half across the face the centroid leans to the bright side, unless it is known."""
    x_mm = np.linspace(-6.0, 6.0, 3)
    relative = np.tile(1.0 + x_mm / 18.0, (3, 1))
    none = np.zeros_like(relative)
    light = LightMap(x_mm=x_mm, y_mm=x_mm, relative=relative, flux_x=none, flux_y=none, growth_per_mm=none, error=0.0)
    known = Calibration(gain_grey_per_kpa=60.0, saturation_kpa=20.0, background_grey=8.0, light=light)
    columns = (np.arange(SHAPE[1]) - (SHAPE[1] - 1) / 2) * SCALE[0]
    rng = np.random.default_rng(3)
    frames = [
        replace(hill(1.0), grey=8.0 + (hill(1.0).grey - 8.0) * (1.0 + columns / 18.0) + rng.normal(0.0, 1.0, SHAPE))
        for _ in range(40)
    ]
    blind, seeing = (mobility(frames, FLAT, against=UNTOUCHED, calibration=each) for each in (None, known))
    assert seeing.position_mm.mean(axis=0) == pytest.approx((1.0, 0.0), abs=0.005)
    assert blind.position_mm.mean(axis=0)[0] > 1.03
    assert seeing.noise_mm == pytest.approx(seeing.position_mm.std(axis=0).mean(), rel=0.3)


def test_lost_contact_leaves_a_gap() -> None:
    moved = mobility([hill(0.0), hill(1.0), FLAT, hill(-1.0), hill(-0.5)], FLAT, against=UNTOUCHED)
    assert moved.flags == ("contact_lost",)
    assert np.isnan(moved.position_mm[2]).all()
    assert np.isnan(moved.step_mm).tolist() == [False, True, True, False]
    assert moved.path_mm == pytest.approx(1.5, abs=0.02)
    assert moved.excursion_mm == pytest.approx(2.0, abs=0.02)


def test_nothing_seen_is_no_number() -> None:
    moved = mobility([FLAT, FLAT], FLAT, against=UNTOUCHED)
    assert (moved.path_mm, moved.excursion_mm) == (None, None)
    assert set(moved.flags) == {"no_contact", "repeated_frames"}
    assert len(moved.notes) == 2
    once = mobility([FLAT, hill(), FLAT], FLAT, against=UNTOUCHED)
    assert (once.path_mm, once.excursion_mm) == (None, None)
    assert once.flags == ("contact_lost",)


def test_what_is_wrong_with_a_frame_is_flagged_once() -> None:
    moved = mobility([hill(0.0), hill(5.0), hill(5.5)], FLAT, against=UNTOUCHED)
    assert moved.flags == ("cropped",)
    assert "repeated_frames" in mobility([hill(0.0), hill(1.0), hill(1.0)], FLAT, against=UNTOUCHED).flags


@pytest.mark.parametrize(
    ("images", "error", "said"),
    [
        ([hill()], InputError, "at least two frames"),
        ([], InputError, "at least two frames"),
        (hill(), InputError, "at least two frames"),
        ([hill(), "frame"], InputError, "must hold TactileImage values"),
        ([hill(force_n=0.5), hill(1.0, force_n=1.0)], InputError, "0.5 to 1 N"),
        ([hill(), replace(hill(), mm_per_pixel=(0.1, 0.1))], ImageMismatchError, "mm_per_pixel"),
        ([hill(), replace(hill(), axis_px=(1.0, 1.0))], ImageMismatchError, "axis_px"),
        ([hill(), TactileImage(grey=np.zeros((4, 4)), mm_per_pixel=SCALE)], ImageMismatchError, "shape"),
    ],
)
def test_mixed_sequences_are_refused(images: Any, error: type[Exception], said: str) -> None:
    with pytest.raises(error) as caught:
        mobility(images, FLAT, against=UNTOUCHED)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
