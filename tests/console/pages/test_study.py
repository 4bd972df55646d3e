"""Study: a blind study made, read, verified and unblinded on its pages; what cannot be undone is checked first."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from nicegui import ui
from tests.console.pages.simulated import at_console
from tests.study.made import HEADINGS, made_study, table
from tests.waiting import HANGS_S

from tsis.console.pages.study import StudyDraft
from tsis.errors import InputError
from tsis.study.folder import new_study, open_study, printed_targets
from tsis.study.readings import import_table

if TYPE_CHECKING:
    from pathlib import Path

    from tests.console.pages.simulated import Operator

    from tsis.console.services.instrument import Instrument
    from tsis.study.folder import Study


@pytest.mark.parametrize("typed", ["-1", "1e9", "1e999", "2.5", "", "x"])
def test_a_count_that_no_study_can_have_has_no_size(typed: str) -> None:
    for field, label in (("present", "targets with an inclusion"), ("blank", "blanks")):
        with pytest.raises(InputError, match=f"^{label} must "):
            StudyDraft(**dict[str, Any]({field: typed})).size()


def test_readings_and_presses_are_counted() -> None:
    size = replace(StudyDraft(), present="6", blank="2", repeats="3", forces="0.5, 1").size()
    assert (size.readings, size.presses) == (24, 96)
    size = replace(StudyDraft(), present="100000", blank="0", forces="1", with_reference=False).size()
    assert (size.readings, size.presses) == (100_000, 100_000)


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


TRUTH = ("detection-", "blank-", "printed")


async def imports(operator: Operator, content: str, *, device: str, threshold: str = "0.5") -> None:
    if "Entered by" not in operator.texts:
        await operator.clicks("Import readings")
    await operator.types("Device", device)
    await operator.types("Threshold", threshold)
    await operator.types("Entered by", "Ada")
    await operator.uploads("CSV file of readings", "r.csv", content.encode())


def test_a_study_is_made_from_the_form_and_wrong_fields_make_none(lit: Instrument) -> None:
    folder = lit.terms.workspace / "studies"

    async def script(operator: Operator) -> None:
        await operator.sees("No study yet.")
        fields = {"Name": "trial", "With an inclusion": "2", "Blanks": "3", "Forces": "1", "Seed": "3"}
        for name, text in fields.items():
            await operator.types(name, text)
        await operator.types("Made by", "Ben")
        for field, typed, message in (
            ("Name", "", "Name must be"),
            ("Name", "../other", "Name must be"),
            (
                "With an inclusion",
                "two",
                "Targets with an inclusion must be a number, as 2 or 0.5 (you",
            ),
            ("With an inclusion", "2.5", "Targets with an inclusion must be a whole number (you entered 2.5)."),
            ("Blanks", "-1", "Blanks must be 0–"),
            ("Forces", "0,8", "Force"),
            ("Threshold", "high", "Threshold must be a number, as 2 or 0.5 (you entered 'high')."),
            ("Repeats", "0", "Repeats must be 1–1000 (you entered 0)."),
            ("Seed", "-3", "Seed must be 0–"),
        ):
            before = operator.field(field)
            await operator.types(field, typed)
            await operator.clicks("Create the study")
            await operator.beside(field, message)
            await operator.types(field, before)
        assert not folder.exists() or list(folder.iterdir()) == []
        await operator.clicks("Create the study")
        await operator.sees("Study trial", "No readings yet.", "blinded")
        plan = open_study(folder / "trial").plan
        await operator.until(
            lambda: operator.rows == [(str(at), code, "left") for at, code in enumerate(plan.codes, 1)], "other codes"
        )
        assert (len(plan.codes), plan.forces_n, plan.seed) == (5, (1.0,), 3)
        assert not any(word in text for word in TRUTH for text in operator.texts)
        await operator.clicks("All studies")
        await operator.sees("trial", "blinded")

    at_console(lit, script, "/study")


def test_readings_are_imported_whole_or_not_at_all_and_exported_again(lit: Instrument, study: Study) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("Study trial")
        content = table(study)
        for damaged, device, threshold, message in (
            (HEADINGS + "\nnobody,0.5,Cleo,1,,,\n", "palpation", "0.5", "nobody"),
            (content.replace("score", "value", 1), "palpation", "0.5", "score"),
            ("", "palpation", "0.5", "r.csv"),
        ):
            await imports(operator, damaged, device=device, threshold=threshold)
            await operator.hears(message)
            assert open_study(study.folder).readings == ()
        for device, threshold, field in (("", "0.5", "Device"), ("palpation", "low", "Threshold")):
            await imports(operator, content, device=device, threshold=threshold)
            await operator.beside(field, f"{field} must be")
        await imports(operator, content, device="palpation")
        await operator.hears("4 readings entered.")
        await operator.sees("palpation", "threshold 0.5", "Cleo: 4 of 4 read")
        await operator.until(lambda: {row[-1] for row in operator.rows} == {"read"}, "not all are read")
        await operator.clicks("Export readings of palpation")
        response = await operator.user.download.next(timeout=HANGS_S)
        assert sorted(line.split(",")[:3] for line in response.text.split()) == sorted(
            line.split(",")[:3] for line in content.split()
        )

    at_console(lit, script, "/study/trial")


def test_it_is_verified_against_its_log_and_a_head_from_elsewhere(lit: Instrument, study: Study) -> None:
    head = study.chain.head

    async def script(operator: Operator) -> None:
        await operator.sees("Study trial", head[:16])
        await operator.clicks("Verify")
        await operator.sees("The study is unchanged, all 1 line of its log.", f"Head of the log: {head}")
        await operator.types("Log head saved elsewhere", "0" * 12)
        await operator.clicks("Compare")
        await operator.sees("The study was CHANGED: it differs in 1 place.")
        await operator.types("Log head saved elsewhere", head)
        await operator.clicks("Compare")
        await operator.sees("The study is unchanged")
        await operator.clicks("Close")
        await operator.misses("Head of the log: ")
        log = study.folder / "log.jsonl"
        log.write_bytes(log.read_bytes().replace(b"maker", b"faker"))
        await operator.clicks("Verify")
        await operator.sees("The study was CHANGED")

    at_console(lit, script, "/study/trial")


def test_it_is_unblinded_once_with_readings_and_then_shows_the_truth(lit: Instrument, study: Study) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("Study trial")
        await operator.clicks("Unblind and analyse")
        await operator.sees("This opens the seal:", "The study has 0 readings.")
        await operator.types("Done by", "Ada")
        await operator.clicks("Unblind and analyse")
        await operator.hears("a study must have a reading before it is unblinded")
        await operator.clicks("Cancel")
        whole = table(study)
        await imports(operator, "\n".join(whole.splitlines()[:-1]) + "\n", device="palpation")
        await operator.hears("3 readings entered.")
        await operator.clicks("Unblind and analyse")
        await operator.sees("palpation has not read 1 of 4 targets.")
        await operator.types("Done by", "Ada")
        await operator.clicks("Unblind and analyse")
        await operator.hears("even if incomplete")
        await operator.clicks("even if incomplete")
        await operator.clicks("Unblind and analyse")
        await operator.sees("Results of the study", "Analyse again")
        await operator.sees("Report", "Notes")
        opened = open_study(study.folder)
        assert opened.unblinded is not None
        await operator.until(lambda: "code" not in operator.rows[0], "no truth is shown")
        truth = {row[1]: " ".join(row) for row in operator.rows}
        assert set(truth) == set(study.plan.codes)
        assert not any(name == "Import readings" for name in operator.named("Import"))
        page = await operator.http.get("/files/study/trial/report.html")
        assert page.status_code == 200

    at_console(lit, script, "/study/trial")


@pytest.mark.parametrize("name", ["nobody", "tr%C3%A4um"])
def test_a_study_that_is_not_there_is_said(lit: Instrument, name: str) -> None:
    async def script(operator: Operator) -> None:
        await operator.until(lambda: bool(operator.alerts), "no refusal is shown")
        assert "Unblind and analyse" not in operator.texts

    at_console(lit, script, f"/study/{name}")


def test_a_damaged_study_is_listed_with_what_is_wrong(lit: Instrument, study: Study) -> None:
    (study.folder / "study.json").write_text("{}")

    async def script(operator: Operator) -> None:
        await operator.sees("trial", "study.json")

    at_console(lit, script, "/study")


def test_the_virtual_probe_reads_for_a_named_operator_only(lit: Instrument, study: Study) -> None:
    async def script(operator: Operator) -> None:
        await operator.sees("Study trial")
        await operator.types("Operator", " ")
        await operator.clicks("Run on the virtual probe", ui.button)
        await operator.beside("Operator", "Operator must be 1 to")
        assert open_study(study.folder).readings == ()

    at_console(lit, script, "/study/trial")
