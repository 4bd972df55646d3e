"""``tsis records``: what it prints, changes and exports, what it says of wrong input, and the whole round."""

from __future__ import annotations

import inspect
import json
import subprocess
import sys
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import h5py
import numpy as np
import pydicom
import pytest
import zarr
from tests.cli.kept_demo import FORCES, FRAMES, KNOWN, told
from tests.hardness.stand_ins import by_table
from tests.records.folders import save
from tests.records.pressed_object import pressed, stored_object
from tests.records.sample import WHEN, levels, sample_calibration, sample_record
from tests.records.variants import hardness, with_estimate

import tsis.hardness
from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.calibration.file import calibration_sha256
from tsis.catalog.phantoms import load_phantom
from tsis.cli.acquire import ROLES
from tsis.files.atomic import Disk
from tsis.instrument.image_files import png_bytes
from tsis.model.image import TactileImage
from tsis.present.records import ENDINGS
from tsis.records import values
from tsis.records.store import Store, open_store, verify_store
from tsis.records.target import read_bundle
from tsis.virtual.direct_contact import DirectContactRig

if TYPE_CHECKING:
    from tests.cli.conftest import RunTsis

    from tsis.model.estimate import Estimate


STORE = ("--store", "records")
COMMANDS = ("list", "show", "verify", "import", "recompute", "edit", "export")


@pytest.mark.parametrize("command", COMMANDS)
def test_help_ends_with_an_example(run_tsis: RunTsis, command: str) -> None:
    shown = " ".join(run_tsis("records", command, "--help").out.split())
    assert f"Example: tsis records {command}" in shown
    for option in ("--store", "--kind", "--database", "--json"):
        assert option in shown


@pytest.mark.usefixtures("records")
def test_a_list_tells_how_often_each_target_was_pressed(run_tsis: RunTsis) -> None:
    targets = json.loads(run_tsis("records", "list", *STORE, "--json").out)["targets"]
    assert [(each["number"], each["presses"], each["estimates"]) for each in targets] == [(1, 2, 1), (2, 5, 0)]
    assert targets[1]["last"] == (WHEN + timedelta(seconds=4)).isoformat()
    shown = run_tsis("records", "list", *STORE).out
    assert "[bold]plain[/bold]" in shown  # text stays text
    assert "Research use only" in shown


@pytest.mark.usefixtures("records")
def test_a_target_is_shown_with_its_estimate_and_pages_of_presses(run_tsis: RunTsis) -> None:
    shown = json.loads(run_tsis("records", "show", "1", *STORE, "--json").out)
    found = pressed()[2]
    assert shown["estimate"]["parameters"]["young_kpa"]["mean"] == found.mean["young_kpa"]
    assert shown["estimate"]["parameters"]["young_kpa"]["interval_90"] == list(found.interval(0.9)["young_kpa"])
    assert shown["estimate"]["parameters"]["young_kpa"]["truth"] == 103.0
    assert shown["estimate"]["flags"] == list(found.flags)
    assert [each["name"] for each in shown["calibrations"]] == ["bench"]
    assert shown["history"] == []
    page = json.loads(run_tsis("records", "show", "2", "--limit", "2", "--offset", "3", *STORE, "--json").out)
    assert [press["name"] for press in page["presses"]] == ["p3.png", "p4.png"]
    assert (page["presses_in_all"], page["estimate"]) == (5, None)
    people = run_tsis("records", "show", "1", *STORE).out
    for words in ("Current estimate: hardness", "Presses, 1 to 2 of 2", "Calibration bench", "Research use only"):
        assert words in people
    assert "No estimate yet" in run_tsis("records", "show", "2", *STORE).out


def test_a_frame_without_force_or_scale_is_shown_as_the_schema_says(run_tsis: RunTsis, tmp_path: Path) -> None:
    """`run_tsis` holds each document against the published schema."""
    (tmp_path / "press.png").write_bytes(png_bytes(TactileImage(grey=levels(5).astype(float), full_scale=255.0)))
    assert run_tsis("records", "import", "press.png", *STORE).code == 0
    (press,) = json.loads(run_tsis("records", "show", "1", *STORE, "--json").out)["presses"]
    assert (press["force_n"], press["mm_per_pixel"]) == (None, None)


def test_the_last_estimate_of_each_kind_is_shown(run_tsis: RunTsis, tmp_path: Path) -> None:
    given = sample_record()
    (first,) = given.estimates
    (hard,) = with_estimate(given, hardness(), "hardness").estimates
    again = replace(first, id="estimate-c", supersedes=first.id, made=first.made + timedelta(seconds=1))
    with open_store(tmp_path / "records") as store:
        store.import_target(replace(given, estimates=(first, again, replace(hard, calibration=first.calibration))))
    shown = json.loads(run_tsis("records", "show", "3", *STORE, "--json").out)
    assert shown["in_force"] == ["estimate-c", "estimate-b"]
    people = run_tsis("records", "show", "3", *STORE).out
    assert people.count("Current estimate") == 2
    assert people.index("estimate: hardness") < people.index("estimate: inclusion")  # the newest first


def test_an_estimate_with_numbers_that_json_has_not_is_shown(run_tsis: RunTsis, tmp_path: Path) -> None:
    given = sample_record()
    (stored,) = given.estimates
    odd = {"limit": float("inf"), "nothing": float("nan")}
    estimate = replace(stored.estimate, provenance=odd)
    with open_store(tmp_path / "records") as store:
        store.import_target(
            replace(given, estimates=(replace(stored, estimate=estimate, options=odd, environment=odd),))
        )
    shown = json.loads(run_tsis("records", "show", "3", *STORE, "--json").out)["estimate"]
    for name in ("provenance", "options", "environment"):
        assert shown[name] == {"limit": {"$number": "infinity"}, "nothing": {"$number": "nan"}}
    forms = ",".join(form for form in ENDINGS if form != "dicom")
    finished = run_tsis("records", "export", "3", "--format", forms, *STORE)
    assert finished.code == 0, finished.err


def test_a_sound_store_ends_with_its_audit_head(run_tsis: RunTsis, records: Path) -> None:
    with open_store(records) as store:
        head = verify_store(store).head
    finished = run_tsis("records", "verify", *STORE, "--json")
    assert finished.code == 0
    result = json.loads(finished.out)
    assert (result["sound"], result["faults"]) == (True, [])
    assert result["audit"] == {"number": head.number, "hash": head.hash}
    assert head.hash in run_tsis("records", "verify", *STORE).out


def test_an_anchor_that_lags_is_told(run_tsis: RunTsis, records: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert json.loads(run_tsis("records", "verify", *STORE, "--json").out)["unanchored"] == 0
    assert "does not vouch" not in run_tsis("records", "verify", *STORE).out

    def full(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    with open_store(records) as store:
        monkeypatch.setattr("tsis.records.store.write_anchor", full)
        for _ in range(3):
            store.add_target()
    result = run_tsis("records", "verify", *STORE, "--json")
    assert result.code == 0
    assert json.loads(result.out)["unanchored"] == 3
    assert "does not vouch for the last 3 entries of the audit" in run_tsis("records", "verify", *STORE).out


def test_a_damaged_store_is_exit_code_1_with_what_is_wrong(run_tsis: RunTsis, records: Path) -> None:
    frame = next((records / "files").glob("*/*.png"))
    frame.write_bytes(frame.read_bytes() + b"x")
    finished = run_tsis("records", "verify", *STORE)
    assert finished.code == 1
    assert frame.stem in finished.out.replace("\n", "")
    assert "NOT as it was stored: 1 fault:" in finished.out
    result = json.loads(run_tsis("records", "verify", *STORE, "--json").out)
    assert result["sound"] is False
    assert len(result["faults"]) == 1


def test_a_target_whose_estimates_are_damaged_is_not_said_to_have_none(run_tsis: RunTsis, records: Path) -> None:
    for samples in (records / "files").glob("*/*.samples"):
        samples.unlink()
    shown = run_tsis("records", "show", "1", *STORE).out
    assert "Left out: " in shown
    assert "No estimate can be read." in shown


def test_edits_change_what_people_wrote_and_count_versions(run_tsis: RunTsis, records: Path) -> None:
    assert run_tsis("records", "edit", "2", "--name", "plain", "--truth", "young_kpa=5", *STORE).code == 0
    with open_store(records) as store:
        target = store.target(2)
        press = store.presses(target)[0]
    assert run_tsis("records", "edit", "1", "--truth", "none", *STORE).code == 0
    with open_store(records) as store:
        assert dict(store.target(1).truth) == {}
    assert (target.name, dict(target.truth), target.note, target.version) == ("plain", {"young_kpa": 5.0}, "left", 2)
    edit = ("records", "edit", "2", "--press", press.id[:6], *STORE)
    assert run_tsis(*edit, "--force-n", "0.6", "--flag", "none", "--note", "again", "--version", "1").code == 0
    stale = run_tsis(*edit, "--force-n", "0.7", "--version", "1")
    assert stale.code == 1
    assert "somebody else has changed it since version 1" in stale.err
    assert run_tsis(*edit, "--force-n", "none", "--role", "untouched", "--json").code == 0
    with open_store(records) as store:
        now = store.presses(target)[0]
        assert verify_store(store).sound
    assert (now.force_n, now.flags, now.note, now.role, now.version) == (None, (), "again", "untouched", 3)


def test_an_edit_that_leaves_an_estimate_stale_is_told_everywhere(run_tsis: RunTsis, records: Path) -> None:
    with open_store(records) as store:
        press = store.presses(store.target(1))[1].id
    edit = ("records", "edit", "1", "--press", press, *STORE)
    assert "have changed since" not in run_tsis(*edit, "--note", "again").out
    sentence = (
        f"The presses have changed since the hardness was estimated: force_n 1.2 -> 1.4 of press {press[:8]}; make it "
        "again with tsis records recompute 1."
    )
    assert sentence in run_tsis(*edit, "--force-n", "1.4").out
    (told,) = json.loads(run_tsis(*edit, "--note", "more", "--json").out)["changed_since"]
    assert told["sentence"] == sentence
    assert told["inputs"] == [{"press": press, "name": "force_n", "before": 1.2, "after": 1.4}]
    assert sentence in run_tsis("records", "show", "1", "--limit", "1", *STORE).out
    shown = json.loads(run_tsis("records", "show", "1", "--limit", "1", *STORE, "--json").out)
    assert shown["changed_since"] == [told]
    assert told["id"] in shown["in_force"]
    listed = json.loads(run_tsis("records", "list", *STORE, "--json").out)["targets"]
    assert [each["changed_since"] for each in listed] == [["hardness"], []]
    people = run_tsis("records", "list", *STORE).out
    assert "1 *" in people
    assert "tsis records show N tells which" in people
    assert run_tsis(*edit, "--force-n", "1.2").code == 0
    assert "*" not in run_tsis("records", "list", *STORE).out
    assert "have changed since" not in run_tsis("records", "show", "1", *STORE).out


def test_recompute_tells_the_same_and_then_what_changed(run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch) -> None:
    with open_store("records") as store:
        stored_object(store)
    again = json.loads(run_tsis("records", "recompute", "1", *STORE, "--json").out)["estimates"]
    assert [(each["same"], each["stored_as"]) for each in again] == [(True, None)]
    before = tsis.hardness.estimate

    def moved(*arguments: Any, **options: Any) -> Estimate:
        found = before(*arguments, **options)
        posterior = replace(found.untrusted, samples={"young_kpa": found.samples["young_kpa"] + 10})
        return replace(found, untrusted=posterior, flags=(*found.flags, "new_flag"))

    monkeypatch.setattr(tsis.hardness, "estimate", moved)
    dry = run_tsis("records", "recompute", "1", "--dry-run", *STORE)
    assert "Flags gained: new_flag" in dry.out
    assert "Nothing was stored" in dry.out
    (found,) = json.loads(run_tsis("records", "recompute", "--all", *STORE, "--json").out)["estimates"]
    shown = json.loads(run_tsis("records", "show", "1", *STORE, "--json").out)
    assert shown["estimate"]["id"] == found["stored_as"]
    assert shown["estimate"]["supersedes"] == shown["history"][0]["id"]


def test_of_all_targets_one_that_fails_stops_no_other(run_tsis: RunTsis, records: Path) -> None:
    with open_store(records) as store:
        target = stored_object(store)
        store.edit_press(store.presses(target)[0], role="plain")
        store.edit_press(store.presses(target)[1], role="plain")
    finished = run_tsis("records", "recompute", "--all", *STORE, "--json")
    assert finished.code == 1
    result = json.loads(finished.out)
    assert [each["target"] for each in result["estimates"]] == [1]
    assert [each["target"] for each in result["failed"]] == [3]
    assert "at least one press on the target" in result["failed"][0]["reason"]


OTHER_CODES = {
    "there is none": 1,
    "records.sqlite3": 1,
    "'notes.txt/below' must be a store": 1,
    "garbage": 1,
    "store of subjects": 1,
    "must be PostgreSQL": 1,
    "must be a URL": 1,
    "made again": 1,
}  # of messages that are no wrong input


@pytest.mark.usefixtures("records")
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["list", "--store", "absent"], "must be a store of records; there is none"),
        (["list", "--store", "records/records.sqlite3"], "records.sqlite3"),
        (["list", "--store", "notes.txt/below"], "'notes.txt/below' must be a store"),
        (["list", "--store", "no-store"], "must be a store of records; there is none"),
        (["list", "--store", "garbage"], "garbage"),
        (["list", "--kind", "subject", *STORE], "must be a store of subjects; it is one of phantoms"),
        (["list", "--kind", "person", *STORE], "no kind of store is called 'person'"),
        (["list", "--database", "mysql://a:secret@b/c", *STORE], "must be PostgreSQL"),
        (["list", "--database", "nonsense", *STORE], "must be a URL"),
        (["show", "three", *STORE], "valid integer"),
        (["show", "0", *STORE], "target must lie in [1, 99999]; got 0"),
        (["show", "77", *STORE], "must be a number that this store of phantoms holds; got 77"),
        (["show", "1", "--limit", "0", *STORE], "--limit"),
        (["show", "1", "--offset", "-1", *STORE], "--offset"),
        (["verify", "--store", "absent"], "there is none"),
        (["recompute", *STORE], "give the number of a target, or --all"),
        (["recompute", "1", "--all", *STORE], "give the number of a target, or --all"),
        (["recompute", "2", *STORE], "target 2 must have an estimate or a map to be made again"),
        (["recompute", "77", *STORE], "got 77"),
        (["edit", "1", *STORE], "give what to change: --name, --note or --truth"),
        (["edit", "1", "--press", "abcd", *STORE], "--note, --force-n, --role or --flag"),
        (["edit", "1", "--press", "abcd", "--flag", "none", "--flag", "x", *STORE], "--flag must be only none"),
        (["edit", "1", "--truth", "none", "--truth", "a=1", *STORE], "--truth must be only none"),
        (["edit", "1", "--force-n", "0.5", *STORE], "need --press"),
        (["edit", "1", "--name", "x", "--press", "abcd", *STORE], "belong to the target"),
        (["edit", "1", "--press", "zzzz", "--note", "x", *STORE], "'zzzz' fits 0"),
        (["edit", "1", "--press", "", "--note", "x", *STORE], "4 or more letters"),
        (["edit", "1", "--name", "\x1b[2J", *STORE], "must be printable text"),
        (["edit", "1", "--truth", "big", *STORE], "must be a name and a number"),
        (
            ["edit", "1", "--truth", "a=1", "--truth", "a = 2", *STORE],
            "--truth must give each name once; got 'a' twice",
        ),
        (["edit", "1", "--truth", "diameter=10", *STORE], "with its unit; got 'diameter=10' (write diameter_mm=10)"),
        (["edit", "1", "--press", "abcd", "--force-n", "much", *STORE], "must be a number of newtons, or none"),
        (["edit", "1", "--press", "abcd", "--force-n", "nan", *STORE], "--force-n must lie in"),
        (["export", "1", "--format", "docx", *STORE], "no form of export is called 'docx'"),
        (["export", "1", "--format", "pdf", "--out", "notes.txt", *STORE], "must be a new name; there is such a file"),
        (["export", "1", "--format", "pdf,csv", "--out", "no-store", *STORE], "must be a new name"),
        (["export", "1", "--format", "csv", "--out", "notes.txt/below", *STORE], "notes.txt"),
        (["export", "1", "--format", "html", "--identified", *STORE], "--identified belongs to dicom"),
        (["export", "77", "--format", "html", *STORE], "got 77"),
        (["export", "1", *STORE], "--format"),
        (["import", "absent", *STORE], "absent"),
        (["import", "a" * 5000, *STORE], "must name a file or folder; got: File name too long"),
        (["import", "no-store", *STORE], "must be a folder that tsis wrote"),
        (["import", "notes.txt", *STORE], "must be a PNG, JPEG, BMP or TIFF file"),
        (["import", "notes.txt", "--target", "1.5", *STORE], "--target must be a number from 1 to 99999, or new"),
        (["import", "notes.txt", "--target", "0", *STORE], "--target must lie in"),
        (["import", "notes.txt", "--role", "palin", *STORE], "did you mean 'plain'"),
        (["import", "notes.txt", "--scale-mm", "wide", *STORE], "--scale-mm"),
        (["import", "notes.txt", "--taken", "noon", *STORE], "--taken"),
        (["import", "notes.txt", "--calibration", "notes.txt", *STORE], "notes.txt"),
        (["import", *STORE], "paths"),
    ],
)
def test_wrong_input_is_one_sentence_and_changes_nothing(
    run_tsis: RunTsis, tmp_path: Path, records: Path, arguments: list[str], sentence: str
) -> None:
    (tmp_path / "notes.txt").write_text("no picture")
    (tmp_path / "no-store").mkdir()
    (tmp_path / "garbage").mkdir()
    (tmp_path / "garbage" / "records.sqlite3").write_bytes(b"this is no database" * 100)
    finished = run_tsis("records", *arguments)
    assert finished.code == next((code for text, code in OTHER_CODES.items() if text in sentence), 2), finished.out
    assert sentence.lower() in finished.err.lower()
    assert "secret" not in finished.err
    assert finished.err.count("\n") == 1
    with open_store(records) as store:
        assert [(each.presses, each.estimates) for each in store.targets()] == [(2, 1), (5, 0)]


@pytest.mark.usefixtures("records")
def test_the_database_may_stand_in_the_environment(run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TSIS_RECORDS_DATABASE", "mysql://me:secret@host/base")
    finished = run_tsis("records", "list", *STORE)
    assert finished.code == 1
    assert "must be PostgreSQL" in finished.err
    assert "secret" not in finished.err


def test_a_full_disk_is_one_sentence_and_what_was_stored_stays(
    run_tsis: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in range(3):
        save(tmp_path, number)
    written, whole = [], Disk.write

    def full(self: Disk, file: Any, content: bytes) -> None:
        if content.startswith(b"\x89PNG"):
            written.append(file)
            if len(written) > 1:
                raise OSError(28, "No space left on device")
        whole(self, file, content)

    monkeypatch.setattr(Disk, "write", full)
    finished = run_tsis("records", "import", "Target3", *STORE)
    assert finished.code == 1
    assert "No space left on device" in finished.err
    assert "1 of 3 presses are stored and stay" in finished.err
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    result = json.loads(run_tsis("records", "import", "Target3", *STORE, "--json").out)["imported"]
    assert [(each["added"], each["present"]) for each in result] == [(2, 1)]


def test_ctrl_c_in_an_import_says_what_is_stored(
    run_tsis: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in range(3):
        save(tmp_path, number)
    whole, stored = Store.add_press, list[Any]()

    def interrupted(self: Store, *arguments: Any, **options: Any) -> Any:
        if stored:
            raise KeyboardInterrupt
        stored.append(whole(self, *arguments, **options))
        return stored[0]

    monkeypatch.setattr(Store, "add_press", interrupted)
    finished = run_tsis("records", "import", "Target3", *STORE)
    assert finished.code == 130
    assert "1 of 3 presses are stored and stay (the same import goes on from there)" in finished.err
    assert "Traceback" not in finished.err
    with open_store(tmp_path / "records") as store:
        assert verify_store(store).sound


def test_calibrations_that_snapshots_cite_open_the_store_once(
    run_tsis: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    importing: Any = sys.modules["tsis.cli.records"]
    known = sample_calibration()
    for number in range(4):
        save(tmp_path, number, calibration={"name": "bench", "sha256": calibration_sha256(known)})
    absent = json.loads(run_tsis("records", "import", "Target3", "--store", "fresh", "--json").out)["imported"]
    assert "is not in this store" in absent[0]["notes"][0]
    with open_store(tmp_path / "records") as store:
        store.add_press(store.add_target(number=9), TactileImage(grey=levels(0)), taken=WHEN, calibration=known)
    opens, opened = list[Any](), importing.opened

    def counted(*chosen: Any, **how: Any) -> Any:
        opens.append(chosen)
        return opened(*chosen, **how)

    monkeypatch.setattr(importing, "opened", counted)
    result = json.loads(run_tsis("records", "import", "Target3", *STORE, "--json").out)["imported"]
    assert (result[0]["added"], result[0]["notes"]) == (4, [])
    assert len(opens) == 2  # to look calibrations up, and to store
    for path in (tmp_path / "records" / "files").glob("*/*.json"):
        path.write_bytes(path.read_bytes()[:-3])
    damaged = run_tsis("records", "import", "Target3", *STORE)
    assert damaged.code == 1
    assert "does not match its name" in damaged.err


@pytest.mark.system
def test_the_program_starts_without_the_stores_libraries() -> None:
    code = (
        "import sys, tsis.cli; heavy = ('sqlalchemy', 'reportlab', 'pydicom', 'xarray', 'h5py', 'zarr'); "
        "print([name for name in heavy if name in sys.modules])"
    )
    finished = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert finished.stdout.strip() == "[]"


@pytest.mark.usefixtures("records")
def test_several_forms_appear_together_or_not_at_all(
    run_tsis: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tsis.errors import MissingExtraError
    from tsis.present.records import write_form as whole

    def without_an_extra(form: str, *arguments: Any, **options: Any) -> Any:
        if form == "netcdf":
            raise MissingExtraError("netCDF export needs h5netcdf, which is not installed")
        return whole(form, *arguments, **options)

    monkeypatch.setattr("tsis.present.records.write_form", without_an_extra)
    finished = run_tsis("records", "export", "1", "--format", "html,netcdf", "--out", "given", *STORE)
    assert finished.code == 2
    assert "needs h5netcdf" in finished.err
    assert {path.name for path in tmp_path.iterdir()} == {"records"}


@pytest.mark.usefixtures("records")
def test_a_single_form_gets_a_name_of_its_own(run_tsis: RunTsis, tmp_path: Path) -> None:
    for form, name in (("html", "target-2.html"), ("csv", "target-2-csv"), ("bundle", "target-2.zip")):
        result = json.loads(run_tsis("records", "export", "2", "--format", form, *STORE, "--json").out)
        assert result["files"] == {form: str(tmp_path / name)}
        assert (tmp_path / name).exists()
        assert run_tsis("records", "export", "2", "--format", form, *STORE).code == 2


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
