"""``tsis records``: what it prints, what it changes, and what it says of wrong input."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from datetime import timedelta
from typing import TYPE_CHECKING, Any

import pytest
from tests.records.dicom.variants import hardness, with_estimate
from tests.records.importing.snapshot_folder import save
from tests.records.pressed_object import pressed, stored_object
from tests.records.sample import WHEN, levels, sample_calibration, sample_record

import tsis.hardness
from tsis.calibration.file import calibration_sha256
from tsis.files.atomic import Disk
from tsis.model.image import TactileImage
from tsis.present.records import ENDINGS
from tsis.records.store import Store, open_store, verify_store

if TYPE_CHECKING:
    from pathlib import Path

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
        (["recompute", "2", *STORE], "target 2 must have an estimate to be made again"),
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
