"""From a press to a report and back: what is kept is listed, verified, exported, taken in elsewhere, computed again."""

from __future__ import annotations

import inspect
import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import h5py
import numpy as np
import pydicom
import zarr
from tests.cli.kept_demo import FORCES, FRAMES, KNOWN, told
from tests.hardness.stand_ins import by_table

import tsis.hardness
from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.catalog.phantoms import load_phantom
from tsis.cli.acquire import ROLES
from tsis.present.records import ENDINGS
from tsis.records import values
from tsis.records.store import open_store, verify_store
from tsis.records.target import read_bundle
from tsis.virtual.direct_contact import DirectContactRig

if TYPE_CHECKING:
    import pytest
    from tests.cli.conftest import RunTsis


def test_the_demo_says_where_it_was_kept_and_the_store_holds_what_it_found(run: RunTsis, kept: Path) -> None:
    result = json.loads((kept / "demo" / "result.json").read_text())
    assert result["saved"]["target"] == 1
    (listed,) = told(run, "records", "list", "--store", "records")["targets"]
    assert (listed["number"], listed["name"], listed["presses"], listed["estimates"]) == (1, "size-8", 5, 1)
    shown = told(run, "records", "show", "1", "--store", "records")
    assert shown["estimate"]["id"] == result["saved"]["estimate"]
    assert shown["estimate"]["parameters"] == result["estimate"]["parameters"]
    inclusion = load_phantom("size-8").inclusion
    assert inclusion is not None
    assert shown["target"]["truth"]["diameter_mm"] == inclusion.diameter_mm
    roles = [(press["name"], press["role"], press["force_n"]) for press in shown["presses"]]
    assert roles == [
        ("target-0.5N.png", "target", 0.5),
        ("target-1N.png", "target", 1.0),
        ("reference-0.5N.png", "plain", 0.5),
        ("reference-1N.png", "plain", 1.0),
        ("untouched.png", "untouched", 0.0),
    ]
    assert told(run, "records", "verify", "--store", "records")["sound"] is True


def test_its_estimate_is_made_again_bit_for_bit(run: RunTsis) -> None:
    (again,) = told(run, "records", "recompute", "1", "--store", "records")["estimates"]
    assert again["same"] is True
    assert again["stored_as"] is None


def test_every_form_is_what_its_reader_takes(run: RunTsis, kept: Path) -> None:
    forms = [word for form in ENDINGS for word in ("--format", form)]
    files = told(run, "records", "export", "1", *forms, "--out", "given", "--store", "records")["files"]
    assert set(files) == set(ENDINGS)
    grey = cv2.imread(str(kept / "demo" / "target-1N.png"), cv2.IMREAD_UNCHANGED)
    assert RESEARCH_USE_ONLY in Path(files["html"]).read_text()
    assert Path(files["pdf"]).read_bytes().startswith(b"%PDF-")
    assert (Path(files["csv"]) / "estimates.csv").read_text().count("\n") == 1 + 3
    with h5py.File(files["netcdf"]) as file:
        np.testing.assert_array_equal(file["frames/target/0/grey"][1], grey)
    np.testing.assert_array_equal(zarr.open_group(files["zarr"], mode="r")["frames/target/0/grey"][1], grey)  # type: ignore[index]
    modalities = {pydicom.dcmread(path).Modality for path in Path(files["dicom"]).iterdir()}
    assert "SR" in modalities
    record = read_bundle(files["bundle"])
    np.testing.assert_array_equal(record.levels(record.presses[1]), grey)


def test_a_bundle_is_the_same_target_elsewhere_and_estimates_the_same(run: RunTsis, tmp_path: Path) -> None:
    bundle = tmp_path / "one.zip"
    told(run, "records", "export", "1", "--format", "bundle", "--out", bundle, "--store", "records")
    other = ("--store", tmp_path / "other")
    (first,) = told(run, "records", "import", bundle, *other)["imported"]
    assert (first["added"], first["present"], first["estimates"], first["new"]) == (5, 0, 1, True)
    (second,) = told(run, "records", "import", bundle, *other)["imported"]
    assert (second["added"], second["present"], second["estimates"], second["new"]) == (0, 5, 0, False)
    shown, there = (told(run, "records", "show", "1", "--store", where) for where in ("records", tmp_path / "other"))
    assert shown == there
    (again,) = told(run, "records", "recompute", "1", *other)["estimates"]
    assert again["same"] is True
    refused = run("records", "import", bundle, "--target", "4", *other)
    assert refused.code == 2
    assert "--target is not used with a bundle" in refused.err
    refused = run("records", "import", bundle, "--store", tmp_path / "subjects", "--kind", "subject")
    assert refused.code == 2
    assert "must go into a store of phantoms" in refused.err


def test_the_folder_of_the_demo_is_known_by_its_frames(run: RunTsis, tmp_path: Path) -> None:
    (there,) = told(run, "records", "import", "demo", "--store", "records")["imported"]
    assert (there["target"], there["added"], there["present"], there["estimates"]) == (1, 0, 5, 0)
    elsewhere = ("--store", tmp_path / "fresh")
    (fresh,) = told(run, "records", "import", "demo", *elsewhere)["imported"]
    assert (fresh["target"], fresh["added"], fresh["present"], fresh["estimates"]) == (1, 5, 0, 1)
    made = told(run, "records", "show", "1", *elsewhere)["estimate"]["parameters"]
    assert made == told(run, "records", "show", "1", "--store", "records")["estimate"]["parameters"]


def test_what_examine_found_is_kept_and_made_again(run: RunTsis, tmp_path: Path) -> None:
    plain = [word for name in FRAMES for word in ("--reference-press", name.replace("target", "reference"))]
    store = ("--store", tmp_path / "records")
    keep = ("--save", *store, "--target", "31", "--out", tmp_path / "examined")
    found = told(run, "examine", *FRAMES, *plain, *KNOWN, *FORCES, *keep)
    assert found["saved"]["target"] == 31
    shown = told(run, "records", "show", "31", *store)
    assert shown["estimate"]["parameters"] == found["estimate"]["parameters"]
    digests = {press["name"]: press["settings"]["sha256"] for press in shown["presses"]}
    assert set(digests) == {Path(name).name for name in (*FRAMES, *plain[1::2])}
    (again,) = told(run, "records", "recompute", "31", *store)["estimates"]
    assert again["same"] is True


def test_a_hardness_is_kept_and_made_again(run: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Quick(DirectContactRig):
        def __init__(self, *arguments: object, **options: object) -> None:
            super().__init__(*arguments, solve=by_table, **options)  # type: ignore[arg-type]

    monkeypatch.setattr("tsis.virtual.direct_contact.DirectContactRig", Quick)
    store = ("--store", tmp_path / "records")
    told(run, "hardness", "--demo", "--save", *store, "--out", tmp_path / "touch")
    frames = [tmp_path / "touch" / f"press-{force}N.png" for force in (0.7, 1.2)]
    known = ("--calibration", tmp_path / "touch" / "calibration.json", "--scale-mm", "0.0336,0.0392")
    radius = ("--force-n", "0.7", "--force-n", "1.2", "--radius-mm", "3", "--radius-sd-mm", "0.02")
    told(run, "hardness", *frames, *known, *radius, "--save", *store, "--out", tmp_path / "again")
    shown = [told(run, "records", "show", number, *store)["estimate"] for number in ("1", "2")]
    assert [each["kind"] for each in shown] == ["hardness", "hardness"]
    given = {name: value for name, value in shown[1]["options"].items() if name not in shown[0]["options"]}
    assert given == {"radius_mm": 3.0, "radius_sd_mm": 0.02}
    taken = inspect.signature(tsis.hardness.estimate).parameters  # what an estimate takes where nothing is given
    for each in shown:
        assert {name: each["options"][name] for name in ("blur_mm", "drift_sd")} == {
            name: taken[name].default for name in ("blur_mm", "drift_sd")
        }
        assert each["options"]["prior"] == each["provenance"]["prior"]
    again = told(run, "records", "recompute", "--all", *store)["estimates"]
    assert [(each["target"], each["same"]) for each in again] == [(1, True), (2, True)]


def test_a_snapshot_is_kept_as_its_import_would_find_it(run: RunTsis, tmp_path: Path) -> None:
    store = ("--store", tmp_path / "records")
    pressed = ("--probe", "tsis-domed", "--force-n", "0")
    snapshot = ("acquire", *pressed, "--target", "12", "--role", "untouched", "--out", tmp_path)
    kept = told(run, *snapshot, "--save", *store)["saved"]
    said = ("--role", "untouched", "--probe", "tsis-domed")
    (imported,) = told(run, "records", "import", tmp_path / "Target12", *said, *store)["imported"]
    assert (imported["target"], imported["added"], imported["present"], imported["notes"]) == (12, 0, 1, [])
    with open_store(tmp_path / "records") as records:
        (press,) = records.presses(records.target(12))
        raw = next((tmp_path / "Target12").glob("*-raw.*"))
        np.testing.assert_array_equal(records.levels(press.frame), cv2.imread(str(raw), cv2.IMREAD_UNCHANGED))
        assert (press.id, press.role, press.probe) == (kept["press"], "untouched", "tsis-domed")
        assert "no-contact" in press.flags
        assert verify_store(records).sound
    alone = ("--store", tmp_path / "imported")
    told(run, "records", "import", tmp_path / "Target12", *said, *alone)
    with open_store(tmp_path / "imported") as records:
        (other,) = records.presses(records.target(12))
    assert replace(other, id=press.id, target=press.target) == press
    assert ROLES == values.ROLES
