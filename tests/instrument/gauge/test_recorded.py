from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import FileInputError, GaugeError, InputError
from tsis.instrument.gauge import ForceReading, Gauge, RecordedGauge, write_readings

if TYPE_CHECKING:
    from pathlib import Path


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
        (b"time_ms,force_n\n0,1\n", "must begin with the header time_s,force_n"),
        (b"time_s,force_kgf\n0,1\n", "must begin with the header"),
        (b"time_s,force_n,other\n0,1,2\n", "must begin with the header"),
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
