from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tsis.errors import GaugeError, InputError
from tsis.instrument.force_log import find_latency
from tsis.instrument.gauge import ForceReading

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def _presses(rng: np.random.Generator, span_s: float) -> Callable[[Floats], Floats]:
    """Presses of random times, depths and lengths."""
    count = max(int(span_s / 1.5), 3)
    centres, widths = np.sort(rng.uniform(0, span_s, count)), rng.uniform(0.25, 0.9, count)
    depths = rng.uniform(0.2, 1.5, count)
    return lambda times: np.asarray(np.exp(-(((times[:, None] - centres) / widths) ** 2)) @ depths)


def _seen(
    rng: np.random.Generator,
    latency_s: float,
    *,
    span_s: float = 20.0,
    frames_per_s: float = 30.0,
    rate_per_s: float = 15.0,
    noise_n: float = 0.002,
    grey_noise: float = 0.5,
    sign: float = 1.0,
) -> tuple[Floats, Floats, list[ForceReading]]:
    """Frames whose grey is neither linear in force nor steady, and the readings of a gauge that is late."""
    force = _presses(rng, span_s)
    frame_times = rng.uniform(0, 0.1) + np.arange(0, span_s, 1 / frames_per_s)
    frame_times += rng.normal(0, 0.001, len(frame_times))
    drift = 1 + 0.01 * np.sin(frame_times / 7)
    sums = 100 + sign * 50 * force(frame_times) ** 1.05 * drift + grey_noise * rng.standard_normal(len(frame_times))
    times = rng.uniform(0, 0.1) + np.arange(0, span_s, 1 / rate_per_s)
    forces = 0.001 * np.round((force(times - latency_s) + noise_n * rng.standard_normal(len(times))) / 0.001)
    readings = [
        ForceReading(time_s=at_s, force_n=force_n, resolution_n=0.001)
        for at_s, force_n in zip(times, forces, strict=True)
    ]
    return frame_times, sums, readings


@pytest.mark.parametrize(
    "settings",
    [{}, {"noise_n": 0.02}, {"rate_per_s": 10.0}, {"rate_per_s": 30.0}, {"span_s": 10.0}, {"grey_noise": 2.5}],
)
def test_the_interval_holds_the_delay_as_often_as_stated(settings: dict[str, Any]) -> None:
    rng = np.random.default_rng(3)
    held, missed = [], []
    for _ in range(40):
        latency_s = rng.uniform(-0.2, 0.3)
        found = find_latency(*_seen(rng, latency_s, **settings))
        low, high = found.interval(0.95)
        held.append(low <= latency_s <= high)
        missed.append(found.latency_s - latency_s)
    # At 95 % fewer than 33 of 40 would be seen in one of 1,000 runs.
    assert np.sum(held) >= 33
    assert abs(np.mean(missed)) < 0.001
    assert np.sqrt(np.mean(np.square(missed))) < 0.006


def test_grey_may_fall_with_force() -> None:
    found = find_latency(*_seen(np.random.default_rng(1), 0.12, sign=-1.0))
    assert found.latency_s == pytest.approx(0.12, abs=0.005)
    assert found.correlation > 0.98


def test_what_holds_no_delay_is_refused() -> None:
    rng = np.random.default_rng(4)
    times, sums, readings = _seen(rng, 0.1)
    flat = [
        ForceReading(time_s=each.time_s, force_n=0.5 + 0.001 * (k % 2), resolution_n=0.001)
        for k, each in enumerate(readings)
    ]
    with pytest.raises(GaugeError, match=r"the force must change by more than .* press and release"):
        find_latency(times, sums, flat)
    with pytest.raises(GaugeError, match="sum of grey levels must change"):
        find_latency(times, 100 + rng.standard_normal(len(times)), readings)
    with pytest.raises(GaugeError, match="must go together"):
        find_latency(times, _seen(np.random.default_rng(99), 0.0)[1], readings)
    with pytest.raises(GaugeError, match="overlap for more than 3 s"):
        find_latency(times + 18, sums, readings)
    late = _seen(np.random.default_rng(6), 0.3)
    with pytest.raises(GaugeError, match=r"shorter than 0\.1 s|must go together"):
        find_latency(*late, longest_s=0.1)


def test_a_course_that_repeats_itself_is_refused() -> None:
    times = np.arange(0.0, 20.0, 1 / 30)
    readings = [ForceReading(time_s=t, force_n=float(np.sin(2 * np.pi * 4 * t))) for t in np.arange(0.0, 20.0, 0.02)]
    with pytest.raises(GaugeError, match="fit alike because the course repeats itself; press unevenly"):
        find_latency(times, np.sin(2 * np.pi * 4 * times), readings)


def test_arrays_are_checked() -> None:
    times, sums, readings = _seen(np.random.default_rng(4), 0.1)
    with pytest.raises(InputError, match="each frame must have a time and a value"):
        find_latency(times, sums[:-1], readings)
    with pytest.raises(InputError, match="frame times must ascend"):
        find_latency(times[::-1], sums, readings)
    with pytest.raises(GaugeError, match="at least 24 readings"):
        find_latency(times, sums, readings[:5])
    with pytest.raises(GaugeError, match="at least 24 readings"):
        find_latency(times, sums, [])
    with pytest.raises(InputError, match="finite"):
        find_latency(times, np.full_like(sums, np.nan), readings)
    with pytest.raises(InputError, match="longest_s"):
        find_latency(times, sums, readings, longest_s=0.0)
    with pytest.raises(InputError, match="give a part of it"):
        find_latency(np.r_[times, 1e9], np.r_[sums, 0.0], readings)
