"""Files that were written before there was one codec: each opens, with the hash that it had."""

from __future__ import annotations

import hashlib
import json
import shutil
import zipfile
from pathlib import Path

import cv2
import numpy as np
from tests.calibration.file.bench import bench

from tsis.calibration.file import calibration_bytes, calibration_sha256, read_calibration
from tsis.records.target import read_bundle, write_bundle
from tsis.sweep.data_set import manifest_sha256, read_manifest

EARLIER = Path(__file__).parent / "earlier"
CALIBRATION = "a2a950cfd776b954cfa5173bcc1ac8ed83f2752183c65f6826e3b9c912cf774b"


def test_a_calibration_opens_and_has_its_hash() -> None:
    known = read_calibration(EARLIER / "calibration.json")
    assert known.name == "Prüfstand 2"
    assert calibration_sha256(known) == CALIBRATION
    written = json.loads(calibration_bytes(known))
    assert written["sha256"] == json.loads((EARLIER / "calibration.json").read_bytes())["sha256"] == CALIBRATION
    assert calibration_sha256(bench(name="Prüfstand 2")) == CALIBRATION


def test_an_exported_target_opens_and_is_written_with_the_same_hashes(tmp_path: Path) -> None:
    record = read_bundle(EARLIER / "target.zip")
    assert len(record.presses) > 1
    write_bundle(record, tmp_path / "again.zip")
    with zipfile.ZipFile(EARLIER / "target.zip") as earlier, zipfile.ZipFile(tmp_path / "again.zip") as again:
        assert again.namelist() == earlier.namelist()
        for name in set(earlier.namelist()) - {"manifest.json"}:
            if name.endswith(".png"):  # the levels are the same; their file may be packed otherwise
                before, after = (
                    cv2.imdecode(np.frombuffer(archive.read(name), np.uint8), cv2.IMREAD_UNCHANGED)
                    for archive in (earlier, again)
                )
                np.testing.assert_array_equal(after, before)
            else:
                assert again.read(name) == earlier.read(name)


def test_the_manifest_of_a_sweep_opens_and_has_its_hash(tmp_path: Path) -> None:
    shutil.copy(EARLIER / "sweep-manifest.json", tmp_path / "manifest.json")
    manifest = read_manifest(tmp_path)
    assert manifest["plan_sha256"] == manifest_sha256(manifest["plan"])
    independent = json.dumps(manifest["plan"], sort_keys=True).encode()
    assert manifest["plan_sha256"] == hashlib.sha256(independent).hexdigest()
