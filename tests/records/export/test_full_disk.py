"""Exports for which there is no room: nothing is left, one sentence is said, and the program ends well."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.system

ROOT = Path(__file__).parents[3]
INSIDE = [sys.executable, "-m", "tests.records.export.full_disk"]


def exported(command: list[str]) -> list[dict[str, Any]]:
    """What came of each export, where the program itself neither complained nor broke."""
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    if "mount:" in done.stderr or "unshare:" in done.stderr:
        pytest.skip(f"no mount is allowed here: {done.stderr.strip()}")
    assert (done.returncode, done.stderr) == (0, "")
    found: list[dict[str, Any]] = json.loads(done.stdout)
    return found


def assert_refused(found: list[dict[str, Any]], reason: str) -> None:
    assert {each["form"] for each in found} == {"netcdf", "zarr", "csv", "bundle", "bundle.zip", "dicom"}
    for each in found:
        assert each["left"] == []
        assert each["error"] == ("RecordsError" if each["form"] == "dicom" else "FileInputError")
        assert each["said"].endswith(f": {reason}")
        assert each["form"] in each["said"]
        assert "\n" not in each["said"]


def test_files_that_may_not_grow_to_any_part_of_what_they_need(tmp_path: Path) -> None:
    found = exported([*INSIDE, str(tmp_path), "limit"])
    assert len(found) == 6 * 12
    assert_refused(found, "File too large")


@pytest.mark.system
@pytest.mark.skipif(shutil.which("unshare") is None or os.geteuid() != 0, reason="needs unshare, and root to mount")
@pytest.mark.parametrize("kib", [4, 40, 500, 900])
def test_a_real_disk_that_is_full(tmp_path: Path, kib: int) -> None:
    mount = f"mount -t tmpfs -o size={kib}k tmpfs {tmp_path}"
    found = exported(["unshare", "-m", "sh", "-c", f"{mount} && exec {' '.join(INSIDE)} {tmp_path}"])
    assert len(found) == 6
    assert_refused(found, "No space left on device")
