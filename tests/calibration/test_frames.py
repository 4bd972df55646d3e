"""Calibrations as results rest on them, and folders of frames: identity, validity, camera, limits."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from tests.calibration.bench import bench

from tsis.calibration import frames, load_frames
from tsis.calibration.file import calibration_bytes, calibration_sha256, write_calibration
from tsis.calibration.frames import load_calibration
from tsis.errors import CalibrationError, FileInputError, TsisError

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.calibration.file import ProbeCalibration


NOW = datetime.now(UTC)
YESTERDAY, TOMORROW = NOW - timedelta(days=1), NOW + timedelta(days=1)


def written(path: Path, known: ProbeCalibration) -> Path:
    write_calibration(known, path)
    return path


def test_its_citation_names_what_was_read(tmp_path: Path) -> None:
    known = bench(made=YESTERDAY, expires=TOMORROW)
    found = load_calibration(written(tmp_path / "calibration.json", known))
    assert found.identity == calibration_sha256(known)
    said = found.citation()
    assert (said["name"], said["sha256"]) == ("bench", found.identity)
    assert re.fullmatch("[0-9a-f]{64}", found.identity)
    assert datetime.fromisoformat(said["made"]) == known.made
    assert datetime.fromisoformat(said["expires"]) == known.expires
    assert found.response.name == f"bench ({found.identity[:12]})"
    timeless = load_calibration(written(tmp_path / "timeless.json", bench(made=None, expires=None)))
    assert (timeless.citation()["made"], timeless.citation()["expires"]) == (None, None)
    assert timeless.identity != found.identity


def test_one_that_is_past_or_damaged_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="must not be expired"):
        load_calibration(written(tmp_path / "past.json", bench(made=NOW - timedelta(days=9), expires=YESTERDAY)))
    (tmp_path / "torn.json").write_bytes(calibration_bytes(bench())[:-40])
    with pytest.raises(FileInputError, match=r"torn\.json"):
        load_calibration(tmp_path / "torn.json")


def camera(name: str, **settings: float) -> Any:
    """What is asked of an acquisition: its name and its settings."""
    present = tuple(SimpleNamespace(name=setting, value=value) for setting, value in settings.items())
    return SimpleNamespace(name=name, settings=lambda: present)


def test_another_camera_or_setting_is_refused_and_stored_frames_tell_no_camera(tmp_path: Path) -> None:
    found = load_calibration(written(tmp_path / "calibration.json", bench(made=YESTERDAY, expires=TOMORROW)))
    found.require_camera(camera("Aravis-TSIS01", exposure_ms=20.0, gain=0.0), stored=False)
    found.require_camera(camera("a folder of files"), stored=True)
    with pytest.raises(CalibrationError, match="must be of the camera in use, 'another'"):
        found.require_camera(camera("another"), stored=False)
    with pytest.raises(CalibrationError, match="holds at exposure_ms = 20; the camera is at 10"):
        found.require_camera(camera("Aravis-TSIS01", exposure_ms=10.0), stored=False)


@pytest.mark.parametrize(("most", "refusal"), [(3, "it holds none"), (2, "at most 2 sidecars; it holds 3")])
def test_a_folder_may_hold_as_many_sidecars_as_the_limit(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, most: int, refusal: str
) -> None:
    monkeypatch.setattr(frames, "MOST_FRAMES", most)
    for number in range(3):
        (tmp_path / f"{number}.json").write_text("{}", encoding="utf-8")
    with pytest.raises(TsisError, match=refusal):
        load_frames(tmp_path)
