"""For whom a calibration holds and until when, and what is none."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from typing import Any

import pytest
from tests.calibration.file.bench import (
    LATER,
    MADE,
    bench,
    bench_line,
    bench_reference,
    bench_scale,
    measured,
    sheet,
)

from tsis.calibration.force_line import ForceLine
from tsis.calibration.scale import PixelScale
from tsis.errors import CalibrationError, InputError
from tsis.model.calibration import Calibration


@pytest.mark.parametrize(
    ("use", "said"),
    [
        ({"now": LATER + timedelta(seconds=1)}, "must not be expired; it was good until 2027-05-21"),
        ({"now": MADE - timedelta(days=1)}, "must not come from the future"),
        ({"now": MADE, "probe": "tsis-domed"}, "must be of the probe in use, 'tsis-domed'; it is of 'tsis-2011'"),
        ({"now": MADE, "camera": "another"}, "must be of the camera in use, 'another'"),
        ({"now": MADE, "settings": {"exposure_ms": 10.0}}, "holds at exposure_ms = 20; the camera is at 10"),
    ],
)
def test_expired_and_foreign_calibrations_are_refused(use: dict[str, Any], said: str) -> None:
    with pytest.raises(CalibrationError, match=re.escape(said)):
        bench().require_usable(**use)


def test_its_own_probe_may_use_it_in_any_time_zone() -> None:
    east = timezone(timedelta(hours=9))
    now = (MADE + timedelta(minutes=1)).astimezone(east)
    bench().require_usable(
        now, probe="tsis-2011", camera="Aravis-TSIS01", settings={"exposure_ms": 20.0000001, "brightness": 3.0}
    )
    bench(probe="", camera="", settings={}).require_usable(now, probe="any", camera="any", settings={"gain": 9.0})


def test_a_part_that_was_not_measured_is_named() -> None:
    with pytest.raises(CalibrationError, match="a force needs the part 'force_line', which calibration 'bench'"):
        bench().need(ForceLine, "a force")
    assert bench().need(PixelScale, "a size") == bench_scale()


@pytest.mark.parametrize(
    "wrong",
    [
        {"made": datetime(2026, 1, 1)},
        {"made": None},
        {"expires": MADE},
        {"settings": {"gain": math.nan}},
        {"scale": 0.05},
        {"name": None},
        {"expires": None},
        {"made": datetime(1, 1, 1, tzinfo=timezone(timedelta(hours=23, minutes=59)))},
        {"expires": datetime(9999, 12, 31, 23, 59, tzinfo=timezone(-timedelta(hours=23, minutes=59)))},
        {"made": datetime(1999, 12, 31, 12, tzinfo=UTC)},
        {"expires": datetime(2201, 1, 1, tzinfo=UTC)},
        {"made": "2026-11-22"},
        {"name": "\ud800"},
        {"name": "bench\n2"},
        {"probe": "\x1b[31mtsis"},
        {"camera": "c" * 201},
        {"settings": {"gain\n": 1.0}},
    ],
)
def test_values_that_make_no_calibration_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong)).removesuffix("s")) as caught:
        bench(**wrong)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 300


def test_the_longest_name_and_the_first_and_last_year_are_taken() -> None:
    far = {"made": datetime(2000, 1, 1, tzinfo=UTC), "expires": datetime(2200, 12, 31, tzinfo=UTC)}
    known = bench(name="ä" * 200, force_line=bench_line(), specification=sheet(), **far)
    east, west = (timezone(sign * timedelta(hours=23, minutes=59)) for sign in (1, -1))
    known.require_usable(MADE.astimezone(east))
    known.require_usable(MADE.astimezone(west))
    assert bench(made=None, expires=None).made is None


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (
            {"force_line": bench_line(slope_grey_per_n=measured(1e5, "grey/mN"))},
            "slope_grey_per_n must be in grey/N; got",
        ),
        ({"force_line": bench_line(intercept_grey=measured(9.0))}, "force_line.intercept_grey must be in grey; got ''"),
        ({"force_line": bench_line(residual_share=measured(0.1, "%"))}, "residual_share must be in no unit"),
        (
            {"force_line": bench_line(residual_grey=measured(-1.0, "grey"))},
            "residual_grey must not be negative; got -1",
        ),
        (
            {"reference": replace(bench_reference(), read_noise_grey=measured(0.5, "N"))},
            "read_noise_grey must be in grey",
        ),
        ({"reference": replace(bench_reference(), read_noise_grey=measured(-0.5, "grey"))}, "must not be negative"),
        ({"reference": replace(bench_reference(), shot_noise_grey=measured(-0.5, "grey"))}, "must not be negative"),
        (
            {"response": Calibration(gain_grey_per_kpa=60, saturation_kpa=20.0, probe="tsis-domed")},
            "response.probe must be that of the calibration, 'tsis-2011'; got 'tsis-domed'",
        ),
        ({"response": Calibration(gain_grey_per_kpa=60, saturation_kpa=20.0, name="\x1b[2J")}, "response.name must be"),
        ({"specification": sheet(probe="tsis-domed")}, "specification.probe must be that of the calibration"),
        ({"specification": sheet("mN")}, r"specification.rows\[0\].measured must be in mN; got 'N'"),
        ({"specification": sheet(note="a\nb")}, r"specification.rows\[0\].note must be printable"),
    ],
)
def test_parts_that_make_no_sense_are_refused(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        bench(**wrong)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"tips_mm": ()}, "tips_mm must hold the radius of at least one tip"),
        ({"tips_mm": (2.0, -1.0)}, r"tips_mm must lie in \[0.1, 1000\]; got -1"),
        ({"tips_mm": (math.inf,)}, "tips_mm must lie in"),
        ({"unit_covariance": (-1.0, 0.0, 0.0)}, "unit_covariance must lie in"),
        ({"unit_covariance": (0.0, 0.0, -1.0)}, "unit_covariance must lie in"),
        ({"method": "x"}, "no segmentation method is called 'x'"),
    ],
)
def test_force_lines_that_make_no_sense_are_refused(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        bench_line(**wrong)


def test_a_response_that_names_no_probe_is_that_of_the_calibrations() -> None:
    """Else an estimate under another probe would not be refused."""
    silent = Calibration(gain_grey_per_kpa=60.0, saturation_kpa=20.0)
    assert bench(response=silent, probe="tsis-domed").cited_response("0" * 64).probe == "tsis-domed"
    assert bench().cited_response("0" * 64).probe == "tsis-2011"
