from __future__ import annotations

import csv
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tsis.calibration.session import CalibrationFrame, SessionFolder, SessionSetup
from tsis.errors import CalibrationError, CameraError, FileInputError, InputError, TsisError
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from collections.abc import Iterator


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
    assert folder.terms() == terms
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
        session.terms()


def test_a_file_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here")
    with pytest.raises(FileInputError, match="must be a folder that can be written"):
        SessionFolder(tmp_path / "file").begin(SessionSetup(name="n", probe="p", camera="c"))
