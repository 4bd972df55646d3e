from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from tests.study.made import made_study, read_study

from tsis.errors import InputError, RecordsError
from tsis.files import canonical, digest
from tsis.present.study import publish_study
from tsis.study.folder import open_study, unblind, verify_study

if TYPE_CHECKING:
    from collections.abc import Callable


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study that was read, unblinded and analysed."""
    study = read_study(tmp_path_factory.mktemp("kept"), present=5, blank=5)
    publish_study(study, by="Ada")
    return study.folder


@pytest.fixture
def published(kept: Path, tmp_path: Path) -> Path:
    """A copy of it, to be changed."""
    return Path(shutil.copytree(kept, tmp_path / "study"))


def replaced(path: Path, old: bytes, new: bytes) -> None:
    content = path.read_bytes()
    assert old in content
    path.write_bytes(content.replace(old, new, 1))


def edited_line(folder: Path, number: int, change: Callable[[dict[str, object]], object]) -> None:
    """A line with other content, whose hash was made to fit."""
    path = folder / "log.jsonl"
    lines = path.read_text(encoding="utf-8").splitlines()
    entry = json.loads(lines[number - 1])
    change(entry["content"])
    entry["hash"] = digest({name: value for name, value in entry.items() if name != "hash"})
    lines[number - 1] = canonical(entry)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def test_what_nobody_changed_is_as_it_was_written(published: Path) -> None:
    found = verify_study(published)
    assert found.sound
    assert found.lines == open_study(published).chain.lines == 14
    assert "by Ada" in found.unblinded
    assert verify_study(published, head=found.head).sound


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("study.json", b'"threshold": 0.5', b'"threshold": 0.4'),
        ("sealed.json", b'"detection-1"', b'"detection-2"'),
        ("analysis/analysis.json", b'"true_positives"', b'"true_positive"'),
        ("analysis/readings.csv", b"detection-1", b"detection-2"),
        ("analysis/report.html", b"Study", b"study"),
    ],
)
def test_a_file_that_was_changed_after_the_unblinding_is_named(
    published: Path, name: str, old: bytes, new: bytes
) -> None:
    replaced(published / name, old, new)
    found = verify_study(published)
    assert [str(fault) for fault in found.faults] == [
        f"{name} was changed: its SHA-256 is not the one in the log (after the unblinding)."
    ]


def test_a_file_that_is_gone_is_named(published: Path) -> None:
    (published / "sealed.json").unlink()
    (published / "analysis" / "report.pdf").unlink()
    assert [fault.file for fault in verify_study(published).faults] == ["sealed.json", "analysis/report.pdf"]


def test_a_score_that_was_changed_is_found_with_its_line(published: Path) -> None:
    path = published / "log.jsonl"
    lines = path.read_bytes().split(b"\n")
    at = lines[4].index(b'"score":') + 8
    lines[4] = lines[4][:at] + b"9" + lines[4][at:]
    path.write_bytes(b"\n".join(lines))
    (fault,) = verify_study(published).faults
    assert (fault.line, fault.when) == (5, "after the unblinding")


def test_a_score_whose_line_was_made_to_fit_breaks_the_next_line(published: Path) -> None:
    edited_line(published, 5, lambda content: content.update(score=0.99))
    (fault,) = verify_study(published).faults
    assert fault.line == 6
    assert "does not follow" in fault.what


def test_what_was_changed_before_the_unblinding_is_told_from_what_came_after(tmp_path: Path) -> None:
    study = read_study(tmp_path, present=5, blank=5)
    edited_line(study.folder, 5, lambda content: content.update(score=0.99))
    assert [fault.when for fault in verify_study(study.folder).faults] == [""]
    publish_study(open_study(study.folder), by="Ada")
    assert [(fault.line, fault.when) for fault in verify_study(study.folder).faults] == [(6, "before the unblinding")]
    replaced(study.folder / "sealed.json", b'"detection-1"', b'"detection-2"')
    assert {fault.file: fault.when for fault in verify_study(study.folder).faults} == {
        "log.jsonl": "before the unblinding",
        "sealed.json": "after the unblinding",
    }


def test_a_log_that_was_cut_short_or_written_anew_is_found_by_its_head(published: Path) -> None:
    head = verify_study(published).head
    path = published / "log.jsonl"
    whole = path.read_bytes()
    path.write_bytes(b"".join(line + b"\n" for line in whole.split(b"\n")[:-2]))
    assert verify_study(published).sound  # which nobody can tell without the head
    (fault,) = verify_study(published, head=head[:20]).faults
    assert "cut short or written anew" in fault.what
    path.write_bytes(whole)
    edited_line(published, 14, lambda content: content.update(folder=""))
    assert verify_study(published).sound
    assert not verify_study(published, head=head).sound


def test_an_earlier_head_is_held_still(tmp_path: Path) -> None:
    study = read_study(tmp_path, present=5, blank=5)
    before = verify_study(study.folder).head
    unblind(study, by="Ada")
    assert verify_study(study.folder, head=before).sound


@pytest.mark.parametrize("head", ["", "abc", "z" * 64, "../../etc/passwd"])
def test_a_head_that_is_none(published: Path, head: str) -> None:
    with pytest.raises(InputError, match="head must be a hash"):
        verify_study(published, head=head)


def test_lines_that_fit_and_that_no_study_writes_are_found(tmp_path: Path) -> None:
    from tsis.files import LogDraft
    from tsis.study.log import append_log

    study = unblind(read_study(tmp_path, present=5, blank=5), by="Ada")
    known = study.readings[0].json_values()
    for action, content in (
        ("reading", known | {"operator": "Dan", "score": 1.0}),
        ("unblinded", {"faults": []}),
        ("created", {}),
        ("deleted", {}),
        ("analysed", {"folder": "../..", "files": {"passwd": "0"}}),
    ):
        append_log(study.folder, lambda _chain, a=action, c=content: [LogDraft(actor="Eve", action=a, content=c)])  # type: ignore[misc]
    found = verify_study(study.folder)
    assert [fault.line for fault in found.faults] == [14, 15, 16, 17]
    assert "after the unblinding; it is not counted" in found.faults[0].what
    assert all(each.operator != "Dan" for each in open_study(study.folder).readings)


def test_a_reading_twice_or_of_nothing_is_found(tmp_path: Path) -> None:
    from tsis.files import LogDraft
    from tsis.study.log import append_log

    study = read_study(tmp_path, present=5, blank=5)
    plain = study.readings[0].json_values()
    for content in (plain, plain | {"code": "T-2222"}, plain | {"score": "high"}, {}):
        append_log(study.folder, lambda _chain, c=content: [LogDraft(actor="Eve", action="reading", content=c)])  # type: ignore[misc]
    whats = [fault.what for fault in verify_study(study.folder).faults]
    assert [what.split("reading ")[-1] for what in whats] == [
        "that is there already",
        "of a code that is not in the plan",
        "that a study writes",
        "that a study writes",
    ]
    assert len(open_study(study.folder).readings) == 10


def test_a_study_without_its_log_is_one_sentence(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study")
    (study.folder / "log.jsonl").unlink()
    with pytest.raises(InputError, match="does not exist"):
        verify_study(study.folder)


def test_a_folder_that_holds_no_study_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordsError, match=r"must be the folder of a study; it holds no study\.json"):
        verify_study(tmp_path)


def test_what_follows_a_line_cut_short_is_not_blamed_for_it(tmp_path: Path) -> None:
    study = read_study(tmp_path, present=5, blank=5)
    log = study.folder / "log.jsonl"
    log.write_bytes(log.read_bytes()[:-40])
    publish_study(open_study(study.folder), by="Ada")
    (fault,) = verify_study(study.folder).faults
    assert (fault.line, fault.what, fault.when) == (12, "cannot be read", "before the unblinding")
    lines = log.read_bytes().splitlines(keepends=True)
    log.write_bytes(b"".join([*lines[:11], *lines[12:]]))  # which would hide it
    assert {fault.line for fault in verify_study(study.folder).faults} == {12, 13}


@pytest.mark.parametrize("name", ["my report", "Bericht (2)", "-o", ".hidden"])
def test_a_report_of_any_name_in_the_study_is_verified(kept: Path, tmp_path: Path, name: str) -> None:
    folder = Path(shutil.copytree(kept, tmp_path / "study"))
    published = publish_study(open_study(folder), by="Ada", out=folder / name)
    assert published.folder == (folder / name).resolve()
    assert verify_study(folder).sound
    (folder / name / "report.html").write_bytes(b"better")
    assert [str(fault) for fault in verify_study(folder).faults] == [
        f"{name}/report.html was changed: its SHA-256 is not the one in the log (after the unblinding)."
    ]


def test_a_study_is_analysed_again_whatever_its_log_was_made_to_say(published: Path) -> None:
    edited_line(published, 14, lambda content: content.update(folder=["analysis"]))
    assert publish_study(open_study(published), by="Ada").folder.name == "analysis-2"
