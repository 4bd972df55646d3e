from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.calibration_force import PROBE, SENSOR
from tests.present.test_pages import Reader

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.calibration.file import calibration_sha256
from tsis.calibration.response import Saturation
from tsis.calibration.session import SessionFolder, SessionSetup, calibrate
from tsis.present.calibration import (
    calibration_document,
    calibration_notes,
    calibration_page,
    calibration_rows,
    content_rows,
    line_card,
    specification_rows,
)
from tsis.present.html import html_bytes
from tsis.virtual.calibration_bench import VirtualBench

if TYPE_CHECKING:
    from tsis.calibration.file import ProbeCalibration
    from tsis.calibration.session import SessionResult

BEGAN = datetime(2026, 11, 22, 10, 0, tzinfo=UTC)
HOSTILE = "<script>alert(1)</script> [bold]"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[ProbeCalibration, SessionResult]:
    bench = VirtualBench(PROBE, rng=np.random.default_rng(6), sensor=SENSOR, pitch_mm=1.5)
    session = SessionFolder(tmp_path_factory.mktemp("report") / "frames")
    session.begin(
        SessionSetup(
            name=HOSTILE,
            probe=PROBE.name,
            camera="small",
            began=BEGAN,
            settings={"gain": 3.0},
            pitch_mm=1.5,
            patch_px=bench.patch_px,
            tips_mm=(2.0, 14.0),
        )
    )
    for step in session.plan():
        session.save(step, bench.shots(step))
    return calibrate(session, days=10)


def test_the_page_is_whole_and_safe(made: tuple[ProbeCalibration, SessionResult]) -> None:
    page = html_bytes(calibration_page(*made, provenance={"session": HOSTILE}))
    read = Reader(page)
    assert "script" not in read.tags
    assert len(read.alternatives) == len(set(read.alternatives)) == 3
    for shown in ("Sums of grey levels", "Departures from the line", "Frame of the board"):
        assert any(words.startswith(shown) for words in read.alternatives)
    assert all(source.startswith("data:image/") for source in read.sources)
    text = page.decode()
    assert RESEARCH_USE_ONLY in text
    for name, value, interval in calibration_rows(*made):
        for cell in (name, value, interval):
            assert cell in text
    assert "2026-12-02" in text


def test_the_rows_hold_what_was_measured(made: tuple[ProbeCalibration, SessionResult]) -> None:
    known, findings = made
    rows = {name: (value, interval) for name, value, interval in calibration_rows(known, findings)}
    assert known.force_line is not None
    slope = known.force_line.slope_grey_per_n
    value, interval = rows["force line, slope"]
    assert float(value.split()[0].replace(",", "")) == pytest.approx(slope.value, rel=1e-4)
    assert [float(part) for part in interval.replace(",", "").split(" to ")] == pytest.approx(
        slope.interval(), rel=1e-4
    )
    assert rows["setting gain"][0] == "3"
    assert rows["made"][0] == "2026-11-22 10:00"
    assert rows["good until"][0] == "2026-12-02"
    assert rows["identity"][0] == calibration_sha256(known)[:12]
    hysteresis = findings.line.hysteresis
    assert hysteresis is not None
    assert float(rows["hysteresis"][0].split()[0]) == pytest.approx(100 * hysteresis.value, abs=0.006)
    without = replace(findings, line=replace(findings.line, hysteresis=None))
    assert "hysteresis" not in [row[0] for row in calibration_rows(known, without)]
    assert set(content_rows(known)) < set(calibration_rows(known, findings))
    simulated = dict(row[:2] for row in content_rows(replace(known, made=None, expires=None)))
    assert (simulated["made"], simulated["good until"]) == ("simulated", "does not age")


def test_the_interval_column_holds_intervals_alone(made: tuple[ProbeCalibration, SessionResult]) -> None:
    for name, value, interval in calibration_rows(*made):
        assert interval == "" or " to " in interval, name
        assert "e+" not in value + interval, name


def test_the_page_shows_the_calibration_that_was_saved(made: tuple[ProbeCalibration, SessionResult]) -> None:
    known, findings = made
    saved = replace(known, settings={"gain": 7.5}, force_line=None)
    first, second, *_ = calibration_page(known, findings, provenance={}, saved=saved).tables
    rows, session = ({row[0]: row[1] for row in table.rows} for table in (first, second))
    assert rows["identity"] == calibration_sha256(saved)[:12]
    assert rows["setting gain"] == "7.5"
    assert session["setting gain"] == "3"
    assert "identity" not in session


def test_the_fit_of_the_line_has_a_verdict(made: tuple[ProbeCalibration, SessionResult]) -> None:
    known, findings = made
    line = known.force_line
    assert line is not None
    good = line_card(line, findings.loadings)
    assert not good.doubtful
    bent = [replace(item, total_grey=item.total_grey * 1.3) for item in findings.loadings]
    assert line_card(line, bent).doubtful


def test_programs_read_the_same(made: tuple[ProbeCalibration, SessionResult]) -> None:
    known, findings = made
    document = calibration_document(known, findings, provenance={})
    assert known.scale is not None
    assert document["values"]["scale y"] == {
        "value": known.scale.mm_per_pixel_y.value,
        "sd": known.scale.mm_per_pixel_y.sd,
        "interval_95": list(known.scale.mm_per_pixel_y.interval()),
        "unit": known.scale.mm_per_pixel_y.unit,
    }
    assert document["sha256"] == calibration_sha256(known)
    assert document["expires"] == "2026-12-02T10:00:00+00:00"


def test_the_notes_say_what_was_not_measured(made: tuple[ProbeCalibration, SessionResult]) -> None:
    known, findings = made
    whole = " ".join(calibration_notes(known, findings))
    assert known.reference is not None
    assert known.scale is not None
    assert f"Scale from {known.scale.count} dots" in whole
    bare = replace(
        known, reference=replace(known.reference, flat_frames=0, patch_px=None, patch_grey=None, lamp_sd=0.0)
    )
    found = replace(
        findings,
        line=replace(findings.line, saturated=True),
        response=replace(
            findings.response,
            saturation=Saturation(
                bend_per_kpa2=replace(findings.response.saturation.bend_per_kpa2, value=1e-9, sd=1e-6)
            ),
        ),
    )
    notes = " ".join(calibration_notes(bare, found))
    for sentence in (
        "No flat field was taken",
        "No reference patch",
        "No press came near saturation",
        "Pixels clipped",
    ):
        assert sentence in notes
        assert sentence not in whole
    rows = {name: interval for name, _, interval in calibration_rows(bare, found)}
    assert rows["saturation"].endswith("to open above")


def test_the_sheet_shows_every_row_and_none_without_one(made: tuple[ProbeCalibration, SessionResult]) -> None:
    known, _ = made
    rows = {row[0]: row[1:] for row in specification_rows(known)}
    assert rows["frame rate"][0].startswith("30 1/s")
    assert rows["repeatability"][0] == "not measured"
    assert rows["hysteresis"][0].count("%") == 1
    assert rows["spatial resolution"][2] == "9.8 um"
    assert specification_rows(replace(known, specification=None)) == ()
