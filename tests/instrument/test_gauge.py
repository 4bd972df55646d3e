from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tsis.errors import FileInputError, GaugeError, InputError
from tsis.instrument.gauge import (
    ForceReading,
    Gauge,
    RecordedGauge,
    SimulatedGauge,
    force_at,
    reading_noise,
    write_readings,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray


class Clock:
    def __init__(self) -> None:
        self.now_s = 50.0

    def __call__(self) -> float:
        return self.now_s

    def wait(self, seconds: float) -> None:
        self.now_s += seconds


def _gauge(clock: Clock, **settings: float) -> SimulatedGauge:
    gauge = SimulatedGauge(
        lambda time_s: 0.5 + 0.1 * (time_s - 50),
        rng=np.random.default_rng(7),
        clock=clock,
        wait=clock.wait,
        **settings,
    )
    gauge.open()
    return gauge


def _taken(gauge: SimulatedGauge, count: int) -> list[ForceReading]:
    return list(islice(gauge.readings(), count))


def test_noise_gain_zero_and_rate_are_those_stated() -> None:
    clock = Clock()
    gauge = _gauge(clock, noise_n=0.02, resolution_n=0.0, zero_n=0.3, gain=1.1, rate_per_s=25.0)
    assert isinstance(gauge, Gauge)
    readings = _taken(gauge, 4000)
    times = np.array([reading.time_s for reading in readings])
    forces = np.array([reading.force_n for reading in readings])
    assert np.diff(times) == pytest.approx(0.04)
    errors = forces - 1.1 * (0.5 + 0.1 * (times - 50)) - 0.3
    # Of 4000 draws the mean lies within 4 sd/sqrt(4000), the sd within 4 sd/sqrt(8000).
    assert abs(errors.mean()) < 4 * 0.02 / np.sqrt(4000)
    assert abs(errors.std() - 0.02) < 4 * 0.02 / np.sqrt(8000)
    assert abs(np.corrcoef(errors[1:], errors[:-1])[0, 1]) < 4 / np.sqrt(4000)


def test_the_display_has_steps() -> None:
    readings = _taken(_gauge(Clock(), noise_n=0.004, resolution_n=0.02, rate_per_s=50.0), 200)
    steps = np.array([reading.force_n for reading in readings]) / 0.02
    assert steps == pytest.approx(np.round(steps))
    assert len(set(np.round(steps))) > 10
    assert {reading.resolution_n for reading in readings} == {0.02}


def test_tare_takes_the_present_force_off() -> None:
    clock = Clock()
    gauge = _gauge(clock, noise_n=0.0, resolution_n=0.0, zero_n=0.4, gain=2.0)
    clock.now_s += 3
    gauge.tare()
    (reading,) = _taken(gauge, 1)
    assert reading.force_n == pytest.approx(0.0, abs=1e-12)
    clock.now_s += 1
    (reading,) = _taken(gauge, 1)
    assert reading.force_n == pytest.approx(0.2)


def test_readings_nobody_fetched_are_never_made() -> None:
    clock = Clock()
    readings = _gauge(clock, rate_per_s=10.0).readings()
    first = next(readings)
    clock.now_s += 1.05
    second = next(readings)
    assert first.time_s == 50.0
    assert second.time_s == pytest.approx(51.0)


def test_it_must_be_open_and_ends_when_closed() -> None:
    gauge = _gauge(Clock())
    readings = gauge.readings()
    next(readings)
    gauge.close()
    assert list(readings) == []
    with pytest.raises(GaugeError, match="must be opened first"):
        gauge.tare()
    with pytest.raises(GaugeError, match="must be opened first"):
        next(gauge.readings())
    with pytest.raises(InputError, match="rate_per_s"):
        _gauge(Clock(), rate_per_s=0.0)


def _read(path: Path) -> list[ForceReading]:
    gauge = RecordedGauge(path)
    gauge.open()
    return list(gauge.readings())


@given(
    st.lists(
        st.tuples(st.floats(-1e9, 1e9), st.floats(-1e5, 1e5), st.floats(0, 1), st.floats(0, 1)),
        min_size=1,
        unique_by=lambda row: row[0],
    )
)
def test_readings_come_back_to_the_last_bit(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[float, float, float, float]]
) -> None:
    readings = [
        ForceReading(time_s=at_s, force_n=force_n, resolution_n=step_n, time_error_s=error_s)
        for at_s, force_n, step_n, error_s in sorted(rows)
    ]
    assert _read(write_readings(tmp_path_factory.mktemp("force") / "force.csv", readings)) == readings


def test_two_columns_of_another_program_are_enough(tmp_path: Path) -> None:
    path = tmp_path / "force.csv"
    path.write_bytes("\ufefftime_s, force_n\r\n0.0, 0.1\r\n0.5, -2e-1\r\n\r\n".encode())
    assert _read(path) == [ForceReading(time_s=0.0, force_n=0.1), ForceReading(time_s=0.5, force_n=-0.2)]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"0.0,0.1\n", "must begin with the header time_s,force_n"),
        (b"time,force_n\n0,1\n", "must begin with the header time_s,force_n.*must name its unit"),
        (b"time_s,force_px\n0,1\n", "must begin with the header"),
        (b"time_s\n0\n", "must begin with the header"),
        (b"\n", "must begin with the header"),
        (b"time_s,force_n\n", "must hold at least one reading"),
        (b"time_s,force_n\n0,nan\n", "line 2: force_n must lie in"),
        (b"time_s,force_n\n0,1\ninf,1\n", "line 3: time_s must lie in"),
        (b"time_s,force_n\n1,1\n1,2\n", "line 3 must be later than the line before"),
        (b"time_s,force_n\n1,1\n0,2\n", "line 3 must be later"),
        (b"time_s,force_n\n1,x\n", "line 2 must hold numbers"),
        (b"time_s,force_n\n1,1,1\n", "line 2 must have 2 columns"),
        (b"\xff\xfe\x00", "must be CSV text"),
        (b"", "empty file"),
    ],
)
def test_another_file_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "force.csv"
    path.write_bytes(content)
    with pytest.raises(FileInputError, match=message):
        RecordedGauge(path).open()


def test_writing_refuses_what_reading_would_refuse(tmp_path: Path) -> None:
    later, earlier = ForceReading(time_s=2.0, force_n=0.0), ForceReading(time_s=1.0, force_n=0.0)
    path = tmp_path / "force.csv"
    with pytest.raises(InputError, match=r"must be 1 to 4000000.*got none"):
        write_readings(path, [])
    with pytest.raises(InputError, match="ascending times"):
        write_readings(path, [later, earlier])
    write_readings(path, [earlier, later])
    with pytest.raises(FileInputError, match="exists and is not overwritten"):
        write_readings(path, [earlier])
    with pytest.raises(FileInputError, match="must be writable"):
        write_readings(tmp_path / "no folder" / "force.csv", [earlier])


def test_as_many_as_are_written_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bounds = write_readings.__globals__
    monkeypatch.setitem(bounds, "MOST_READINGS", 12)
    rows = [ForceReading(time_s=float(at), force_n=-1.25) for at in range(13)]
    with pytest.raises(InputError, match=r"must be 1 to 12, .* got 13"):
        write_readings(tmp_path / "long.csv", rows)
    path = write_readings(tmp_path / "force.csv", rows[:12])
    assert _read(path) == rows[:12]
    monkeypatch.setitem(bounds, "LARGEST_BYTES", path.stat().st_size)
    assert len(_read(path)) == 12
    monkeypatch.setitem(bounds, "LARGEST_BYTES", path.stat().st_size - 1)
    with pytest.raises(InputError, match="must take at most"):
        write_readings(tmp_path / "long.csv", rows[:12])
    assert not (tmp_path / "long.csv").exists()


@pytest.mark.slow
def test_seventeen_minutes_at_a_kilohertz_come_back(tmp_path: Path) -> None:
    count = 1_020_000
    path = write_readings(tmp_path / "force.csv", (ForceReading(time_s=at / 1000, force_n=0.1) for at in range(count)))
    gauge = RecordedGauge(path)
    gauge.open()
    assert sum(1 for _ in gauge.readings()) == count


def test_a_file_is_a_gauge_whose_zero_stays(tmp_path: Path) -> None:
    path = write_readings(tmp_path / "force.csv", [ForceReading(time_s=float(k), force_n=0.0) for k in range(3)])
    gauge = RecordedGauge(path)
    assert isinstance(gauge, Gauge)
    with pytest.raises(GaugeError, match="must be opened first"):
        next(gauge.readings())
    gauge.open()
    with pytest.raises(GaugeError, match="zero cannot be set"):
        gauge.tare()
    readings = gauge.readings()
    next(readings)
    gauge.close()
    assert list(readings) == []
    assert (gauge.name, gauge.lost, gauge.skipped) == ("force.csv", False, 0)


INTERVAL_S = 0.1


def _readings(
    course: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    rng: np.random.Generator,
    *,
    count: int = 24,
    noise_n: float = 0.0,
    resolution_n: float = 0.0,
    jitter_s: float = 0.0,
    uneven: float = 0.0,
) -> list[ForceReading]:
    """What a gauge would deliver of a course of its own, finer than any reading."""
    times = INTERVAL_S * (np.arange(count) + rng.uniform(-uneven, uneven, count))
    forces = course(times + rng.uniform(-jitter_s, jitter_s, count)) + noise_n * rng.standard_normal(count)
    if resolution_n:
        forces = resolution_n * np.round(forces / resolution_n)
    return [
        ForceReading(time_s=at_s, force_n=force_n, resolution_n=resolution_n, time_error_s=jitter_s)
        for at_s, force_n in zip(times, forces, strict=True)
    ]


def test_a_straight_course_is_met_exactly() -> None:
    readings = [ForceReading(time_s=k / 10, force_n=0.3 * k / 10 - 0.1) for k in range(10)]
    for at_s in (0.0, 0.05, 0.31, 0.9, 0.99):
        force = force_at(readings, at_s)
        assert force.force_n == pytest.approx(0.3 * at_s - 0.1, abs=1e-14)
        assert force.error_n < 1e-12
        assert force.gap_s == pytest.approx(0.1)


def test_a_parabola_is_missed_by_no_more_than_its_remainder() -> None:
    readings = [ForceReading(time_s=k / 10, force_n=2 * (k / 10) ** 2) for k in range(10)]
    force = force_at(readings, 0.55)
    missed = abs(force.force_n - 2 * 0.55**2)
    assert missed == pytest.approx(4 * INTERVAL_S**2 / 8)  # f'' h^2 / 8
    assert force.error_n == pytest.approx(1.1 * missed)


@given(
    st.floats(0.02, 0.69),
    st.floats(0, 6.3),
    st.sampled_from(["inside", "first", "last", "beyond"]),
    st.floats(0, 1),
    st.floats(0, 0.3),
    st.integers(0, 100),
)
@settings(max_examples=300)
def test_every_sinusoid_of_nine_readings_a_period_is_held(
    angle: float, phase: float, where: str, share: float, uneven: float, seed: int
) -> None:
    def course(times: NDArray[np.float64]) -> NDArray[np.float64]:
        return 0.4 * np.sin(angle * times / INTERVAL_S + phase)

    uneven = min(uneven, 0.69 / angle - 1, 0.3)  # the longest gap still has nine in the period
    readings = _readings(course, np.random.default_rng(seed), uneven=max(uneven, 0.0) / 2)
    times = [reading.time_s for reading in readings]
    start, end = {
        "inside": (times[10], times[13]),
        "first": (times[0], times[1]),
        "last": (times[-2], times[-1]),
        "beyond": (times[-1], 2 * times[-1] - times[-2]),
    }[where]
    at_s = min(start + share * (end - start), end - 1e-9)
    force = force_at(readings, at_s)
    assert abs(force.force_n - course(np.array(at_s))) <= force.error_n + 1e-12


@pytest.mark.parametrize(
    ("noise_n", "resolution_n", "jitter_s", "uneven"),
    [
        (0.002, 0.0, 0.0, 0.0),
        (0.002, 0.001, 0.0, 0.3),
        (0.0, 0.005, 0.0, 0.0),
        (0.0, 0.001, 0.02, 0.0),
        (0.005, 0.001, 0.01, 0.2),
    ],
)
@pytest.mark.parametrize("where", ["inside", "beyond"])
def test_the_truth_is_held_as_often_as_stated(
    noise_n: float, resolution_n: float, jitter_s: float, uneven: float, where: str
) -> None:
    rng = np.random.default_rng(11)
    held, errors = [], []
    for _ in range(400):
        # Random smooth courses: three sinusoids, the fastest with ten readings in its period.
        angles, phases = rng.uniform(0.02, 2 * np.pi / 10, 3), rng.uniform(0, 2 * np.pi, 3)

        def course(
            times: NDArray[np.float64], angles: NDArray[np.float64] = angles, phases: NDArray[np.float64] = phases
        ) -> NDArray[np.float64]:
            waves = np.sin(angles * np.asarray(times)[..., None] / INTERVAL_S + phases)
            return np.asarray(0.5 + 0.1 * waves.sum(axis=-1))

        readings = _readings(course, rng, noise_n=noise_n, resolution_n=resolution_n, jitter_s=jitter_s, uneven=uneven)
        last_s, before_s = readings[-1].time_s, readings[-2].time_s
        inside = where == "inside"
        at_s = rng.uniform(0.9, 1.4) if inside else rng.uniform(last_s, 2 * last_s - before_s)
        force = force_at(readings, at_s)
        held.append(abs(force.force_n - course(np.array(at_s))) <= force.error_n)
        errors.append(force.error_n)
    assert np.mean(held) >= 0.95
    assert np.median(errors) < 0.1  # of a course that spans 0.6 N: not held by saying nothing


def test_slow_courses_have_the_error_of_the_noise() -> None:
    rng = np.random.default_rng(5)
    errors = [
        force_at(_readings(lambda times: 0.5 + 0.01 * times, rng, noise_n=0.002), 1.05).error_n for _ in range(300)
    ]
    # At the middle of two readings the noise is 0.002/sqrt(2); 95 % of it lies within 0.0028.
    assert 0.0028 < np.median(errors) < 0.0060


def test_corners_of_a_course_are_held_mostly() -> None:
    """Ramps and holds, as a loading stand makes them, have no curvature at their corners that a parabola could tell."""
    rng, held = np.random.default_rng(2), []
    for _ in range(1000):
        corner_s, at_s = rng.uniform(0.9, 1.1), rng.uniform(0.5, 1.5)

        def course(times: NDArray[np.float64], corner_s: float = corner_s) -> NDArray[np.float64]:
            return np.asarray(0.2 * np.maximum(times - corner_s, 0.0))

        force = force_at(_readings(course, rng, resolution_n=0.001), at_s)
        held.append(abs(force.force_n - float(course(np.array(at_s)))) <= force.error_n)
    assert np.mean(held) >= 0.95


def test_the_latency_shifts_the_time_that_is_looked_up() -> None:
    readings = [ForceReading(time_s=k / 10, force_n=k / 10) for k in range(20)]
    assert force_at(readings, 1.0, latency_s=0.25).force_n == pytest.approx(1.25)
    sure, unsure = force_at(readings, 1.0), force_at(readings, 1.0, time_error_s=0.01)
    assert unsure.error_n - sure.error_n == pytest.approx(0.01)  # 1 N/s for 0.01 s


def test_it_refuses_to_invent() -> None:
    readings = [ForceReading(time_s=k / 10, force_n=1.0) for k in range(10)]
    with pytest.raises(GaugeError, match=r"0\.05 s before the first force reading"):
        force_at(readings, -0.05)
    with pytest.raises(GaugeError, match=r"0\.11 s after the last force reading, more than one interval of 0\.1 s"):
        force_at(readings, 1.01)
    with pytest.raises(GaugeError, match="at least 4 force readings are needed around a frame; got 3"):
        force_at(readings[:3], 0.1)
    gap = [*readings, *(ForceReading(time_s=2 + k / 10, force_n=1.0) for k in range(5))]
    with pytest.raises(GaugeError, match=r"at most 0\.5 s apart; got 1\.1 s"):
        force_at(gap, 1.5)
    assert force_at(gap, 1.5, longest_gap_s=2.0).gap_s == pytest.approx(1.1)
    with pytest.raises(GaugeError, match=r"at most 0\.5 s apart"):
        force_at([ForceReading(time_s=float(k), force_n=1.0) for k in range(9)], 8.6)
    with pytest.raises(InputError, match="ascending times"):
        force_at([readings[0], readings[2], readings[1], readings[3], readings[4]], 0.15)
    for wrong in (float("nan"), float("inf")):
        with pytest.raises(InputError, match="time_s"):
            force_at(readings, wrong)


def test_noise_is_told_from_a_parabola_with_its_degrees_of_freedom() -> None:
    rng = np.random.default_rng(9)
    squares, freedoms = [], []
    for _ in range(3000):
        times = np.sort(rng.uniform(0, 2, 14))
        sd, freedom = reading_noise(times, 5 - 3 * times + 20 * times**2 + 0.03 * rng.standard_normal(14))
        squares.append((sd / 0.03) ** 2)
        freedoms.append(freedom)
    # Of a mean of squares with f degrees of freedom the mean is 1 and the variance 2/f.
    assert np.mean(squares) == pytest.approx(1.0, abs=4 * np.std(squares) / np.sqrt(3000))
    assert np.var(squares) == pytest.approx(2 * np.mean(1 / np.array(freedoms)), rel=0.15)


@pytest.mark.parametrize(
    "content",
    [
        b"time_s,force_n\n0.5,0.25\n1.0,0.5\n",
        "Zeit und Kraft\nTime (ms);Load (mN);remark\n500;250,0;a\n1000;500,0;b\n".encode("utf-16"),
        "﻿No.\tForce [cN]\tElapsed time / s\r\n1\t25\t0.5\r\n2\t50\t1.0\r\n".encode(),
    ],
)
def test_readings_of_any_program_are_in_seconds_and_newtons(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "force.csv"
    path.write_bytes(content)
    gauge = RecordedGauge(path)
    gauge.open()
    readings = list(gauge.readings())
    assert [reading.time_s for reading in readings] == [0.5, 1.0]
    assert [reading.force_n for reading in readings] == pytest.approx([0.25, 0.5])
