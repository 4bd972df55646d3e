"""An operator is led on: what a page offers can be done, and what was done is found again."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui
from tests.console.pages.simulated import at_console
from tests.records.sample import sample_record

from tsis.records.reader import DELETED

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
