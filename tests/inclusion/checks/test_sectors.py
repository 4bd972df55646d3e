"""Rings and sectors: against masks pixel by pixel, closed forms of what a picture holds, and round presses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tsis
from tsis.inclusion.checks.sectors import RINGS, SECTORS, ring_visibility, sector_means
from tsis.model.calibration import Calibration, LightMap
from tsis.model.image import TactileImage

PROBE = tsis.load_probe("tsis-2011")
REACH = 0.8 * PROBE.radius_mm
ANSWER = Calibration(gain_grey_per_kpa=10.0, saturation_kpa=20.0, background_grey=8.0)


def frame_of(grey: np.ndarray, **more: object) -> TactileImage:
    return replace(TactileImage(grey=grey, mm_per_pixel=(0.11, 0.13), force_n=1.0), **more)  # type: ignore[arg-type]


def polar(frame: TactileImage) -> tuple[np.ndarray, np.ndarray]:
    (rows, columns), axis, scale = frame.grey.shape, frame.axis(), frame.scale()
    x, y = (np.arange(columns) - axis[0]) * scale[0], (np.arange(rows) - axis[1]) * scale[1]
    return np.hypot(x, y[:, None]), np.arctan2(y[:, None], x) % (2 * np.pi)


def lamps(strength: float) -> LightMap:
    """Light that is brighter on one side and along one line."""
    side = np.linspace(-12.0, 12.0, 49)
    x, y = side, side[:, None]
    none = np.zeros((49, 49))
    return LightMap(
        x_mm=side,
        y_mm=side,
        relative=1 + strength * (x / 12 + (x**2 - y**2) / 144),
        flux_x=none,
        flux_y=none,
        growth_per_mm=none,
        error=0.0,
    )


@pytest.mark.parametrize("axis", [None, (90.3, 71.2)])
def test_means_and_clipped_pixels_are_those_of_masks(axis: tuple[float, float] | None) -> None:
    frame = frame_of(np.random.default_rng(1).uniform(0.0, 260.0, (160, 190)).clip(max=255.0), axis_px=axis)
    found = sector_means(frame, probe=PROBE, calibration=ANSWER)
    radius, angle = polar(frame)
    for ring in range(RINGS):
        for sector in range(SECTORS):
            inside = (radius >= ring * REACH / RINGS) & (radius < (ring + 1) * REACH / RINGS)
            inside &= (angle >= sector * 2 * np.pi / SECTORS) & (angle < (sector + 1) * 2 * np.pi / SECTORS)
            assert found.grid.count[ring, sector] == inside.sum()
            assert found.raw[ring, sector] == pytest.approx(frame.grey[inside].mean())
            assert found.clipped[ring, sector] == (frame.grey[inside] == 255.0).sum()


@pytest.mark.parametrize("strength", [0.0, 0.4])
def test_a_round_press_is_the_same_in_all_sectors_of_a_ring_however_it_is_lit(strength: float) -> None:
    light = lamps(strength)
    empty = frame_of(np.zeros((160, 190)))
    radius, _ = polar(empty)
    x, y = (np.arange(190) - 94.5) * 0.11, (np.arange(160) - 79.5) * 0.13
    frame = frame_of(8 + 100 * np.exp(-(radius**2) / 40) * light.at(x, y))
    found = sector_means(frame, probe=PROBE, calibration=replace(ANSWER, light=light))
    middle = found.grid.ring_radius_mm[1:]
    np.testing.assert_allclose(
        found.grey[1:], 100 * np.exp(-(middle[:, None] ** 2) / 40) + 0 * found.grey[1:], rtol=0.03
    )
    assert np.ptp(found.grey[1:], axis=1).max() < 0.05  # of 100; seven times as much without the sectors' own radii


def test_the_variance_is_that_of_repeated_frames() -> None:
    rng = np.random.default_rng(3)
    answer = replace(ANSWER, read_noise_grey=2.0, shot_noise_grey=0.1, light=lamps(0.3))
    noise = np.sqrt(4 + 0.1 * 60)
    frames = [frame_of(68 + noise * rng.standard_normal((160, 190))) for _ in range(300)]
    found = [sector_means(frame, probe=PROBE, calibration=answer) for frame in frames]
    ratio = np.var([one.grey for one in found], axis=0) / found[0].variance
    assert ratio[1:].mean() == pytest.approx(1.0, abs=0.03)
    assert np.abs(ratio[1:] - 1).max() < 0.5


@given(distance=st.floats(-9.0, 9.0))
def test_a_cut_disc_shows_what_the_circular_segment_leaves(distance: float) -> None:
    frame = frame_of(np.zeros((400, 400)), axis_px=(199.5, distance / 0.13 - 0.5))
    missing = (REACH**2 * np.arccos(distance / REACH) - distance * np.sqrt(REACH**2 - distance**2)) / (np.pi * REACH**2)
    edges = np.linspace(0.0, REACH, 21)
    share = ring_visibility(frame, edges)
    seen = (share * np.diff(edges**2)).sum() / REACH**2
    assert seen == pytest.approx(1 - missing, abs=3e-3)
    whole = distance >= edges[1:]
    assert (share[whole] == 1).all()


def test_rings_beyond_the_picture_are_not_whole_and_do_no_harm() -> None:
    found = sector_means(frame_of(np.full((40, 40), 50.0)), probe=PROBE, calibration=ANSWER)
    assert found.grid.whole.tolist() == [radius <= 2.2 for radius in np.arange(1, RINGS + 1) * REACH / RINGS]
    assert np.isfinite(found.grey).all()
    assert not found.grid.count[-1].any()
