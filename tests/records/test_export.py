"""Exports as tables and pictures; where there is no room nothing is left, and one sentence is said."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.records.sample import sample_estimate, sample_record

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import FileInputError, RecordsError
from tsis.files.tables import cell, table_bytes
from tsis.records.export import csv_files, write_csv


def rows(content: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(content.decode(), newline="")))


def test_tables_hold_what_the_dossier_holds() -> None:
    record = sample_record()
    files = csv_files(record)
    (target,) = rows(files["target.csv"])
    assert (target["target"], target["true depth (mm)"], target["true Young's modulus (kPa)"]) == ("3", "5.0", "80.0")
    presses = rows(files["presses.csv"])
    assert [float(each["force (N)"]) for each in presses] == [press.force_n for press in record.presses]
    assert [each["frame (SHA-256)"] for each in presses] == [press.frame for press in record.presses]
    assert json.loads(presses[0]["settings (JSON)"]) == {"exposure_ms": 10.0, "gain": 1.0}
    assert presses[1]["flags"] == "moving"
    estimates = rows(files["estimates.csv"])
    assert record.estimate is not None
    found = record.estimate.estimate
    for row in estimates:
        name = row["parameter"]
        mean, sd = row["mean (in unit)"], row["sd (in unit)"]
        if name == "young_kpa":  # the sample says that it is not identified
            assert (mean, sd) == ("", "")
        else:
            assert (float(mean), float(sd)) == (found.samples[name].mean(), found.samples[name].std())
        low, high = np.quantile(found.samples[name], [0.05, 0.95])
        assert float(row["90% interval from (in unit)"]) == pytest.approx(low, rel=1e-12)
        assert float(row["90% interval to (in unit)"]) == pytest.approx(high, rel=1e-12)
    assert [(row["unit"], row["identified"], row["trusted"]) for row in estimates] == [
        ("mm", "yes", "yes"),
        ("mm", "yes", "yes"),
        ("kPa", "no", "yes"),
    ]
    assert [row["Cramer-Rao sd (in unit)"] for row in estimates] == ["0.38", "0.47", "infinite"]
    assert {row["prior"] for row in estimates} == {found.prior}
    assert RESEARCH_USE_ONLY in files["README.txt"].decode()


def test_what_nobody_measured_is_an_empty_cell() -> None:
    record = sample_record(estimated=False)
    press = replace(record.presses[0], force_n=None, mm_per_pixel=None, calibration=None)
    files = csv_files(replace(record, presses=(press,)))
    (row,) = rows(files["presses.csv"])
    assert (row["force (N)"], row["pixel size x (mm)"], row["calibration (SHA-256)"]) == ("", "", "")
    assert rows(files["estimates.csv"]) == []


def test_the_last_estimate_of_each_kind_is_in_force() -> None:
    record = sample_record()
    stored = record.estimates[0]
    kinds = ("inclusion", "hardness", "inclusion", "hardness", "inclusion")
    found = rows(
        csv_files(replace(record, estimates=tuple(replace(stored, kind=kind) for kind in kinds)))["estimates.csv"]
    )
    assert [row["in force"] for row in found[::3]] == ["no", "no", "no", "yes", "yes"]
    assert [row["kind"] for row in found[::3]] == list(kinds)


def test_an_estimate_that_is_not_trusted_has_no_result() -> None:
    record = sample_record()
    stored = record.estimates[0]
    doubted = replace(stored, estimate=sample_estimate(trusted=False))
    found = rows(csv_files(replace(record, estimates=(stored, doubted)))["estimates.csv"])
    good, bad = found[:3], found[3:]
    empty = [{name for name, text in row.items() if not text} for row in (*good, *bad)]
    never = {"supersedes"}
    assert empty[:3] == [never, never, never | {"mean (in unit)", "sd (in unit)"}]
    result = {
        name for name in found[0] if name.split(" (")[0] in ("mean", "sd", "Cramer-Rao sd", "narrowing", "presence")
    }
    result |= {"90% interval from (in unit)", "90% interval to (in unit)"}
    assert len(result) == 7
    assert empty[3:] == [result | never | {"notes"}] * 3, "its note is on a parameter, with numbers"
    assert [row["trusted"] for row in found] == ["yes"] * 3 + ["no"] * 3
    assert [float(row["prior sd (in unit)"]) for row in bad] == [4.04, 2.31, 23.1]


@pytest.mark.parametrize("full_scale", [255.0, 4095.0])
def test_frames_and_manifest_hold_every_level(tmp_path: Path, full_scale: float) -> None:
    record = sample_record(full_scale=full_scale)
    write_csv(record, tmp_path / "out")
    files = csv_files(record)
    for press, row in zip(record.presses, rows(files["presses.csv"]), strict=True):
        read = cv2.imread(str(tmp_path / "out" / row["frame file"]), cv2.IMREAD_UNCHANGED)
        assert read is not None
        assert read.dtype == record.levels(press).dtype
        np.testing.assert_array_equal(read, record.levels(press))
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_bytes())
    assert manifest["notice"] == RESEARCH_USE_ONLY
    on_disk = {str(path.relative_to(tmp_path / "out")) for path in (tmp_path / "out").rglob("*") if path.is_file()}
    assert on_disk == set(manifest["files"]) | {"manifest.json"} == set(files)
    for name, entry in manifest["files"].items():
        content = (tmp_path / "out" / name).read_bytes()
        assert content == files[name]
        assert entry == {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}


def test_the_users_mask_says_who_may_read(tmp_path: Path) -> None:
    before = os.umask(0o077)
    try:
        write_csv(sample_record(), tmp_path / "out")
    finally:
        os.umask(before)
    assert {path.stat().st_mode & 0o077 for path in (tmp_path / "out", *(tmp_path / "out").rglob("*"))} == {0}


def test_a_folder_that_exists_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with pytest.raises(FileInputError, match="must be a new name"):
        write_csv(sample_record(), tmp_path / "out")
    assert list(tmp_path.rglob("*")) == [tmp_path / "out"]


def test_a_frame_that_is_not_as_its_press_says_leaves_nothing(tmp_path: Path) -> None:
    record = sample_record()
    wrong = replace(record, presses=(*record.presses[:3], replace(record.presses[3], rows=95)))
    with pytest.raises(RecordsError, match="95 x 150"):
        write_csv(wrong, tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1", " =cmd|' /C calc'!A0", "＝1", "'=1"])
def test_no_text_begins_like_a_formula_and_one_apostrophe_gives_it_back(text: str) -> None:
    assert cell(text) == f"'{text}"


def test_numbers_are_never_guarded() -> None:
    assert [cell(value) for value in (-1.5, -3, 1e-9, 0.1)] == ["-1.5", "-3", "1e-09", "0.1"]


@given(st.lists(st.lists(st.text(st.characters(codec="utf-8")), min_size=2, max_size=2), max_size=5))
def test_tables_are_after_rfc_4180(table: list[list[str]]) -> None:
    content = table_bytes(table)
    read = list(csv.reader(io.StringIO(content.decode(), newline=""), strict=True))
    guard = re.compile(r"\s*[=+\-@\t\r'＝＋－＠]")
    back = [[text[1:] if guard.match(text[1:]) and text[0] == "'" else text for text in row] for row in read]
    assert back == table
    assert content == b"" or content.endswith(b"\r\n")
    bare = re.sub(rb'"[^"]*"', b"", content)
    assert bare.count(b"\n") == bare.count(b"\r\n") == len(table)
    assert not any(text[:1] in tuple("=+-@\t\r") and text for row in read for text in row)


ROOT = Path(__file__).parents[2]
INSIDE = [sys.executable, "-m", "tests.records.full_disk_exports"]


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


@pytest.mark.system
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
