from __future__ import annotations

import csv
import io
import json
import re
import shutil
from typing import TYPE_CHECKING

import pytest
from tests.present.rough_pictures import rough_pictures
from tests.study.made import HEADINGS, made_study, read_study, table

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import FileInputError
from tsis.files.canonical_json import json_bytes
from tsis.present.html import html_bytes
from tsis.present.study import publish_study, study_document, study_files, study_page, undecided_notes
from tsis.study.analysis import analyse
from tsis.study.folder import enter_readings, open_study, unblind, verify_study
from tsis.study.plan import DeviceReading
from tsis.study.readings import import_table

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tsis.present.page import Page
    from tsis.study.analysis import StudyAnalysis

FORBIDDEN = re.compile(r"benign|malignan|diagnos|patient|cancer|tumou?r|clinic", re.IGNORECASE)


@pytest.fixture(scope="module")
def analysis(tmp_path_factory: pytest.TempPathFactory) -> StudyAnalysis:
    """Two devices, two operators, repeats, undecided targets."""
    folder = tmp_path_factory.mktemp("analysis")
    study = made_study(folder / "study", repeats=2)
    study = import_table(study, table(study, operators=("Cleo", "Dan")).encode(), "a.csv", device="feeler")
    rows = table(study, seed=1, apart=3.0).splitlines()
    rows[2:4] = [",".join([row.split(",")[0], "", *row.split(",")[2:]]) for row in rows[2:4]]
    study = import_table(study, "\n".join(rows).encode(), "b.csv", device="<b>camera</b>")
    return analyse(unblind(study, by="Ada"))


@pytest.fixture(scope="module")
def files(analysis: StudyAnalysis) -> dict[str, bytes]:
    return study_files(analysis)


@pytest.fixture
def rough() -> Iterator[None]:
    with rough_pictures():
        yield


def words_of(page: Page) -> str:
    return html_bytes(page).decode()


def test_the_page_is_whole_and_safe(files: dict[str, bytes]) -> None:
    page = files["report.html"].decode()
    assert page.count(RESEARCH_USE_ONLY) == 2
    assert "<script" not in page
    assert "<b>camera" not in page
    assert not re.search(r"https?://", re.sub(r'src="data:[^"]*"', "", page))
    assert not re.search(r"\b(nan|inf)\b", re.sub(r'src="data:[^"]*"', "", page), re.IGNORECASE)


def test_no_word_speaks_of_people(files: dict[str, bytes]) -> None:
    for name in ("report.html", "analysis.json", "readings.csv"):
        said = files[name].decode().replace(RESEARCH_USE_ONLY, "")
        assert not FORBIDDEN.search(re.sub(r'src="data:[^"]*"', "", said)), name


def test_everything_that_was_promised_is_told(analysis: StudyAnalysis) -> None:
    page = study_page(analysis)
    titles = [table.title for table in page.tables]
    for part in (
        "feeler: at the threshold 0.5, which was fixed beforehand",
        "feeler: other thresholds, chosen on these very targets and so optimistic",
        "feeler: scores taken for probabilities",
        "feeler: what was read of inclusions that were found, less what is true",
        "feeler: found by size and by depth",
        "feeler: how well readings of the same target agree",
        "<b>camera</b> beside feeler, on 14 targets that both decided",
        "Every target",
        "What this study does not tell",
    ):
        assert part in titles
    assert analysis.verification.head in " ".join(page.notes)
    assert any("2 targets undecided" in note and "wrong answer" in note for note in page.notes)
    every = next(table for table in page.tables if table.title == "Every target")
    assert [row[0] for row in every.rows] == list(analysis.truths)
    assert sum("undecided" in row[-1] for row in every.rows) == 2
    limits = " ".join(text for row in page.tables[-1].rows for text in row)
    assert "same laws" in limits
    assert "one target of two" in limits


def test_a_number_on_the_page_is_the_number_of_the_analysis(analysis: StudyAnalysis, files: dict[str, bytes]) -> None:
    page = study_page(analysis)
    cards = {card.title: card for card in page.cards}
    counts = analysis.devices[0].counts
    assert counts is not None
    low, high = counts.sensitivity.interval()
    card = cards["Sensitivity, feeler"]
    assert card.value == f"{100 * counts.sensitivity.value:.3g} %"
    assert f"{100 * low:.1f} to {100 * high:.1f} %" in card.detail
    document = json.loads(files["analysis.json"])
    assert document["devices"][0]["counts"]["sensitivity"]["interval"]["low"] == low
    assert document["devices"][0]["auc"] == analysis.devices[0].curve.auc  # type: ignore[union-attr]
    assert document["verification"]["sound"] is True


def test_the_table_holds_every_reading_beside_the_truth(analysis: StudyAnalysis, files: dict[str, bytes]) -> None:
    rows = list(csv.DictReader(io.StringIO(files["readings.csv"].decode())))
    assert len(rows) == len(analysis.study.readings)
    for row in rows:
        assert (row["present"] == "yes") == analysis.truths[row["code"]].has_inclusion
        assert bool(row["true_depth_mm"]) == analysis.truths[row["code"]].has_inclusion


def test_a_small_study_says_that_it_says_little(tmp_path: Path) -> None:
    page = study_page(analyse(unblind(read_study(tmp_path, present=3, blank=2), by="Ada")))
    assert any("fewer than 5 of a class a study says little" in note for note in page.notes)
    assert not any(card.doubtful for card in page.cards if "Sensitivity" in card.title), "few targets are no fault"


def test_a_study_of_one_class_has_a_page(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", present=2, blank=0)
    row = "\n".join(f"{code},,Cleo,1,,," for code in study.plan.codes)
    study = import_table(study, f"{HEADINGS}\n{row}\n".encode(), "a.csv", device="feeler")  # and nothing decided
    page = words_of(study_page(analyse(unblind(study, by="Ada"))))
    assert "it needs targets of both kinds" in page


def test_what_was_changed_stands_at_the_top(tmp_path: Path) -> None:
    study = unblind(read_study(tmp_path), by="Ada")
    path = study.folder / "sealed.json"
    path.write_bytes(path.read_bytes().replace(b'"diameter_mm": 3.0', b'"diameter_mm": 4.0', 1))
    page = study_page(analyse(study))
    assert (page.cards[0].value, page.cards[0].doubtful) == ("CHANGED", True)
    assert page.notes[0].startswith("NOT AS IT WAS WRITTEN")
    assert "sealed.json was changed" in page.notes[1]
    assert "after the unblinding" in page.notes[1]


@pytest.mark.usefixtures("rough")
def test_a_report_is_entered_with_its_hashes_and_found_when_it_is_changed(tmp_path: Path) -> None:
    study = read_study(tmp_path)
    done = publish_study(study, by="Ada")
    again = publish_study(done.study, by="Ben")
    assert (done.folder.name, again.folder.name) == ("analysis", "analysis-2")
    assert sorted(path.name for path in done.folder.iterdir()) == [
        "analysis.json",
        "readings.csv",
        "report.html",
        "report.pdf",
    ]
    assert verify_study(study.folder).sound
    (done.folder / "report.html").write_bytes(b"better")
    assert [fault.file for fault in verify_study(study.folder).faults] == ["analysis/report.html"]


def test_a_later_repeat_that_is_judged_is_told(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", present=2, blank=2)
    readings = [
        DeviceReading(code=code, device="feeler", operator="Ada", repeat=1 + (place < 3), score=0.2 * place)
        for place, code in enumerate(study.plan.codes)
    ]
    (one,) = analyse(unblind(enter_readings(study, readings, actor="Ada"), by="Ada")).devices
    assert "feeler: 3 targets judged by a later repeat, as repeat 1 is missing." in undecided_notes(one)


@pytest.mark.parametrize("failing", ["tsis.study.analysis.device_analysis", "tsis.present.study.study_page"])
def test_a_failure_before_the_result_leaves_the_study_blind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    def fails(*_: object) -> None:
        raise ZeroDivisionError

    study = read_study(tmp_path)
    monkeypatch.setattr(failing, fails)
    with pytest.raises(ZeroDivisionError):
        publish_study(study, by="Ada")
    assert open_study(study.folder).unblinded is None
    assert not (study.folder / "analysis").exists()


@pytest.mark.usefixtures("rough")
def test_the_report_of_a_study_that_was_blind_is_that_of_the_unblinded_one(tmp_path: Path) -> None:
    done = publish_study(read_study(tmp_path), by="Ada")
    again = json.loads(json_bytes(study_document(analyse(done.study))))
    was = json.loads((done.folder / "analysis.json").read_bytes())
    assert was["devices"] == again["devices"]
    assert was["verification"]["unblinded"].endswith("UTC by Ada")
    assert was["verification"]["lines"] == again["verification"]["lines"] - 1, "without the line of the analysis itself"


@pytest.mark.usefixtures("rough")
def test_the_name_of_a_report_that_is_gone_is_not_given_again(tmp_path: Path) -> None:
    done = publish_study(read_study(tmp_path), by="Ada")
    shutil.rmtree(done.folder)
    assert publish_study(done.study, by="Ada").folder.name == "analysis-2"
    assert {fault.file.split("/")[0] for fault in verify_study(done.study.folder).faults} == {"analysis"}


@pytest.mark.usefixtures("rough")
def test_a_report_elsewhere_is_entered_without_its_place(tmp_path: Path) -> None:
    study = read_study(tmp_path)
    (tmp_path / "a file").touch()
    with pytest.raises(FileInputError, match="must be a folder that can be made"):
        publish_study(study, by="Ada", out=tmp_path / "a file" / "report")
    assert open_study(study.folder).unblinded is None, "nobody unblinds for a report that cannot be written"
    done = publish_study(study, by="Ada", out=tmp_path / "elsewhere" / "report")
    assert done.folder == (tmp_path / "elsewhere" / "report").resolve()
    assert str(tmp_path) not in (study.folder / "log.jsonl").read_text(encoding="utf-8")
