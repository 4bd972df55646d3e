"""Study: what cannot be taken back is checked where it is typed, and the operator keeps their name."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from nicegui import ui
from tests.console.pages.simulated import at_console
from tests.study.made import made_study, table

from tsis.errors import InputError
from tsis.study.folder import new_study, open_study, printed_targets
from tsis.study.readings import import_table

if TYPE_CHECKING:
    from pathlib import Path

    from tests.console.pages.simulated import Operator

    from tsis.console.services.instrument import Instrument
    from tsis.study.folder import Study


@pytest.fixture
def study(lit: Instrument) -> Study:
    (lit.terms.workspace / "studies").mkdir(parents=True)
    return made_study(lit.terms.workspace / "studies" / "trial", present=2, blank=2)


@pytest.mark.parametrize("threshold", [2.0, -0.1])
def test_a_threshold_that_is_no_probability_makes_no_study(lit: Instrument, tmp_path: Path, threshold: float) -> None:
    async def script(operator: Operator) -> None:
        await operator.types("Name", "trial")
        await operator.types("Made by", "Ada")
        await operator.types("Threshold", str(threshold))
        await operator.clicks("Create the study")
        await operator.beside("Threshold", "Threshold must be 0–1")
        assert not (lit.terms.workspace / "studies").exists()

    at_console(lit, script, "/study")
    with pytest.raises(InputError, match="threshold must lie in"):
        new_study(tmp_path / "s", printed_targets(1, 1), threshold=threshold)


def test_nobody_is_called_browser_and_a_typed_name_stays(lit: Instrument, study: Study) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("Study trial")
        assert operator.field("Operator") == ""  # of a browser that knows no name
        await operator.clicks("Run on the virtual probe", ui.button)
        await operator.beside("Operator", "Operator must be 1 to")
        operator.presses_key("operator", "Ada")  # which the browser kept
        await operator.until(lambda: operator.field("Operator") == "Ada", "the kept name is not used")
        operator.presses_key("operator", "Mallory")  # a name that is used already stays
        await operator.clicks("Import readings")
        assert operator.field("Entered by") == "Ada"
        await operator.types("Device", "feeler")
        await operator.types("Threshold", "0.5")
        await operator.types("Entered by", "Ben")
        await operator.uploads("CSV file of readings", "r.csv", table(study).encode())
        await operator.hears("4 readings entered.")
        await operator.until(lambda: operator.field("Operator") == "Ben", "the typed name is not kept")

    at_console(lit, script, "/study/trial")
    actors = {entry.actor for entry in open_study(study.folder).chain.entries}
    assert actors == {"maker", "Ben"}


def test_a_large_study_is_confirmed_and_shown_by_the_sheet(lit: Instrument) -> None:
    many = 1200

    async def script(operator: Operator) -> None:
        for name, text in {"Name": "large", "Made by": "Ada", "With an inclusion": str(many), "Blanks": "0"}.items():
            await operator.types(name, text)
        await operator.sees(f"It has {many:,} readings, {4 * many:,} presses: about ")
        await operator.clicks("Create the study")
        await operator.sees("A large study")
        assert not (lit.terms.workspace / "studies").exists()
        await operator.clicks(f"Make {many:,} readings")
        await operator.sees("Study large")
        await operator.until(lambda: len(operator.rows) == 20, "more than a sheet is in the browser")
        codes = open_study(lit.terms.workspace / "studies" / "large").plan.codes
        operator.orders(page=many // 200, rowsPerPage=200)
        await operator.until(lambda: len(operator.rows) == 200, "no larger sheet")
        assert operator.rows[-1] == (str(many), codes[-1], "left")

    at_console(lit, script, "/study")


def test_an_open_unblinding_tells_of_the_study_as_it_is_now(lit: Instrument, study: Study) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("Study trial")
        await operator.clicks("Unblind and analyse")
        await operator.sees("The study has 0 readings.")
        await operator.types("Done by", "Ada")
        import_table(study, table(study).encode(), "r.csv", device="feeler", threshold=0.5, actor="Ben")
        await operator.sees("The study has 4 readings.")
        assert operator.field("Done by") == "Ada"

    at_console(lit, script, "/study/trial")
