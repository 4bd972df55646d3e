from __future__ import annotations

import csv
import json
import shutil
from dataclasses import replace
from datetime import timedelta
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.calibration_force import PROBE, SENSOR, true_line
from tests.calibration.session.conftest import BEGAN

from tsis.calibration.file import calibration_bytes, calibration_sha256
from tsis.calibration.session import SessionFolder, SessionResult, calibrate
from tsis.errors import CalibrationError, ImageMismatchError, InputError, TsisError
from tsis.present.calibration import calibration_notes

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.calibration.session.conftest import Bench

    from tsis.calibration.file import ProbeCalibration
    from tsis.calibration.measured import MeasuredValue

LEVEL = 0.999  # of eight intervals of one bench, all should hold


@pytest.fixture(scope="module")
def made(bench: Bench) -> tuple[ProbeCalibration, SessionResult]:
    return calibrate(bench.session, days=90)


def change_rows(session: SessionFolder, step: str, change: Callable[[list[list[str]]], object]) -> None:
    index = session.path / step / "shots.csv"
    heading, *rows = csv.reader(index.read_text().splitlines())
    change(rows)
    index.write_text("".join(",".join(row) + "\n" for row in [heading, *rows]))


def replace_frames(session: SessionFolder, step: str, by: str) -> None:
    shutil.rmtree(session.path / step)
    shutil.copytree(session.path / by, session.path / step)


def test_the_bench_is_recovered_within_the_intervals(
    bench: Bench, made: tuple[ProbeCalibration, SessionResult]
) -> None:
    known, findings = made
    assert known.scale is not None
    assert known.reference is not None
    assert known.force_line is not None
    intercept, slope = true_line(bench.virtual.machine, bench.lamps)
    truth = bench.virtual.machine.truth
    found: tuple[
        tuple[float, MeasuredValue, float], ...
    ] = (  # truth, found, widest half of the interval that is of use
        (SENSOR.mm_per_pixel[0], known.scale.mm_per_pixel_x, 0.02),
        (SENSOR.mm_per_pixel[1], known.scale.mm_per_pixel_y, 0.02),
        (SENSOR.read_noise_grey, known.reference.read_noise_grey, 0.01),
        (SENSOR.shot_noise_grey, known.reference.shot_noise_grey, 0.02),
        (slope, known.force_line.slope_grey_per_n, 0.25),
        (truth.response.gain_grey_per_kpa * bench.lamps, findings.response.gain_grey_per_kpa, 0.25),
    )
    for true, measured, width in found:
        low, high = measured.interval(LEVEL)
        assert low <= true <= high
        assert (high - low) / 2 < width * true
    low, high = known.force_line.intercept_grey.interval(LEVEL)
    assert low <= intercept <= high
    assert high - low < 0.1 * slope
    low, high = findings.response.saturation.interval(LEVEL)
    assert low <= truth.response.saturation_kpa <= high


def test_it_says_whose_it_is_and_how_long_it_is_good(made: tuple[ProbeCalibration, SessionResult]) -> None:
    known, _ = made
    assert (known.name, known.probe, known.camera) == ("bench", PROBE.name, "small")
    assert dict(known.settings) == {"exposure_ms": 10.0}
    assert known.made == BEGAN
    assert known.expires == BEGAN + timedelta(days=90)
    known.require_usable(BEGAN + timedelta(days=89))
    with pytest.raises(CalibrationError, match="must not be expired"):
        known.require_usable(BEGAN + timedelta(days=91))


def test_the_sheet_is_measured(bench: Bench, made: tuple[ProbeCalibration, SessionResult]) -> None:
    known, _ = made
    assert known.specification is not None
    rows = {row.quantity: row.measured for row in known.specification.rows}
    edge, rate = rows["spatial resolution"], rows["frame rate"]
    assert edge is not None
    assert rate is not None
    assert edge.value == pytest.approx(2 * 1.2816 * 0.05, rel=0.1)  # 10 to 90 % of an edge blurred by 0.05 mm
    assert rate.value == pytest.approx(30.0)
    assert rows["repeatability"] is None  # each tip was loaded once


def test_the_same_frames_give_the_same_file_and_grow_no_younger(
    bench: Bench, made: tuple[ProbeCalibration, SessionResult]
) -> None:
    result: list[tuple[int, int]] = []
    again, _ = calibrate(bench.session, days=90, progress=lambda done, total: result.append((done, total)))
    assert calibration_bytes(again) == calibration_bytes(made[0])
    done, totals = zip(*result, strict=True)
    assert list(done) == sorted(set(done))
    assert set(totals) == {done[-1]}


def test_a_simulated_one_does_not_age_and_steps_left_out_are_named(
    copied: SessionFolder, made: tuple[ProbeCalibration, SessionResult]
) -> None:
    document = json.loads((copied.path / "session.json").read_text())
    document["terms"] |= {"began": None, "patch_px": None, "tips_mm": [10.0, 14.0]}
    (copied.path / "session.json").write_text(json.dumps(document))
    for step in ("flat-1", "flat-3", "edge", "tip-2mm-1"):
        shutil.rmtree(copied.path / step)
    change_rows(copied, "untouched", lambda rows: [row.__setitem__(1, "") for row in rows])
    known, findings = calibrate(copied)
    assert known.made is None
    assert known.expires is None
    known.require_usable(BEGAN + timedelta(days=100_000))
    assert known.reference is not None
    assert known.reference.flat_frames == 8
    assert "No reference patch" in " ".join(calibration_notes(known, findings))
    assert "No reference patch" not in " ".join(calibration_notes(*made))
    assert known.specification is not None
    rows = {row.quantity: row.measured for row in known.specification.rows}
    assert rows["spatial resolution"] is None
    assert rows["frame rate"] is None
    assert calibration_sha256(known) != calibration_sha256(made[0])


def test_a_pitch_that_is_poorly_known_widens_the_gain_twice_and_the_force_line_not_at_all(
    copied: SessionFolder, made: tuple[ProbeCalibration, SessionResult]
) -> None:
    document = json.loads((copied.path / "session.json").read_text())
    document["terms"]["pitch_sd_mm"] = 0.02 * document["terms"]["pitch_mm"]
    (copied.path / "session.json").write_text(json.dumps(document))
    known, findings = calibrate(copied, days=90)
    gain, sure = findings.response.gain_grey_per_kpa, made[1].response.gain_grey_per_kpa
    # a pitch that is 2 % too long makes every pixel's area 4 % too large
    assert np.sqrt(gain.sd**2 - sure.sd**2) == pytest.approx(0.04 * gain.value, rel=0.02)
    assert known.force_line == made[0].force_line


@pytest.mark.slow
def test_without_any_flat_light_counts_as_even_and_the_boards_frames_tell_the_noise(copied: SessionFolder) -> None:
    for step in ("flat-1", "flat-2", "flat-3"):
        shutil.rmtree(copied.path / step)
    known, findings = calibrate(copied)
    assert known.reference is not None
    assert np.ptp(known.reference.relative_light[known.reference.usable]) == 0.0
    low, high = known.reference.shot_noise_grey.interval(LEVEL)
    assert low <= SENSOR.shot_noise_grey <= high
    assert (high - low) / 2 < 0.2 * SENSOR.shot_noise_grey
    assert "No flat field was taken" in " ".join(calibration_notes(known, findings))


@pytest.mark.slow
def test_presses_too_light_to_tell_are_left_out(
    copied: SessionFolder, made: tuple[ProbeCalibration, SessionResult]
) -> None:
    zero = float(made[1].loadings[0].force_n[0])
    change_rows(copied, "tip-2mm-1", lambda rows: rows[3].__setitem__(2, f"{zero + 0.02:.4f}"))
    _, findings = calibrate(copied)
    whole, less = made[1].loadings[0], findings.loadings[0]
    assert len(less.force_n) == len(whole.force_n) - 1
    np.testing.assert_array_equal(less.total_grey, np.delete(whole.total_grey, 3))
    assert len(findings.loadings[1].force_n) == len(made[1].loadings[1].force_n)


@pytest.mark.parametrize("name", ["dark", "untouched", "board-untouched", "board", "tip-10mm-1"])
def test_a_step_that_is_missing_is_named(copied: SessionFolder, name: str) -> None:
    shutil.rmtree(copied.path / name)
    with pytest.raises(CalibrationError, match=f"steps must be done first: {name};"):
        calibrate(copied)


def test_a_frame_without_a_force_is_refused_with_its_step(copied: SessionFolder) -> None:
    change_rows(copied, "tip-2mm-1", lambda rows: rows[7].__setitem__(2, ""))
    with pytest.raises(CalibrationError, match="step 'tip-2mm-1': every frame must have a force"):
        calibrate(copied)


def test_a_loading_of_too_few_presses_is_refused_with_its_step(copied: SessionFolder) -> None:
    change_rows(copied, "tip-2mm-1", lambda rows: rows.__delitem__(slice(4, None)))
    with pytest.raises(CalibrationError, match="step 'tip-2mm-1': a loading must hold at least 4 presses"):
        calibrate(copied)


@pytest.mark.slow
def test_a_loading_that_begins_on_the_tissue_is_refused_with_its_step(copied: SessionFolder) -> None:
    change_rows(copied, "tip-10mm-1", lambda rows: rows.__delitem__(slice(0, 5)))  # 0.5 N would pass for the zero
    with pytest.raises(CalibrationError, match="step 'tip-10mm-1': the tip must not touch in the first frame"):
        calibrate(copied)


def repeat_frame(session: SessionFolder, step: str, number: int, *, noisy: bool) -> None:
    """What a camera that froze delivers; with ``noisy`` one that goes on with noise, as of a held scene."""
    (own,) = (each for each in session.plan() if each.name == step)
    shots = session.shots(own)
    shutil.rmtree(session.path / step)
    rng, held = np.random.default_rng(3), shots[number].image
    for at in range(number + 1, len(shots)):
        flips = rng.integers(0, 2, held.grey.shape) if noisy else 0
        shots[at] = replace(shots[at], image=replace(held, grey=np.clip(held.grey + flips, 0, held.full_scale)))
    session.save(own, shots)


@pytest.mark.parametrize("number", [pytest.param(0, marks=pytest.mark.slow), 38])
def test_a_camera_that_froze_in_a_loading_is_refused_with_its_step(copied: SessionFolder, number: int) -> None:
    repeat_frame(copied, "tip-2mm-1", number, noisy=False)
    said = f"step 'tip-2mm-1': every frame must be a new one; frames {number + 1} and {number + 2} are identical"
    with pytest.raises(CalibrationError, match=said):
        calibrate(copied)


@pytest.mark.parametrize("number", [5, pytest.param(30, marks=pytest.mark.slow)])
def test_light_that_does_not_follow_the_force_is_refused_with_its_step(copied: SessionFolder, number: int) -> None:
    repeat_frame(copied, "tip-10mm-1", number, noisy=True)
    with pytest.raises(CalibrationError, match=r"step 'tip-10mm-1': the sum of grey levels must rise with the force"):
        calibrate(copied)


def test_loadings_that_leave_the_slope_untold_are_refused(copied: SessionFolder) -> None:
    def halve(rows: list[list[str]]) -> None:
        for row in rows:
            row[2] = f"{float(row[2]) / 2:.6f}"

    change_rows(copied, "tip-2mm-1", halve)
    change_rows(copied, "tip-10mm-1", halve)
    change_rows(copied, "tip-10mm-1", halve)
    with pytest.raises(CalibrationError, match=r"slope of the force line must differ from zero; .* is -.* to "):
        calibrate(copied)


def test_a_board_without_dots_is_refused_with_its_step(copied: SessionFolder) -> None:
    replace_frames(copied, "board", "board-untouched")
    with pytest.raises(CalibrationError, match="step 'board': ") as caught:
        calibrate(copied)
    assert "\n" not in str(caught.value)


def test_dark_and_untouched_swapped_are_refused(copied: SessionFolder) -> None:
    (copied.path / "dark").rename(copied.path / "kept")
    (copied.path / "untouched").rename(copied.path / "dark")
    (copied.path / "kept").rename(copied.path / "untouched")
    with pytest.raises(TsisError, match=r"swapped|lit by at least|darker"):
        calibrate(copied)


@pytest.mark.parametrize(
    ("step", "named"), [("dark", "untouched"), ("board", "board"), ("edge", "edge"), ("tip-2mm-1", "tip-2mm-1")]
)
def test_frames_of_another_size_are_refused(copied: SessionFolder, step: str, named: str) -> None:
    (own,) = (each for each in copied.plan() if each.name == step)
    shots = copied.shots(own)
    shutil.rmtree(copied.path / step)
    copied.save(own, [replace(shot, image=replace(shot.image, grey=shot.image.grey[:-2])) for shot in shots])
    with pytest.raises(ImageMismatchError, match=f"{named!r}: frames must have the shape"):
        calibrate(copied)


@pytest.mark.parametrize("days", [0.0, float("nan"), 1e9])
def test_days_out_of_range_are_refused(bench: Bench, days: float) -> None:
    with pytest.raises(InputError, match=r"days must lie in \[1, 3650\]"):
        calibrate(bench.session, days=days)


def test_pads_measure_the_light_on_dents(bench: Bench, copied: SessionFolder, tmp_path: Path) -> None:
    """The bench's light does not change by a dent: the gain on tissue is the true one."""
    session = SessionFolder(tmp_path / "with-pads")
    session.begin(replace(copied.terms(), pads_kpa=(5.0, 10.0), began=None))
    for step in copied.plan():
        shutil.copytree(copied.path / step.name, session.path / step.name)
    assert [step.name for step in session.plan()][-2:] == ["pad-5kPa", "pad-10kPa"]
    assert "pad-5kPa" not in session.missing()  # optional
    for step in session.plan()[-2:]:
        session.save(step, bench.virtual.shots(step))
    made, found = calibrate(session)
    assert made.tissue is not None
    assert found.dents is not None
    true = bench.virtual.machine.truth.response.gain_grey_per_kpa
    assert abs(np.log(made.tissue.gain_grey_per_kpa / true)) < 3 * np.hypot(found.dents.gain_sd, 0.02)
    assert made.tissue.light is not None
    assert made.tissue.light.factor.size
    assert made.force_line is not None
    assert made.force_line.soft_ratio is None  # the sum shows no pad at the exposure of this bench's tips
