"""An operator is led on: what a page offers can be done, and what was done is found again."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from nicegui import ui
from tests.console.pages.simulated import at_console
from tests.console.services.instruments import ANN
from tests.records.sample import sample_record
from tests.waiting import HANGS_S

from tsis.calibration.file import calibration_sha256
from tsis.errors import InputError
from tsis.records.reader import DELETED
from tsis.records.store import verify_store

if TYPE_CHECKING:
    from tests.console.pages.simulated import Operator

    from tsis.console.services.instrument import Instrument


def test_a_snapshot_that_is_asked_for_while_one_is_saved_is_saved_too(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.clicks("Start")
        await operator.sees("aravis:lit: ")
        for _ in range(3):
            operator.presses_key("snapshot")
        await operator.sees("3 presses")

    at_console(lit, script)


def test_messages_of_the_start_are_closed_without_a_start_of_the_camera(lit: Instrument) -> None:
    lit._notices = ("The console was not shut down properly.", "Calibration 'bench' is active again.")

    async def script(operator: Operator) -> None:
        await operator.sees("The console was not shut down properly.", "is active again.")
        await operator.clicks("Close: The console was not shut down properly.", ui.button)
        await operator.misses("not shut down properly")
        await operator.sees("is active again.")
        await operator.clicks("Close: Calibration 'bench' is active again.", ui.button)
        await operator.misses("is active again")

    at_console(lit, script, "/records")


def test_a_snapshot_has_the_force_that_was_typed_just_before(lit: Instrument) -> None:
    async def script(operator: Operator) -> None:
        await operator.clicks("Start")
        await operator.sees("aravis:lit: ")
        await operator.types("Force", "0.7", enter=False)
        operator.presses_key("snapshot")  # Space in the field, which takes no blank
        await operator.hears("Saved for target 1: on the target, 0.7 N")

    at_console(lit, script)


def test_a_deleted_target_offers_no_change_but_its_return(lit: Instrument) -> None:
    target = lit.store.import_target(sample_record()).target
    lit.store.set_state(target, DELETED)

    async def script(operator: Operator) -> None:
        await operator.sees("Deleted on")
        for change in ("Estimate", "Repeat the estimates", "Edit"):
            assert not operator.enabled(change)
        await operator.clicks("Restore", ui.button)
        await operator.misses("Deleted on")
        assert operator.enabled("Estimate")

    at_console(lit, script, f"/records/{target.number}")


def test_presses_that_were_saved_without_a_calibration_are_given_one_later(lit: Instrument) -> None:
    record = sample_record()
    target = lit.store.add_target(number=8)
    calibration = next(iter(record.calibrations.values()))
    image = replace(record.image(record.presses[0]), mm_per_pixel=None)
    bare = lit.store.add_press(target, image, taken=record.presses[0].taken)
    known = lit.store.calibrate_press(bare, calibration)
    assert known.calibration == calibration_sha256(calibration)
    assert lit.store.press(target, bare.id) == known
    assert set(lit.store.record(target).calibrations) == {known.calibration}
    assert verify_store(lit.store).sound
    with pytest.raises(InputError, match="must have no calibration"):
        lit.store.calibrate_press(known, calibration)


def test_a_sequence_of_a_target_without_a_snapshot_is_found_on_its_page(lit: Instrument) -> None:
    lit.control.take(ANN, "Ann")
    lit.set_target(12, by=ANN)
    lit.start(by=ANN)
    job = lit.begin_sequence(frames=3, by=ANN)
    assert job.wait(HANGS_S)
    lit.control.release(ANN)

    async def script(operator: Operator) -> None:
        await operator.sees("Target 12", "sequence", "3")
        await operator.clicks("Play sequence")
        await operator.sees("Frame 1 of 3")

    at_console(lit, script, "/records/12")


def test_the_list_has_results_notes_and_tags_and_is_saved_as_a_table(lit: Instrument) -> None:
    target = lit.store.import_target(sample_record()).target
    lit.store.edit_target(lit.store.target(target.number), note="second day #pilot")

    async def script(operator: Operator) -> None:
        await operator.sees("1 target (phantoms)")  # the table is there with it
        await operator.until(lambda: bool(operator.rows), "no row")
        (row,) = operator.rows
        (current,) = (await operator.requested(f"/targets/{target.number}/estimates"))["estimates"]
        mean = current["parameters"]["diameter_mm"]["mean"]
        assert f"Diameter d {mean:.3g} mm" in row[5]
        assert row[6] == "second day #pilot"
        await operator.types("Search number, name, note or #tag", "#pilot")
        await operator.until(lambda: len(operator.rows) == 1, "a tag is not found")
        await operator.types("Search number, name, note or #tag", "#other")
        await operator.until(lambda: not operator.rows, "another tag is found")
        answer = (await operator.http.get("/files/targets.csv")).raise_for_status().text.splitlines()
        assert answer[0].startswith("target,kind,name,tags,note,estimate")
        assert len(answer) == 2
        assert ",pilot,second day #pilot,inclusion," in answer[1]

    at_console(lit, script, "/records")


def test_each_name_on_a_target_s_page_stands_for_one_thing(lit: Instrument) -> None:
    target = lit.store.import_target(sample_record()).target

    async def script(operator: Operator) -> None:
        await operator.sees("Current estimates")
        for name in ("Report", "Estimate", "Compare with a target", "Repeat the estimates"):
            assert operator.named(name).count(name) == 1, operator.named(name)
        for other in ("Recompute", "Compare two"):
            assert operator.named(other) == []

    at_console(lit, script, f"/records/{target.number}")
