"""Records: what pages show, order, change and refuse, beside what the store and its files hold."""

from __future__ import annotations

import json
import re
import shutil
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.console.filled_store import ESTIMATED, HARD, MANY, PRESSES, fill
from tests.console.pages.simulated import at_console
from tests.console.services.instruments import lit_instrument
from tests.records.pressed_object import stored_object
from tests.records.sample import sample_record

from tsis.console.pages import records
from tsis.console.pages.records import (
    AT_ONCE,
    KINDS,
    NOT_ESTIMATED,
    SHEETS,
    UNKNOWN_FLAG,
    Order,
    flags_of,
    read_target,
    sheet_of,
)
from tsis.console.pages.target import changed, edit_press, edit_target, truth_text
from tsis.errors import InputError
from tsis.model.image import TactileImage
from tsis.records.reader import TargetState, TargetSummary
from tsis.records.store import open_store, verify_store
from tsis.records.target import read_bundle, write_bundle
from tsis.records.values import Target, parse_force, parse_truth

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tests.console.pages.simulated import Operator

    from tsis.console.services.instrument import Instrument
    from tsis.records.store import Store


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a store of three targets, for tests to copy."""
    folder = tmp_path_factory.mktemp("filled") / "store"
    fill(folder)
    return folder


@pytest.fixture
def filled(store: Path, tmp_path: Path) -> Iterator[Instrument]:
    """An instrument with a store of its own of three targets."""
    shutil.copytree(store, tmp_path / "store")
    with lit_instrument(tmp_path) as created:
        yield created


def test_an_empty_store_says_how_to_begin(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("0 targets (phantoms), 0 presses", "Nothing is saved yet.")

    at_console(lit, script, "/records")


def test_the_list_is_searched_narrowed_and_ordered(filled: Instrument) -> None:
    async def numbers(operator: Operator, *expected: int) -> None:
        await operator.until(lambda: [int(row[0]) for row in operator.rows] == list(expected), f"not {expected}")

    async def script(operator: Operator) -> None:
        total = sum(item["presses"] for item in (await operator.requested("/targets"))["targets"])
        await operator.sees(f"3 targets (phantoms), {total} presses")
        await numbers(operator, ESTIMATED, MANY, HARD)
        await operator.types("Search number, name, note or #tag", "MANY")
        await numbers(operator, MANY)
        assert operator.rows[0][1:4] == ("many presses", str(PRESSES), "0")
        await operator.types("Search number, name, note or #tag", "nobody")
        await numbers(operator)
        await operator.types("Search number, name, note or #tag", "")
        await operator.chooses("Show", "not estimated")
        await numbers(operator, MANY)
        await operator.chooses("Show", "all")
        operator.orders(sortBy="presses", descending=True, page=1, rowsPerPage=25)
        await numbers(operator, MANY, ESTIMATED, HARD)
        operator.orders(sortBy=["presses"], descending="yes", page=-3, rowsPerPage=7)  # which no table asks for
        await numbers(operator, ESTIMATED, MANY, HARD)

    at_console(filled, script, "/records")


@pytest.mark.parametrize(("number", "message"), [("99", "99"), ("none", "none")])
def test_a_target_that_is_not_there_is_said(filled: Instrument, number: str, message: str) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("target must be ", f"got {message!r}" if message == "none" else f"got {message}")
        await operator.clicks("All targets")
        await operator.sees("3 targets")

    at_console(filled, script, f"/records/{number}")


def test_presses_come_a_sheet_at_a_time_and_two_are_compared(filled: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees(f"1 to 24 of {PRESSES}", "Compare presses (0 chosen)", "No estimate yet.")
        assert not operator.enabled("Earlier")
        saved = (await operator.requested(f"/targets/{MANY}/presses?limit=100"))["presses"]
        assert len(operator.named("Open the press ")) == 24
        for name in operator.named("Choose the press ")[:2]:
            await operator.clicks(name)
        await operator.sees("Compare presses (2 chosen)")
        await operator.clicks("Compare presses (2 chosen)")
        await operator.sees("match brightness", "centroid")
        await operator.clicks("Close the comparison")
        await operator.misses("match brightness")
        await operator.clicks("Later")
        await operator.sees(f"25 to {PRESSES} of {PRESSES}")
        assert not operator.enabled("Later")
        assert len(operator.named("Open the press ")) == PRESSES - 24
        assert len(saved) == PRESSES

    at_console(filled, script, f"/records/{MANY}")


def test_a_target_is_edited_and_wrong_values_are_refused(filled: Instrument) -> None:
    truth = "True values, one on a line: diameter_mm=10"

    async def script(operator: Operator) -> None:
        await operator.sees("Target 3: size-10", "true Diameter d", "10 mm")
        await operator.clicks("Edit")
        await operator.sees(f"Edit target {ESTIMATED}")
        assert operator.field("Name") == "size-10"
        for typed, message in (
            ("diameter_mm=wide", "wide"),
            ("diameter_mm", "diameter_mm"),
            ("depth_mm=-1", "depth_mm"),
        ):
            await operator.types(truth, typed, enter=False)
            await operator.clicks("Save")
            await operator.beside(truth, message)
        await operator.types(truth, "diameter_mm=11.5\n\ndepth_mm=5", enter=False)
        await operator.types("Name", "size 11.5")
        await operator.types("Note", "measured again", enter=False)
        await operator.clicks("Save")
        await operator.hears("Target 3 is version 2 now.")
        await operator.sees("Target 3: size 11.5", "11.5 mm", "measured again")
        stored = (await operator.requested(f"/targets/{ESTIMATED}"))["target"]
        assert (stored["name"], stored["note"]) == ("size 11.5", "measured again")
        assert stored["truth"] == {"diameter_mm": 11.5, "depth_mm": 5.0}

    at_console(filled, script, f"/records/{ESTIMATED}")


def test_of_two_editors_the_later_one_decides(filled: Instrument) -> None:
    async def conflict(operator: Operator, name: str) -> None:
        await operator.clicks("Edit")
        await operator.sees("Edit target 3")
        filled.store.edit_target(filled.store.target(ESTIMATED), name=name)
        await operator.types("Note", "mine", enter=False)
        await operator.clicks("Save")
        await operator.sees(f", is “{name}” now.", "Overwrite with mine")

    async def script(operator: Operator) -> None:
        await operator.sees("Target 3: size-10")
        await conflict(operator, "of another")
        await operator.clicks("Discard my changes")
        await operator.misses("Overwrite with mine")
        assert (operator.field("Name"), operator.field("Note")) == ("of another", "bench")
        await operator.clicks("Cancel")
        await operator.misses("Edit target 3")
        await operator.sees("Target 3: of another")
        await conflict(operator, "a third")
        await operator.clicks("Overwrite with mine")
        await operator.hears("Target 3 is version 4 now.")
        stored = (await operator.requested(f"/targets/{ESTIMATED}"))["target"]
        assert (stored["name"], stored["note"]) == ("of another", "mine")

    at_console(filled, script, f"/records/{ESTIMATED}")


def test_a_press_is_opened_and_its_force_corrected(filled: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("4 presses")
        (name,) = (item for item in operator.named("Open the press on the target, 0.7 N"))
        await operator.clicks(name)
        await operator.sees("frame", "150 × 96 px", "0.12 × 0.14 mm per pixel", "tsis-2011")
        for typed, message in (("hard", "Force must be a number"), ("-2", "Force must be 0–")):
            await operator.types("Force in newtons; empty if unknown", typed)
            await operator.clicks("Save")
            await operator.beside("Force in newtons; empty if unknown", message)
        await operator.types("Force in newtons; empty if unknown", "0.75")
        await operator.clicks("Save")
        await operator.hears("The press is version 2 now.")
        await operator.until(lambda: bool(operator.named("Open the press on the target, 0.75 N")), "the force is old")
        saved = (await operator.requested(f"/targets/{ESTIMATED}/presses"))["presses"]
        assert [press["force_n"] for press in saved] == [0.75, 1.0, 0.7, 1.0]

    at_console(filled, script, f"/records/{ESTIMATED}")


def test_a_hardness_is_recomputed_to_the_stored_number(filled: Instrument) -> None:
    async def script(operator: Operator) -> None:
        (before,) = (await operator.requested(f"/targets/{HARD}/estimates"))["estimates"]
        await operator.sees(f"{before['parameters']['young_kpa']['mean']:.3g} kPa")
        await operator.clicks("Repeat the estimates")
        await operator.sees("The current estimates are recomputed from the stored frames.")
        await operator.clicks("dry run: show changes, store nothing")
        await operator.clicks("Repeat")
        await operator.sees("Hardness: ")
        assert len((await operator.requested(f"/targets/{HARD}/estimates"))["estimates"]) == 1
        await operator.clicks("Close")
        await operator.misses("Hardness: ")

    at_console(filled, script, f"/records/{HARD}")


def test_an_estimate_of_presses_of_nothing_fails_in_one_sentence(filled: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("Nothing was estimated yet.")
        await operator.clicks("Estimate")
        await operator.sees("the newest press of each role and force")
        await operator.clicks("Estimate")
        await operator.until(lambda: bool(operator.alerts), "no failure is shown")
        (alert,) = operator.alerts
        assert "\n" not in alert
        assert "Traceback" not in alert

    at_console(filled, script, f"/records/{MANY}")


def test_a_bundle_is_imported_once_and_other_files_are_refused(lit: Instrument, tmp_path: Path) -> None:
    with open_store(tmp_path / "other") as other:
        target = other.import_target(sample_record()).target
        write_bundle(other.record(target), tmp_path / "bundle.zip")
    content = (tmp_path / "bundle.zip").read_bytes()

    async def script(operator: Operator) -> None:
        await operator.sees("Nothing is saved yet.")
        await operator.clicks("Import a bundle")
        await operator.sees("A bundle is the zip file that a target's export creates.")
        await operator.uploads("Zip file of a bundle", "b.zip", content[: len(content) // 2])
        await operator.until(lambda: bool(operator.alerts), "no refusal is shown")
        assert "bundle.zip" in operator.alerts[0]
        assert "tsis-import-" not in operator.alerts[0]  # the folder of the copy is nobody's business
        await operator.clicks("Import a bundle")
        await operator.uploads("Zip file of a bundle", "b.zip", content)
        await operator.sees("Open target 3", "1 target (phantoms), 4 presses")
        await operator.clicks("Import a bundle")
        await operator.uploads("Zip file of a bundle", "b.zip", content)
        await operator.sees("1 target (phantoms), 4 presses")
        await operator.clicks("Open target 3")
        await operator.sees("Target 3: size-10")

    at_console(lit, script, "/records")
    assert len(lit.store.targets()) == 1


def test_a_store_is_verified_and_a_changed_one_is_not_sound(filled: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("3 targets")
        await operator.clicks("Verify the store")
        await operator.sees("Close")
        sound = " ".join(operator.texts)
        await operator.clicks("Close")
        frame = max((filled.store.folder / "files").rglob("*.png"), key=lambda file: file.stat().st_size)
        frame.chmod(0o600)
        frame.write_bytes(frame.read_bytes()[:-1])
        await operator.clicks("Verify the store")
        await operator.sees(frame.stem[:16])
        assert frame.stem[:16] not in sound

    at_console(filled, script, "/records")


def test_an_export_is_fetched_by_the_browser_from_an_address_that_gives_it(filled: Instrument) -> None:
    async def script(operator: Operator) -> None:
        fetched: list[str] = []

        def fetch(found: re.Match[str]) -> str:
            fetched.append(json.loads(found[1]))
            return "" if len(fetched) > 1 else "the disk is full"

        operator.user.javascript_rules[re.compile(r"\s*const answer = await fetch\((.*?)\);")] = fetch
        await operator.sees("Target 3: size-10")
        await operator.clicks("Export")
        await operator.sees("Export target 3", "Not masked")
        await operator.clicks("Export")
        await operator.hears("the disk is full")
        await operator.chooses("Form", "Bundle: everything, for another store")
        await operator.clicks("Export")
        await operator.hears("Exported as bundle: the browser saves the file.")
        await operator.misses("Export target 3")
        assert fetched == ["/files/export/3/csv", "/files/export/3/bundle"]
        response = await operator.http.get(fetched[-1])
        (filled.terms.workspace / "b.zip").write_bytes(response.raise_for_status().content)

    filled.terms.workspace.mkdir(exist_ok=True)
    at_console(filled, script, f"/records/{ESTIMATED}")
    assert read_bundle(filled.terms.workspace / "b.zip").target.name == "size-10"


def test_the_export_is_of_the_chosen_rows_else_of_all_that_are_listed(filled: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("3 targets (phantoms)")
        await operator.until(lambda: len(operator.rows) == 3, "not listed")
        operator.chooses_rows(HARD, ESTIMATED)
        operator.orders(sortBy="presses", descending=True, page=1, rowsPerPage=25)
        await operator.types("Search number, name, note or #tag", "MANY")  # what is chosen stays so
        await operator.until(lambda: len(operator.rows) == 1, "not searched")
        await operator.clicks("Export the 2 chosen")
        await operator.sees("Export 2 targets")
        await operator.clicks("Cancel")
        operator.chooses_rows(HARD, ESTIMATED, chosen=False)
        await operator.clicks("Export the listed")
        await operator.sees(f"Export target {MANY}")

    at_console(filled, script, "/records")


def test_a_target_is_deleted_and_restored(filled: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.clicks("Delete")
        await operator.sees(f"Delete target {MANY}?", "The audit and study logs remain.")
        await operator.clicks("Cancel")
        assert filled.store.state(filled.store.target(MANY)) is None
        await operator.clicks("Delete")
        await operator.clicks("Delete")
        await operator.hears(f"Target {MANY} is deleted.")
        await operator.sees("It can be restored until")
        await operator.open("/records")
        await operator.sees("2 targets (phantoms)")
        await operator.until(lambda: [int(row[0]) for row in operator.rows] == [ESTIMATED, HARD], "listed still")
        await operator.chooses("Show", "deleted")
        await operator.until(lambda: [int(row[0]) for row in operator.rows] == [MANY], "not among the deleted")
        await operator.open(f"/records/{MANY}")
        await operator.clicks("Restore")
        await operator.hears(f"Target {MANY} is restored.")
        await operator.misses("It can be restored until")
        await operator.clicks("Archive")
        await operator.sees("it is hidden from the lists")

    at_console(filled, script, f"/records/{MANY}")
    state = filled.store.state(filled.store.target(MANY))
    assert state is not None
    assert state.name == "archived"


def test_a_store_is_backed_up_from_its_page(filled: Instrument, tmp_path: Path) -> None:
    async def script(operator: Operator) -> None:
        await operator.clicks("Back up")
        await operator.types("New folder (absolute path)", str(tmp_path / "backup"))
        await operator.clicks("Back up")
        await operator.sees(f"The backup is in {tmp_path / 'backup'}")
        await operator.clicks("Back up")
        await operator.types("New folder (absolute path)", "here")
        await operator.clicks("Back up")
        await operator.beside("New folder (absolute path)", "Folder must be a whole path")

    at_console(filled, script, "/records")
    with open_store(tmp_path / "backup", create=False) as copy:
        assert [item.target.number for item in copy.targets()] == [ESTIMATED, MANY, HARD]


def test_two_targets_are_compared(filled: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.clicks("Compare with a target")
        await operator.types("Number of the other target", "two")
        await operator.beside("Number of the other target", "Enter the number of the other target.")
        await operator.types("Number of the other target", f"{MANY}", enter=False)
        await operator.clicks("Compare")
        await operator.sees(f"Target {ESTIMATED}: size-10", f"Target {MANY}: many presses", "Current estimates")

    at_console(filled, script, f"/records/{ESTIMATED}")


BEGUN = datetime(2026, 1, 1, tzinfo=UTC)
COLUMNS = ("number", "name", "presses", "estimates", "last")


def summary(
    number: int, *, name: str = "", presses: int = 0, estimates: int = 0, day: int | None = None, state: str = ""
) -> TargetSummary:
    return TargetSummary(
        target=Target(number=number, kind="phantom", name=name, made=BEGUN, id=f"{number}"),
        presses=presses,
        estimates=estimates,
        last=None if day is None else BEGUN + timedelta(days=day),
        state=TargetState(name=state, since=BEGUN) if state else None,
    )


summaries = st.lists(
    st.builds(
        summary,
        st.integers(1, 99_999),
        name=st.sampled_from(["", "size-10", "Size-2", "ß", "hard 5"]),
        presses=st.integers(0, 4),
        estimates=st.integers(0, 2),
        day=st.none() | st.integers(0, 3),
        state=st.sampled_from(["", "", "archived", "deleted"]),
    ),
    max_size=120,
    unique_by=lambda item: item.target.number,
)


def value(item: TargetSummary, column: str) -> Any:
    return {
        "number": item.target.number,
        "name": item.target.name.casefold(),
        "presses": item.presses,
        "estimates": item.estimates,
        "last": (item.last is not None, item.last or BEGUN),
    }[column]


@given(result=summaries, column=st.sampled_from(COLUMNS), descending=st.booleans(), kind=st.sampled_from(KINDS))
def test_all_sheets_together_are_the_sorted_list(
    result: list[TargetSummary], column: str, descending: bool, kind: str
) -> None:
    order = Order(column=column, descending=descending, kind=kind, rows=SHEETS[0])
    first = sheet_of(result, order)
    sheets = -(-first.total // SHEETS[0])
    shown = [
        item
        for number in range(1, sheets + 1)
        for item in sheet_of(
            result, Order(column=column, descending=descending, kind=kind, rows=SHEETS[0], sheet=number)
        ).targets
    ]
    present = [item for item in result if item.state is None]
    expected = {
        "all": present,
        "estimated": [item for item in present if item.estimates > 0],
        "not estimated": [item for item in present if item.estimates == 0],
        "archived": [item for item in result if item.state is not None and item.state.name == "archived"],
        "deleted": [item for item in result if item.state is not None and item.state.name == "deleted"],
    }[kind]
    assert len(shown) == len(expected)
    assert {item.target.number for item in shown} == {item.target.number for item in expected}
    pairs = list(pairwise(shown))
    assert all(
        (value(b, column) <= value(a, column)) if descending else (value(a, column) <= value(b, column))
        for a, b in pairs
    )
    assert all(a.target.number < b.target.number for a, b in pairs if value(a, column) == value(b, column))


@pytest.mark.parametrize(
    ("search", "numbers"),
    [("", [1, 2, 12]), ("1", [1, 12]), ("SIZE", [2]), (" size ", [2]), ("ss", [12]), ("3", []), ("2", [2])],
)
def test_a_search_finds_parts_of_names_and_beginnings_of_numbers(search: str, numbers: list[int]) -> None:
    result = [summary(12, name="straße"), summary(2, name="Size"), summary(1)]
    assert [item.target.number for item in sheet_of(result, Order(search=search)).targets] == numbers


def test_a_sheet_behind_the_last_is_the_last() -> None:
    result = [summary(number, estimates=number % 2) for number in range(1, 61)]
    last = sheet_of(result, Order(sheet=9, rows=25))
    assert ([item.target.number for item in last.targets], last.sheet, last.total) == (list(range(51, 61)), 3, 60)
    assert sheet_of([], Order(sheet=5)).sheet == 1
    assert sheet_of(result, Order(kind=NOT_ESTIMATED)).total == 30


@given(
    st.dictionaries(
        st.sampled_from(["sortBy", "descending", "page", "rowsPerPage", "other"]),
        st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.lists(st.integers()),
    ),
    st.text(),
)
def test_whatever_a_browser_sends_is_an_order(pagination: dict[str, Any], kind: str) -> None:
    order = Order.requested(pagination, search="", kind=kind)
    assert order.column in COLUMNS
    assert order.rows in SHEETS
    assert order.kind in KINDS
    assert len(sheet_of([summary(1)], order).targets) == (0 if order.kind == records.ESTIMATED else 1)


@pytest.fixture
def edited(tmp_path: Path) -> Iterator[Store]:
    with open_store(tmp_path / "store") as opened:
        opened.import_target(sample_record())
        yield opened


def test_the_slower_of_two_is_told_what_the_faster_changed(edited: Store) -> None:
    mine = theirs = edited.target(3)
    edited.edit_target(theirs, name="theirs", truth={"depth_mm": 6.0})
    result = edit_target(edited, mine, {"name": "mine"})
    assert "somebody else has changed it" in result.refused
    assert result.differences == (
        "Name: was “size-10”, is “theirs” now.",
        "Truth: was “depth_mm=5, diameter_mm=10, young_kpa=80”, is “depth_mm=6” now.",
    )
    assert result.record == edited.target(3)
    again = edit_target(edited, result.record, {"name": "mine"})
    assert (again.refused, again.record.name, again.record.version) == ("", "mine", 3)
    assert verify_store(edited).sound


def test_a_press_that_was_changed_meanwhile_is_not_written_over(edited: Store) -> None:
    target = edited.target(3)
    press = edited.press(target, "press-1")
    edited.edit_press(press, force_n=None, flags=())
    result = edit_press(edited, target, press, {"force_n": 1.5})
    assert result.differences == ("Force: was “1 N”, is not measured now.", "Flags: was “moving”, is empty now.")
    assert edited.press(target, "press-1").force_n is None


def test_only_what_differs_is_a_change(edited: Store) -> None:
    target = edited.target(3)
    assert changed(target, {"name": "size-10", "note": "new", "truth": dict(target.truth)}) == {"note": "new"}


def test_truth_as_text_is_read_back_as_it_was() -> None:
    truth = {"diameter_mm": 10.0, "depth_mm": 4.25, "young_kpa": 100 / 3, "other": -1e-7}
    assert parse_truth(truth_text(truth).splitlines()) == truth


@pytest.mark.parametrize("text", ["half", "1,5", "0x1", "--", "1 N"])
def test_a_force_that_is_no_number_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="force must be a number of newtons, or nothing; got"):
        parse_force(text, called="force", nothing="")


@pytest.mark.parametrize("text", ["nan", "inf", "-1", "101", "1e400"])
def test_a_force_outside_its_range_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="force must"):
        parse_force(text, called="force", nothing="")


def test_a_page_of_a_target_is_a_sheet_of_its_presses(edited: Store) -> None:
    target = edited.target(3)
    first = edited.press(target, "press-0")
    image = TactileImage(grey=edited.levels(first.frame).astype(float), full_scale=255.0)
    for _ in range(AT_ONCE):
        edited.add_press(target, image, taken=first.taken)
    observed = read_target(edited, "3", 10**9)
    assert (observed.total, observed.offset, len(observed.presses)) == (AT_ONCE + 4, AT_ONCE, 4)
    assert [press.id for press in observed.presses] == [press.id for press in edited.presses(target)[AT_ONCE:]]
    assert observed.record.estimates[0].id == "estimate-a"


def test_a_page_of_a_target_tells_what_was_edited_since_its_estimate(tmp_path: Path) -> None:
    with open_store(tmp_path / "store") as opened:
        target = stored_object(opened)
        before = read_target(opened, "1", 0)
        opened.edit_press(opened.presses(target)[1], force_n=1.4)
        observed = read_target(opened, "1", 0)
    assert before.stale == ()
    assert observed.stale == (
        "The presses have changed since the hardness was estimated: force_n 1.2 -> 1.4 of press 2; make it again with "
        "tsis records recompute 1.",
    )
    assert observed.fingerprint != before.fingerprint


def test_of_a_subject_pages_show_the_pseudonym_and_known_flags(tmp_path: Path) -> None:
    target_record = sample_record(kind="subject")
    with open_store(tmp_path / "subjects", kind="subject") as edited:
        edited.import_target(target_record)
        target = edited.target(3)
        edited.edit_target(target, note="Jane Doe")
        edited.edit_press(edited.press(target, "press-1"), flags=("moving", "Jane Doe"))
        observed = read_target(edited, "3", 0)
        flagged = edited.press(observed.target, "press-1")
    assert observed.private
    assert (observed.record.target.name, observed.record.target.note) == ("size-10", "")
    assert flags_of(flagged, private=True) == ("moving", UNKNOWN_FLAG)
    assert flags_of(flagged, private=False) == ("moving", "Jane Doe")
    assert [estimate.id for estimate in observed.record.estimates] == ["estimate 1"]
