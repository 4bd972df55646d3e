"""The sensor: distances on its face, mean, variance and clipping of what it reads, drift of the lamps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tsis.errors import InputError
from tsis.imaging.sensor import LedDrift, Sensor, expose, interlace

SENSOR = Sensor(columns=400, rows=300)


def test_distances_are_measured_in_mm_from_the_middle() -> None:
    distance = Sensor(columns=9, rows=11, mm_per_pixel=(0.1, 0.2)).radius_mm()
    assert distance.shape == (11, 9)
    assert distance[5, 4] == 0.0
    assert distance[5, 8] == pytest.approx(0.4)
    assert distance[10, 4] == pytest.approx(1.0)
    assert distance[0, 0] == pytest.approx(np.hypot(0.4, 1.0))


def test_an_even_frame_has_its_axis_between_pixels() -> None:
    distance = Sensor(columns=8, rows=8, mm_per_pixel=(0.1, 0.1)).radius_mm()
    assert distance.min() == pytest.approx(np.hypot(0.05, 0.05))
    np.testing.assert_allclose(distance, distance[::-1, ::-1])


def test_the_default_sees_the_width_of_the_dissertations_face() -> None:
    sensor = Sensor()
    assert sensor.columns * sensor.mm_per_pixel[0] == pytest.approx(25.8, abs=0.1)
    assert sensor.rows * sensor.mm_per_pixel[1] == pytest.approx(19.3, abs=0.1)


@pytest.mark.parametrize("level", [0.0, 40.0, 150.0])
def test_mean_and_variance_of_the_noise(level: float) -> None:
    sensor = replace(SENSOR, read_noise_grey=1.5, shot_noise_grey=0.05)
    frame = expose(np.full((300, 400), level), sensor, np.random.default_rng(1))
    variance = 1.5**2 + 0.05 * level + 1 / 12  # rounding adds a twelfth
    assert frame.mean() == pytest.approx(level + sensor.background_grey, abs=5 * np.sqrt(variance / frame.size))
    assert frame.var() == pytest.approx(variance, rel=5 * np.sqrt(2 / frame.size))
    rows = frame - frame.mean()
    neighbours = (rows[:, 1:] * rows[:, :-1]).mean() / variance
    assert abs(neighbours) < 5 / np.sqrt(frame.size), "pixels are independent"


def test_without_noise_only_rounding_is_left() -> None:
    quiet = replace(SENSOR, read_noise_grey=0.0, shot_noise_grey=0.0, background_grey=3.0)
    light = np.linspace(0.0, 200.0, 300 * 400).reshape(300, 400)
    np.testing.assert_array_equal(expose(light, quiet, np.random.default_rng(0)), np.rint(light + 3.0))


def test_clips_at_both_ends_and_reads_whole_levels() -> None:
    light = np.concatenate([np.zeros((150, 400)), np.full((150, 400), 1e4)])
    frame = expose(light, replace(SENSOR, background_grey=0.0, read_noise_grey=5.0), np.random.default_rng(2))
    assert (frame[150:] == 255.0).all()
    assert frame[:150].min() == 0.0
    assert 0.4 < (frame[:150] == 0.0).mean() < 0.6
    np.testing.assert_array_equal(frame, np.rint(frame))


def test_the_seed_decides() -> None:
    light = np.full((300, 400), 50.0)
    first, again, other = (expose(light, SENSOR, np.random.default_rng(seed)) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


@pytest.mark.parametrize("electrons", [0.0, 0.3, 2.0, 40.0])
def test_few_electrons_are_counted(electrons: float) -> None:
    """Twelve bits, ten grey levels an electron: mean, variance and third moment are those of Poisson's law."""
    sensor = replace(SENSOR, full_scale=4095.0, shot_noise_grey=10.0, read_noise_grey=1.0, background_grey=50.0)
    assert sensor.counts_electrons
    grey = expose(np.full((300, 400), 10.0 * electrons), sensor, np.random.default_rng(6)) - 50.0
    spread = np.sqrt(100.0 * electrons + 1 + 1 / 12)
    assert grey.mean() == pytest.approx(10.0 * electrons, abs=5 * spread / np.sqrt(grey.size))
    kurtosis = 3 + 100.0**2 * electrons / spread**4
    assert grey.var() == pytest.approx(spread**2, rel=5 * np.sqrt((kurtosis - 1) / grey.size))
    third = np.mean((grey - grey.mean()) ** 3)
    assert third == pytest.approx(1000.0 * electrons, rel=0.1, abs=5 * np.sqrt(15 / grey.size) * spread**3)
    if electrons == 0.3:
        dark = np.abs(grey) < 5.0
        assert dark.mean() == pytest.approx(np.exp(-0.3), abs=5e-3), "frames without an electron are seen as such"


def test_many_electrons_a_grey_level_are_not_counted() -> None:
    """The skewness that the normal law misses is below the bound at every light, by Poisson's own moments."""
    assert not SENSOR.counts_electrons
    shot, quiet = SENSOR.shot_noise_grey, SENSOR.read_noise_grey**2 + 1 / 12
    electrons = np.geomspace(1e-2, 1e6, 500)
    skewness = shot**3 * electrons / (quiet + shot**2 * electrons) ** 1.5
    assert 0.009 < skewness.max() < 0.1
    just = replace(SENSOR, shot_noise_grey=0.1 / skewness.max() * shot)
    assert not replace(just, shot_noise_grey=0.99 * just.shot_noise_grey).counts_electrons
    assert replace(just, shot_noise_grey=1.01 * just.shot_noise_grey).counts_electrons


def test_twelve_bits_resolve_what_eight_do_not() -> None:
    light = np.linspace(0.0, 1.0, 300 * 400).reshape(300, 400)
    quiet = replace(SENSOR, read_noise_grey=0.0, shot_noise_grey=0.0, background_grey=0.0)
    scale = 4095 / 255
    fine = expose(scale * light, replace(quiet, full_scale=4095.0), np.random.default_rng(1)) / scale
    assert np.abs(fine - light).max() == pytest.approx(0.5 / scale, rel=1e-3)
    assert len(np.unique(fine)) == 17


def test_the_lens_falls_off_as_the_fourth_power_of_the_cosine() -> None:
    sensor = replace(SENSOR, field_angle_deg=25.0)
    share = sensor.vignetting()
    x, y = sensor.axes_mm()
    focus = np.hypot(x[-1], y[-1]) / np.tan(np.radians(25.0))
    for i, j in ((0, 0), (299, 399), (10, 200), (150, 3)):
        assert share[i, j] == pytest.approx(np.cos(np.arctan(np.hypot(x[j], y[i]) / focus)) ** 4, rel=1e-12)
    assert (SENSOR.vignetting() == 1.0).all()


def test_an_interlaced_frame_of_a_moving_edge_is_a_comb() -> None:
    first, second = (np.where(np.arange(400) < edge, 100.0, 0.0) * np.ones((300, 1)) for edge in (200, 210))
    woven = interlace(first, second)
    np.testing.assert_array_equal(woven[::2], first[::2])
    np.testing.assert_array_equal(woven[1::2], second[1::2])
    assert (np.diff(woven[:, 205]) != 0).all()
    np.testing.assert_array_equal(interlace(first, first), first)
    with pytest.raises(InputError, match=r"both fields must be of one shape; got \(300, 400\) and \(2, 400\)"):
        interlace(first, second[:2])


@pytest.mark.parametrize(
    ("changes", "phrase"),
    [
        ({"columns": 4}, r"columns must lie in \[8, 8192\]; got 4"),
        ({"rows": 10000}, "rows must lie in"),
        ({"rows": 10.5}, "rows must be a whole number"),
        ({"mm_per_pixel": (0.1, 0.0)}, "mm_per_pixel must lie in"),
        ({"full_scale": 0.0}, "full_scale must lie in"),
        ({"read_noise_grey": -1.0}, "read_noise_grey must lie in"),
        ({"shot_noise_grey": float("nan")}, "shot_noise_grey must lie in"),
        ({"field_angle_deg": 90.0}, r"field_angle_deg must lie in \[0, 80\]; got 90"),
        ({"background_grey": 300.0}, r"background_grey must lie in \[0, 255\]; got 300"),
    ],
)
def test_what_a_sensor_refuses(changes: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError, match=phrase):
        replace(SENSOR, **changes)


TIMES = np.array([0.0, 60.0, 900.0, 3600.0])


def test_warming_up_settles_exponentially() -> None:
    factors = LedDrift(warm_up=0.2, warm_up_s=100.0, wander=0.0).factors(TIMES, np.random.default_rng(1))
    np.testing.assert_allclose(factors - 1, 0.2 * np.exp(-TIMES / 100.0), rtol=1e-12, atol=1e-15)


def test_the_walk_spreads_with_the_root_of_the_time() -> None:
    rng = np.random.default_rng(2)
    paths = np.log([LedDrift(warm_up=0.0, wander=0.02).factors(TIMES, rng) for _ in range(4000)])
    np.testing.assert_allclose(paths.std(axis=0), 0.02 * np.sqrt(TIMES / 3600), rtol=0.06)
    np.testing.assert_allclose(paths.mean(axis=0), 0.0, atol=5 * 0.02 / np.sqrt(4000))
    later = paths[:, 3] - paths[:, 2]
    assert abs(np.corrcoef(later, paths[:, 2])[0, 1]) < 5 / np.sqrt(4000), "steps are independent"


def test_the_seed_decides_the_drift() -> None:
    drift = LedDrift()
    one, same, other = (drift.factors(TIMES, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert (one[1:] != other[1:]).all()


@pytest.mark.parametrize("times", [[-1.0, 2.0], [3.0, 2.0], [float("nan")], []])
def test_times_that_are_none(times: Any) -> None:
    with pytest.raises(InputError, match="time_s must"):
        LedDrift().factors(times, np.random.default_rng(1))


@pytest.mark.parametrize("changes", [{"warm_up": -0.1}, {"warm_up_s": 0.0}, {"wander": 2.0}, {"wander": float("inf")}])
def test_what_a_drift_refuses(changes: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=f"{next(iter(changes))} must lie in"):
        LedDrift(**changes)
