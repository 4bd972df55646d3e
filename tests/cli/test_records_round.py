"""From a press to a report and back: what is kept is listed, verified, exported, taken in elsewhere, computed again."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import h5py
import numpy as np
import pydicom
import pytest
import zarr
from tests.hardness.stand_ins import by_table

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.cli import main
from tsis.cli.records.forms import ENDINGS
from tsis.model import load_phantom
from tsis.records import open_store, verify
from tsis.records.export import read_bundle
from tsis.virtual import DirectContactRig

if TYPE_CHECKING:
    from tests.cli.conftest import RunTsis

KNOWN = ("--calibration", "demo/calibration.json", "--scale-mm", "0.0336,0.0392")
FRAMES = ("demo/target-0.5N.png", "demo/target-1N.png")
FORCES = ("--force-n", "0.5", "--force-n", "1")


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with ``demo``, whose frames and estimate went into the store ``records``."""
    folder = tmp_path_factory.mktemp("round")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(
            sys, "argv", ["tsis", "demo", "--keep", "--store", "records", "--phantom", "size-8", "--out", "demo"]
        )
        with pytest.raises(SystemExit) as stop:
            main()
    assert not stop.value.code
    return folder


@pytest.fixture
def run(run_tsis: RunTsis, kept: Path, monkeypatch: pytest.MonkeyPatch) -> RunTsis:
    """Runs the program in that folder."""
    monkeypatch.chdir(kept)
    return run_tsis


def told(run: RunTsis, *arguments: str | Path) -> Any:
    finished = run(*arguments, "--json")
    assert finished.code == 0, finished.err
    return json.loads(finished.out)


def test_the_demo_says_where_it_was_kept_and_the_store_holds_what_it_found(run: RunTsis, kept: Path) -> None:
    result = json.loads((kept / "demo" / "result.json").read_text())
    assert result["kept"]["target"] == 1
    (listed,) = told(run, "records", "list", "--store", "records")["targets"]
    assert (listed["number"], listed["name"], listed["presses"], listed["estimates"]) == (1, "size-8", 5, 1)
    shown = told(run, "records", "show", "1", "--store", "records")
    assert shown["estimate"]["id"] == result["kept"]["estimate"]
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
    with h5py.File(files["hdf5"]) as file:
        np.testing.assert_array_equal(file["frames/target/0/grey"][1], grey)
    np.testing.assert_array_equal(zarr.open_group(files["zarr"], mode="r")["frames/target/0/grey"][1], grey)  # type: ignore[index]
    assert json.loads(Path(files["fhir"]).read_text())["resourceType"] == "Bundle"
    modalities = {pydicom.dcmread(path).Modality for path in Path(files["dicom"]).iterdir()}
    assert "SR" in modalities
    dossier = read_bundle(files["bundle"])
    np.testing.assert_array_equal(dossier.levels(dossier.presses[1]), grey)


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
    assert "this target is a phantom" in refused.err


def test_the_folder_of_the_demo_is_known_by_its_frames(run: RunTsis, tmp_path: Path) -> None:
    (there,) = told(run, "records", "import", "demo", "--store", "records")["imported"]
    assert (there["target"], there["added"], there["present"], there["estimates"]) == (1, 0, 5, 0)
    elsewhere = ("--store", tmp_path / "fresh")
    (fresh,) = told(run, "records", "import", "demo", *elsewhere)["imported"]
    assert (fresh["target"], fresh["added"], fresh["present"], fresh["estimates"]) == (1, 5, 0, 1)
    made = told(run, "records", "show", "1", *elsewhere)["estimate"]["parameters"]
    assert made == told(run, "records", "show", "1", "--store", "records")["estimate"]["parameters"]


def test_what_examine_found_is_kept_and_made_again(run: RunTsis, tmp_path: Path) -> None:
    plain = [word for name in FRAMES for word in ("--plain", name.replace("target", "reference"))]
    store = ("--store", tmp_path / "records")
    keep = ("--keep", *store, "--target", "31", "--out", tmp_path / "examined")
    found = told(run, "examine", *FRAMES, *plain, *KNOWN, *FORCES, *keep)
    assert found["kept"]["target"] == 31
    shown = told(run, "records", "show", "31", *store)
    assert shown["estimate"]["parameters"] == found["estimate"]["parameters"]
    digests = {press["name"]: press["settings"]["sha256"] for press in shown["presses"]}
    assert set(digests) == {Path(name).name for name in (*FRAMES, *plain[1::2])}
    (again,) = told(run, "records", "recompute", "31", *store)["estimates"]
    assert again["same"] is True


def test_colours_are_refused_before_anything_is_computed(run: RunTsis, tmp_path: Path) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (492, 768, 3)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "colour.png"), noise)
    colour = tmp_path / "colour.png"
    finished = run("examine", colour, *KNOWN, "--force-n", "1", "--keep", "--store", tmp_path / "records")
    assert finished.code == 2
    assert "save it as a grey PNG file" in finished.err
    assert not (tmp_path / "records").exists()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("demo", "--store", "x"), "--store needs --keep"),
        (("demo", "--target", "3"), "--target needs --keep"),
        (("demo", "--keep", "--target", "0"), "--target"),
        (("demo", "--keep", "--store", "demo/result.json/below"), "result.json"),
        (("examine", FRAMES[0], "--keep"), "--keep needs --calibration"),
        (("hardness", "--demo", "--kind", "subject"), "--kind needs --keep"),
        (("hardness", "--demo", "--keep", "--kind", "person"), "no kind of store is called 'person'"),
        (("acquire", "--keep", "--frames", "2"), "tsis records import"),
        (("acquire", "--keep", "--role", "palin"), "did you mean 'plain'"),
        (("acquire", "--store", "x"), "--store needs --keep"),
    ],
)
def test_keeping_says_what_is_wrong_before_anything_is_pressed(
    run: RunTsis, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, arguments: tuple[str, ...], sentence: str
) -> None:
    monkeypatch.setenv("TSIS_RECORDS_DIR", str(tmp_path))
    finished = run(*arguments)
    assert finished.code == 2
    assert sentence in finished.err
    assert finished.err.count("\n") == 1


def test_a_hardness_is_kept_and_made_again(run: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Quick(DirectContactRig):
        def __init__(self, *arguments: object, **options: object) -> None:
            super().__init__(*arguments, solve=by_table, **options)  # type: ignore[arg-type]

    monkeypatch.setattr("tsis.cli.hardness.DirectContactRig", Quick)
    store = ("--store", tmp_path / "records")
    told(run, "hardness", "--demo", "--keep", *store, "--out", tmp_path / "touch")
    frames = [tmp_path / "touch" / f"press-{force}N.png" for force in (0.7, 1.2)]
    known = ("--calibration", tmp_path / "touch" / "calibration.json", "--scale-mm", "0.0336,0.0392")
    radius = ("--force", "0.7", "--force", "1.2", "--radius", "3", "--radius-sd-mm", "0.02")
    told(run, "hardness", *frames, *known, *radius, "--keep", *store, "--out", tmp_path / "again")
    shown = [told(run, "records", "show", number, *store)["estimate"] for number in ("1", "2")]
    assert [each["kind"] for each in shown] == ["hardness", "hardness"]
    assert shown[1]["options"] == {"radius_mm": 3.0, "radius_sd_mm": 0.02}
    again = told(run, "records", "recompute", "--all", *store)["estimates"]
    assert [(each["target"], each["same"]) for each in again] == [(1, True), (2, True)]


def test_a_snapshot_is_kept_as_its_import_would_find_it(run: RunTsis, tmp_path: Path) -> None:
    store = ("--store", tmp_path / "records")
    snapshot = ("acquire", "--force-n", "0", "--target", "12", "--role", "untouched", "--out", tmp_path)
    kept = told(run, *snapshot, "--keep", *store)["kept"]
    (imported,) = told(run, "records", "import", tmp_path / "Target12", *store)["imported"]
    assert (imported["target"], imported["added"], imported["present"]) == (12, 0, 1)
    with open_store(tmp_path / "records") as records:
        (press,) = records.presses(records.target(12))
        raw = next((tmp_path / "Target12").glob("*-raw.*"))
        np.testing.assert_array_equal(records.levels(press.frame), cv2.imread(str(raw), cv2.IMREAD_UNCHANGED))
        assert (press.id, press.role, press.probe) == (kept["press"], "untouched", "tsis-2011")
        assert "no-contact" in press.flags
        assert verify(records).sound
