"""Calibrations that are set aside: each keeps its bytes, also those that nobody can read any more."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.calibration.file import ProbeCalibration, calibration_sha256
from tsis.calibration.session import SessionFolder, archive_calibration, save_calibration, saved_calibration

if TYPE_CHECKING:
    from pathlib import Path

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
