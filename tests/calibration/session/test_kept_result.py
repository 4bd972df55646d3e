"""Calibrations that are set aside: each keeps its bytes, also those that nobody can read any more."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.calibration.file import ProbeCalibration
from tsis.calibration.file.content import identity
from tsis.calibration.session import SessionFolder, keep_calibration, kept_calibration, set_aside

if TYPE_CHECKING:
    from pathlib import Path

KNOWN = ProbeCalibration(name="of the test", probe="tsis-direct")


def test_a_calibration_is_set_aside_under_its_identity(tmp_path: Path) -> None:
    session = SessionFolder(tmp_path)
    content = keep_calibration(session, KNOWN).read_bytes()
    aside = set_aside(session)
    assert aside is not None
    assert aside.name == f"calibration-{identity(KNOWN)[:12]}.json"
    assert aside.read_bytes() == content
    assert kept_calibration(session) is None
    assert set_aside(session) is None


def test_damaged_ones_stay_beside_each_other(tmp_path: Path) -> None:
    session = SessionFolder(tmp_path)
    for content in (b"{", b"{}", b"\x00"):
        (tmp_path / "calibration.json").write_bytes(content)
        assert set_aside(session) is not None
    assert sorted(file.read_bytes() for file in tmp_path.iterdir()) == [b"\x00", b"{", b"{}"]
