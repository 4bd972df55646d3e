"""A calibration session: the folder of frames, the whole bench from frames to file, and the live bench."""

from __future__ import annotations

import csv
import itertools
import json
import shutil
import threading
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from benchmarks.calibration_force import PROBE, SENSOR, true_line
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.calibration.bench import bench_line, bench_reference
from tests.instrument.scripted_camera import BREAK, END, ScriptedCamera, frame
from tests.waiting import HANGS_S, until

from tsis.calibration.file import ProbeCalibration, calibration_bytes, calibration_sha256
from tsis.calibration.session import (
    CalibrationFrame,
    LiveCalibration,
    SessionFolder,
    SessionResult,
    SessionSetup,
    _line_over_gauge,
    archive_calibration,
    calibrate,
    save_calibration,
    saved_calibration,
)
from tsis.errors import (
    CalibrationError,
    CameraError,
    FileInputError,
    GaugeError,
    ImageMismatchError,
    InputError,
    TsisError,
)
from tsis.instrument.acquisition import Acquisition
from tsis.instrument.gauge import ForceAtTime
from tsis.model.image import TactileImage
from tsis.present.calibration import calibration_notes
from tsis.virtual.calibration_bench import VirtualBench

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tsis.calibration.camera_reference import CameraReference
    from tsis.calibration.measured import MeasuredValue


PITCH_MM = 1.5  # so that the small field holds enough dots
BEGAN = datetime(2026, 11, 22, 10, 0, tzinfo=UTC)


@dataclass(frozen=True)
class Bench:
    """A bench that has done every step, and the folder of its frames."""

    virtual: VirtualBench
    session: SessionFolder
    lamps: float  # mean true brightness of the lamps in the untouched frames


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    virtual = VirtualBench(PROBE, rng=np.random.default_rng(5), sensor=SENSOR, pitch_mm=PITCH_MM)
    session = SessionFolder(tmp_path_factory.mktemp("bench") / "frames")
    session.begin(
        SessionSetup(
            name="bench",
            probe=PROBE.name,
            camera="small",
            began=BEGAN,
            settings={"exposure_ms": 10.0},
            pitch_mm=PITCH_MM,
            patch_px=virtual.patch_px,
        )
    )
    for step in session.plan():
        session.save(step, virtual.shots(step))
        if step.name == "untouched":
            lamps = float(np.mean(virtual.machine.lamps[-step.frames :]))
    return Bench(virtual, session, lamps)


@pytest.fixture
def copied(bench: Bench, tmp_path: Path) -> SessionFolder:
    """The session's folder again, to be changed."""
    shutil.copytree(bench.session.path, tmp_path / "frames")
    return SessionFolder(tmp_path / "frames")


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


def froze(number: int) -> tuple[Callable[[SessionFolder], None], str]:
    said = f"step 'tip-2mm-1': every frame must be a new one; frames {number + 1} and {number + 2} are identical"
    return lambda session: repeat_frame(session, "tip-2mm-1", number, noisy=False), said


def held(number: int) -> tuple[Callable[[SessionFolder], None], str]:
    said = "step 'tip-10mm-1': the sum of grey levels must rise with the force"
    return lambda session: repeat_frame(session, "tip-10mm-1", number, noisy=True), said


@pytest.mark.parametrize(
    ("change", "said"),
    [
        pytest.param(
            lambda session: change_rows(session, "tip-2mm-1", lambda rows: rows[7].__setitem__(2, "")),
            "step 'tip-2mm-1': every frame must have a force",
            id="no force",
        ),
        pytest.param(
            lambda session: change_rows(session, "tip-2mm-1", lambda rows: rows.__delitem__(slice(4, None))),
            "step 'tip-2mm-1': a loading must hold at least 4 presses",
            id="too few presses",
        ),
        pytest.param(  # 0.5 N would pass for the zero
            lambda session: change_rows(session, "tip-10mm-1", lambda rows: rows.__delitem__(slice(0, 5))),
            "step 'tip-10mm-1': the tip must not touch in the first frame",
            id="begun on the tissue",
            marks=pytest.mark.slow,
        ),
        pytest.param(*froze(0), id="frozen from the start", marks=pytest.mark.slow),
        pytest.param(*froze(38), id="frozen at the end"),
        pytest.param(*held(5), id="light held early"),
        pytest.param(*held(30), id="light held late", marks=pytest.mark.slow),
        pytest.param(
            lambda session: replace_frames(session, "board", "board-untouched"), "step 'board': [^\\n]*$", id="no dots"
        ),
    ],
)
def test_frames_that_calibrate_nothing_are_refused_with_their_step(
    copied: SessionFolder, change: Callable[[SessionFolder], None], said: str
) -> None:
    change(copied)
    with pytest.raises(CalibrationError, match=said):
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
    session.begin(replace(copied.setup(), pads_kpa=(5.0, 10.0), began=None))
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


HEADINGS = "file,time_s,force_n,full_scale"


def image(seed: int = 1, *, full_scale: float = 255.0) -> TactileImage:
    levels = np.random.default_rng(seed).integers(0, int(full_scale) + 1, (9, 13))
    return TactileImage(grey=levels.astype(float), full_scale=full_scale)


def taken(count: int = 3, **changes: Any) -> list[CalibrationFrame]:
    return [CalibrationFrame(image=image(seed), time_s=0.1 * seed, **changes) for seed in range(count)]


@pytest.fixture
def session(tmp_path: Path) -> SessionFolder:
    folder = SessionFolder(tmp_path / "session")
    folder.begin(SessionSetup(name="bench", probe="tsis-direct", camera="cam", tips_mm=(10.0, 14.0)))
    return folder


def entries(session: SessionFolder) -> set[str]:
    return {path.name for path in session.path.iterdir()}


def test_terms_come_back_as_they_were(tmp_path: Path) -> None:
    terms = SessionSetup(
        name="May <b>",
        probe="p",
        camera="c",
        began=datetime(2026, 11, 22, 9, 30, tzinfo=UTC),
        settings={"exposure_ms": 10.0, "gain": 0.0},
        pitch_mm=1.25,
        pitch_sd_mm=0.001,
        gauge_share=0.002,
        patch_px=(1, 2, 30, 40),
        tips_mm=(3.0, 7.5),
        repeats=2,
    )
    folder = SessionFolder(tmp_path / "a" / "b")
    folder.begin(terms)
    assert folder.begun
    assert not SessionFolder(tmp_path).begun
    assert folder.setup() == terms
    assert [step.name for step in folder.plan()][-4:] == ["tip-3mm-1", "tip-7.5mm-1", "tip-3mm-2", "tip-7.5mm-2"]
    with pytest.raises(FileInputError, match="must hold no session yet"):
        folder.begin(terms)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"tips_mm": (2.0, 0.0)}, r"tip_radius_mm must lie in \[0.1, 1000\]; got 0"),
        ({"tips_mm": (2.0, 10.0, 2.0)}, "tips_mm must hold each tip once"),
        ({"tips_mm": (2.0, float("nan"))}, "tip_radius_mm"),
        ({"patch_px": (9, 9, 3, 3)}, "patch_px must be left < right"),
        ({"patch_px": (-1, 0, 3, 3)}, "patch_px must be left < right"),
        ({"pitch_mm": -1.0}, "pitch_mm must lie in"),
        ({"gauge_share": 2.0}, "gauge_share must lie in"),
        ({"repeats": 0}, "repeats must lie in"),
        ({"name": 3}, "name must be"),
    ],
)
def test_terms_that_no_calibration_can_end_with_are_refused_before_it_begins(
    changes: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        SessionSetup(**{"name": "n", "probe": "p", "camera": "c", **changes})


@pytest.mark.parametrize("full_scale", [255.0, 1023.0, 4095.0, 65535.0])
def test_frames_come_back_in_order_with_every_grey_level(session: SessionFolder, full_scale: float) -> None:
    shots = [
        CalibrationFrame(image=image(1, full_scale=full_scale), time_s=12345.678901, force_n=-0.0125),
        CalibrationFrame(image=image(2, full_scale=full_scale)),
    ]
    step = session.plan()[-1]
    counted: list[int] = []
    assert session.save(step, shots, progress=counted.append) == 2
    assert counted == [1, 2]
    first, second = session.shots(step)
    np.testing.assert_array_equal(first.image.grey, shots[0].image.grey)
    np.testing.assert_array_equal(second.image.grey, shots[1].image.grey)
    assert first.image.full_scale == second.image.full_scale == full_scale  # it decides what counts as saturated
    assert first.time_s == pytest.approx(12345.678901, abs=1e-4)
    assert (first.force_n, second.force_n, second.time_s) == (-0.0125, None, None)


@pytest.mark.parametrize(
    "error", [CameraError("cam was lost"), KeyboardInterrupt(), OSError(28, "No space left on device")]
)
def test_a_step_that_is_interrupted_leaves_nothing_and_earlier_steps_stay(
    session: SessionFolder, error: BaseException
) -> None:
    def interrupted() -> Iterator[CalibrationFrame]:
        yield from taken()
        raise error

    dark, untouched, *_ = session.plan()
    session.save(dark, taken())
    before = entries(session)
    with pytest.raises((CameraError, KeyboardInterrupt, FileInputError)):
        session.save(untouched, interrupted())
    assert entries(session) == before == {"session.json", "dark"}
    assert session.done(dark)
    assert not session.done(untouched)
    assert session.save(untouched, taken()) == 3


def test_a_full_disk_is_one_sentence_and_leaves_nothing(
    session: SessionFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, written = Path.write_bytes, []

    def full(path: Path, data: Any) -> int:
        written.append(path)
        if len(written) > 2:
            raise OSError(28, "No space left on device")
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(FileInputError, match="must be a folder that can be written; got: No space left"):
        session.save(session.plan()[0], taken())
    assert len(written) == 3
    assert entries(session) == {"session.json"}


def test_what_a_killed_program_left_goes_when_the_step_is_done(session: SessionFolder) -> None:
    dark = session.plan()[0]
    left = session.path / ".dark-0a1b2c3d"
    left.mkdir()
    (left / "frame-0000.png").write_bytes(b"half")
    assert not session.done(dark)
    session.save(dark, taken())
    assert entries(session) == {"session.json", "dark"}


def test_a_step_is_done_once_and_never_without_frames(session: SessionFolder) -> None:
    dark = session.plan()[0]
    with pytest.raises(CalibrationError, match="at least one frame; got none"):
        session.save(dark, [])
    assert entries(session) == {"session.json"}
    session.save(dark, taken(2))
    with pytest.raises(FileInputError, match="must be new; it exists already"):
        session.save(dark, taken(3))
    assert len(session.shots(dark)) == 2


def test_what_is_missing_is_named(session: SessionFolder) -> None:
    required = ("dark", "untouched", "board-untouched", "board", "tip-10mm-1", "tip-14mm-1")
    assert session.missing() == required
    session.save(session.plan()[0], taken())
    assert session.missing() == required[1:]
    with pytest.raises(CalibrationError, match="step 'untouched' must be done first"):
        session.shots(session.plan()[1])


@pytest.mark.parametrize(
    ("index", "sentence"),
    [
        ("file,time_s\n", "must begin with the line file,time_s,force_n,full_scale"),
        ("\0\xff", "must begin with the line|must be a table"),
        (f"{HEADINGS}\n", "at least one frame; got none"),
        (f"{HEADINGS}\n\n\n", "at least one frame; got none"),
        (f"{HEADINGS}\nframe-0000.png,0\n", "must hold a file, a time, a force and a full scale"),
        (f"{HEADINGS}\n../dark/frame-0000.png,,,255\n", "must name files of its own folder"),
        (f"{HEADINGS}\n/etc/passwd,,,255\n", "must name files of its own folder"),
        (f"{HEADINGS}\n..,,,255\n", "must be a file; got a folder"),
        (f"{HEADINGS}\nframe-9999.png,,,255\n", "does not exist"),
        (f"{HEADINGS}\nframe-0000.png,nan,,255\n", "time_s"),
        (f"{HEADINGS}\nframe-0000.png,,inf,255\n", "force_n"),
        (f"{HEADINGS}\nframe-0000.png,,half,255\n", "must hold a file, a time, a force"),
        (f"{HEADINGS}\nframe-0000.png,,,nan\n", "full_scale"),
        (f"{HEADINGS}\nframe-0000.png,,,0\n", "full_scale"),
        (f"{HEADINGS}\nshots.csv,,,255\n", "must be a complete image file|must be a PNG"),
        (f"{HEADINGS}\n{'x' * 200_000},,,255\n", "must be a table of frames"),
        ("", "must hold data; got an empty file"),
    ],
)
def test_a_hostile_index_is_one_sentence(session: SessionFolder, index: str, sentence: str) -> None:
    dark = session.plan()[0]
    session.save(dark, taken())
    (session.path / "dark" / "shots.csv").write_bytes(index.encode("latin-1"))
    with pytest.raises(FileInputError, match=sentence) as caught:
        session.shots(dark)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 600


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rows=st.lists(st.lists(st.text(max_size=12), max_size=5), max_size=3), noise=st.binary(max_size=40))
def test_whatever_stands_in_the_index_is_read_or_refused(
    session: SessionFolder, rows: list[list[str]], noise: bytes
) -> None:
    dark = session.plan()[0]
    if not session.done(dark):
        session.save(dark, taken())
    index = session.path / "dark" / "shots.csv"
    with index.open("w", newline="", encoding="utf-8", errors="replace") as file:
        writer = csv.writer(file)
        writer.writerow(HEADINGS.split(","))
        writer.writerows(rows)
    index.write_bytes(index.read_bytes() + noise)
    with pytest.raises(TsisError):
        session.shots(dark)  # no row names an existing file


def test_a_damaged_frame_is_named(session: SessionFolder) -> None:
    dark = session.plan()[0]
    session.save(dark, taken())
    file = session.path / "dark" / "frame-0001.png"
    file.write_bytes(file.read_bytes()[:-20])
    with pytest.raises(FileInputError, match=r"frame-0001\.png"):
        session.shots(dark)


@pytest.mark.parametrize(
    "document",
    [
        "[]",
        "{",
        "[" * 100_000,
        json.dumps({"format": "tsis-calibration-session", "version": 2}),
        json.dumps({"format": "tsis-calibration-session", "version": 1, "terms": None}),
        json.dumps({"format": "tsis-calibration-session", "version": 1, "terms": {"name": "a"}}),
        json.dumps(
            {
                "format": "tsis-calibration-session",
                "version": 1,
                "terms": {"name": "a", "probe": "b", "camera": "c", "tips_mm": [2.0, 2.0]},
            }
        ),
    ],
)
def test_terms_that_are_none_are_refused(session: SessionFolder, document: str) -> None:
    (session.path / "session.json").write_text(document)
    with pytest.raises(FileInputError, match=r"session|must be a readable JSON|must hold a JSON object"):
        session.setup()


def test_a_file_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here")
    with pytest.raises(FileInputError, match="must be a folder that can be written"):
        SessionFolder(tmp_path / "file").begin(SessionSetup(name="n", probe="p", camera="c"))


KNOWN = ProbeCalibration(name="of the test", probe="tsis-direct")


def test_a_calibration_is_set_aside_under_its_identity(tmp_path: Path) -> None:
    session = SessionFolder(tmp_path)
    content = save_calibration(session, KNOWN).read_bytes()
    aside = archive_calibration(session)
    assert aside is not None
    assert aside.name == f"calibration-{calibration_sha256(KNOWN)[:12]}.json"
    assert aside.read_bytes() == content
    assert saved_calibration(session) is None
    assert archive_calibration(session) is None


def test_damaged_ones_stay_beside_each_other(tmp_path: Path) -> None:
    session = SessionFolder(tmp_path)
    for content in (b"{", b"{}", b"\x00"):
        (tmp_path / "calibration.json").write_bytes(content)
        assert archive_calibration(session) is not None
    assert sorted(file.read_bytes() for file in tmp_path.iterdir()) == [b"\x00", b"{", b"{}"]


def test_presses_on_a_pad_state_the_line_over_the_gauge_less_its_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    """The gauge shows 0 N where 0.1 N are missing, and frames without a force or with hardly any count for nothing."""
    pixels = 30 * 40

    def summed(frame: TactileImage, _: CameraReference, **__: object) -> float:
        return float(frame.grey.sum())

    monkeypatch.setitem(_line_over_gauge.__globals__, "total_grey", summed)
    shots = [
        CalibrationFrame(
            image=TactileImage(grey=np.full((30, 40), grey / pixels), mm_per_pixel=(1.0, 1.0)), force_n=force
        )
        for force, grey in ((-0.1, 5e4), (0.0, 5e4), (None, 5e4), (0.4, 900 + 4e4), (0.9, 900 + 9e4), (0.5, 0.0))
    ]
    ratios = _line_over_gauge(shots, bench_line(), bench_reference())
    assert ratios == pytest.approx([0.8, 0.9])


class Log:
    """Stands in for a gauge's log: the force is the frame's arrival time, newtons."""

    def __init__(self) -> None:
        self.fails = False

    def wait_until(self, time_s: float, *, timeout_s: float) -> bool:
        return True

    def at(self, time_s: float) -> ForceAtTime:
        if self.fails:
            raise GaugeError("the gauge was silent for 1 s; check its cable")
        return ForceAtTime(force_n=time_s % 1, error_n=0.0, gap_s=0.01)


@pytest.fixture
def camera() -> ScriptedCamera:
    return ScriptedCamera()


@pytest.fixture
def acquisition(camera: ScriptedCamera, monkeypatch: pytest.MonkeyPatch) -> Iterator[Acquisition]:
    monkeypatch.setattr("tsis.calibration.session.TIMEOUT_S", HANGS_S)
    with Acquisition(lambda: camera, reconnect=False, lost_after_s=HANGS_S) as running:
        yield running


def test_only_frames_from_now_on_count_and_no_more_than_asked(camera: ScriptedCamera, acquisition: Acquisition) -> None:
    for number in range(3):
        camera.script.put(frame(number, level=number))
    until(lambda: acquisition.ring.end == 3)
    shots = LiveCalibration(acquisition).still(2)
    taken: list[int] = []
    taker = threading.Thread(target=lambda: taken.extend(int(shot.image.grey[0, 0]) for shot in shots))
    taker.start()
    until(lambda: not camera.script.qsize())
    number = 10
    while len(taken) < 2 and taker.is_alive():  # the taker may begin to listen a little later
        camera.script.put(frame(number, level=number))
        number += 1
        taker.join(0.02)
    taker.join(HANGS_S)
    assert len(taken) == 2
    assert taken[1] == taken[0] + 1
    assert min(taken) >= 10


def test_the_last_frame_asked_for_may_be_the_last_that_comes(
    camera: ScriptedCamera, acquisition: Acquisition, monkeypatch: pytest.MonkeyPatch
) -> None:
    shots = LiveCalibration(acquisition).still(2)
    monkeypatch.setattr(type(acquisition.ring), "end", 0)
    camera.script.put(frame(0, level=4))
    camera.script.put(frame(1, level=5))
    camera.script.put(END)
    assert [int(shot.image.grey[0, 0]) for shot in shots] == [4, 5]


def test_a_camera_that_is_lost_is_one_sentence(camera: ScriptedCamera, acquisition: Acquisition) -> None:
    camera.script.put(BREAK)
    until(lambda: acquisition.ring.closed)
    with pytest.raises(CameraError, match=r"must bring frames; none came .*bulk transfer failed"):
        next(LiveCalibration(acquisition).still(4))


def test_a_typed_force_belongs_to_the_next_frame(camera: ScriptedCamera, acquisition: Acquisition) -> None:
    found = []
    taker = threading.Thread(target=lambda: found.append(LiveCalibration(acquisition).take_frame(0.75)))
    taker.start()
    number = 0
    while taker.is_alive():
        camera.script.put(frame(number, level=9))
        number += 1
        taker.join(0.02)
    assert found[0].force_n == 0.75
    np.testing.assert_array_equal(found[0].image.grey, 9.0)


def test_a_loading_takes_forces_at_the_frames_until_it_is_over(
    camera: ScriptedCamera, acquisition: Acquisition
) -> None:
    over = itertools.chain([False] * 5, itertools.repeat(True))
    shots: list[CalibrationFrame] = []

    def take() -> None:
        shots.extend(LiveCalibration(acquisition, Log()).loading(lambda: next(over), every_s=0.0))  # type: ignore[arg-type]

    taker = threading.Thread(target=take)
    taker.start()
    number = 0
    while taker.is_alive():
        camera.script.put(frame(number, level=number % 200))
        number += 1
        taker.join(0.01)
    assert len(shots) == 5
    levels = [int(shot.image.grey[0, 0]) for shot in shots]
    assert levels == list(range(levels[0], levels[0] + 5))
    for shot in shots:
        assert shot.time_s is not None
        assert shot.force_n == pytest.approx(shot.time_s % 1)


def test_a_loading_takes_no_more_often_than_told(camera: ScriptedCamera, acquisition: Acquisition) -> None:
    over = itertools.chain([False] * 20, itertools.repeat(True))
    shots: list[CalibrationFrame] = []

    def take() -> None:
        shots.extend(LiveCalibration(acquisition, Log()).loading(lambda: next(over), every_s=1e6))  # type: ignore[arg-type]

    taker = threading.Thread(target=take)
    taker.start()
    number = 0
    while taker.is_alive():
        camera.script.put(frame(number))
        number += 1
        taker.join(0.005)
    assert len(shots) == 1


def test_a_silent_gauge_ends_the_loading(camera: ScriptedCamera, acquisition: Acquisition) -> None:
    log, raised = Log(), []
    log.fails = True

    def take() -> None:
        try:
            list(LiveCalibration(acquisition, log).loading(lambda: False))  # type: ignore[arg-type]
        except GaugeError as error:
            raised.append(str(error))

    taker = threading.Thread(target=take)
    taker.start()
    number = 0
    while taker.is_alive():
        camera.script.put(frame(number))
        number += 1
        taker.join(0.01)
    assert raised == ["the gauge was silent for 1 s; check its cable"]
