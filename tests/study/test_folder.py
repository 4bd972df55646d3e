"""The folder of a study: its creation, one unblinding, and changes that its verification finds."""

from __future__ import annotations

import gc
import hashlib
import json
import shutil
import stat
import sys
import tracemalloc
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.study.made import made_study, read_study

from tsis.errors import InputError, RecordsError
from tsis.files.canonical_json import canonical, digest
from tsis.present.study import publish_study
from tsis.study.folder import (
    enter_readings,
    new_study,
    open_study,
    printed_targets,
    random_targets,
    read_seal,
    unblind,
    verify_study,
)
from tsis.study.log import SealedTruth, parse_seal
from tsis.study.plan import DeviceReading

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


def reading(code: str, **changed: object) -> DeviceReading:
    values: dict[str, object] = {"code": code, "device": "feeler", "operator": "Cleo", "repeat": 1, "score": 0.7}
    return DeviceReading(**(values | changed))  # type: ignore[arg-type]


def test_the_plan_holds_the_hash_of_the_truth_and_nothing_else_of_it(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study")
    sealed = (study.folder / "sealed.json").read_bytes()
    plan = json.loads((study.folder / "study.json").read_text(encoding="utf-8"))
    assert plan["truth_sha256"] == hashlib.sha256(sealed).hexdigest()
    open_text = (study.folder / "study.json").read_text() + (study.folder / "log.jsonl").read_text()
    for word in ("detection", "present", "inclusion", "diameter", "blank", "salt"):
        assert word not in open_text
    truths, unchanged = read_seal(study)
    assert unchanged
    assert sorted(each.label for each in truths.truths.values()) == sorted(
        [f"detection-{number}" for number in range(1, 9)] + ["detection-blank"] * 8
    )
    assert set(truths.truths) == set(plan["codes"])


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such rights")
def test_only_its_owner_reads_the_seal(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study")
    assert stat.S_IMODE((study.folder / "sealed.json").stat().st_mode) == 0o600


def test_the_same_seed_makes_the_same_study_under_another_salt(tmp_path: Path) -> None:
    one, other = made_study(tmp_path / "one"), made_study(tmp_path / "other")
    assert one.plan.codes == other.plan.codes
    assert read_seal(one)[0].truths == read_seal(other)[0].truths
    assert one.plan.commitment != other.plan.commitment


def test_a_seed_that_nobody_gave_lies_in_the_seal_and_makes_the_targets(tmp_path: Path) -> None:
    def targets(seed: int) -> tuple[object, ...]:
        return random_targets(3, 2, rng=np.random.default_rng(seed))

    one = new_study(tmp_path / "one", targets, probe="tsis-2011")  # type: ignore[arg-type]
    assert one.plan.seed is None
    seed = read_seal(one)[0].seed
    other = new_study(tmp_path / "other", targets, probe="tsis-2011", seed=seed)  # type: ignore[arg-type]
    assert read_seal(one)[0].truths == read_seal(other)[0].truths


def test_what_is_there_is_never_written_over(tmp_path: Path) -> None:
    made_study(tmp_path / "study")
    with pytest.raises(RecordsError, match="must be a new name"):
        made_study(tmp_path / "study")
    with pytest.raises(RecordsError, match="holds no study"):
        open_study(tmp_path)


def test_forces_are_those_of_the_probe_unless_given(tmp_path: Path) -> None:
    made = [new_study(tmp_path / name, printed_targets(1, 1), probe=name) for name in ("tsis-2011", "tsis-domed")]
    assert [study.plan.forces_n for study in made] == [(1.0,), (0.5, 1.0)]


def test_readings_are_entered_once_and_of_this_study_alone(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study")
    first, second = study.plan.codes[:2]
    study = enter_readings(study, [reading(first)], actor="Cleo")
    for wrong, words in (
        ([reading(second), reading(first)], "entered once"),
        ([reading(second), reading(second)], "entered once"),
        ([reading("T-0000")], "code must be one of this study's"),
    ):
        with pytest.raises(InputError, match=words):
            enter_readings(study, wrong, actor="Cleo")
    assert [each.code for each in open_study(study.folder).readings] == [first]


def test_after_the_unblinding_no_reading_is_taken(tmp_path: Path) -> None:
    study = read_study(tmp_path, present=2, blank=2)
    after = unblind(study, by="Ada")
    log = (study.folder / "log.jsonl").read_bytes()
    for held in (study, after):  # whoever opened it before is told too
        with pytest.raises(RecordsError, match="be entered before a study is unblinded"):
            enter_readings(held, [reading(study.plan.codes[0], operator="Dan")], actor="Dan")
    assert (study.folder / "log.jsonl").read_bytes() == log


def test_it_is_unblinded_once(tmp_path: Path) -> None:
    study = read_study(tmp_path, present=2, blank=2)
    once = unblind(study, by="Ada")
    again = unblind(study, by="Ben")
    assert once.unblinded == again.unblinded
    assert once.unblinded is not None
    assert once.unblinded.actor == "Ada"
    assert sum(entry.action == "unblinded" for entry in again.chain.entries) == 1


def test_without_a_reading_nothing_is_unblinded(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study")
    with pytest.raises(RecordsError, match="must have a reading"):
        unblind(study, by="Ada")
    assert open_study(study.folder).unblinded is None


def test_a_changed_plan_takes_no_reading(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study")
    path = study.folder / "study.json"
    path.write_bytes(path.read_bytes().replace(b'"threshold": 0.5', b'"threshold": 0.9'))
    with pytest.raises(RecordsError, match="was changed"):
        enter_readings(study, [reading(study.plan.codes[0])], actor="Cleo")


@pytest.mark.parametrize(
    ("part", "wrong"),
    [
        ("codes", ["T-7F3K", "T-7F3K"]),
        ("codes", [3]),
        ("codes", "T-7F3K"),
        ("forces_n", []),
        ("forces_n", 1.0),
        ("repeats", 0),
        ("threshold", None),
        ("probe", "tsis-2012"),
        ("made", "yesterday"),
        ("version", 2),
        ("format", "tsis-csv"),
        ("name", "a\nb"),
        ("truth_sha256", "0"),
    ],
)
def test_a_plan_that_is_none_is_one_sentence(tmp_path: Path, part: str, wrong: object) -> None:
    study = made_study(tmp_path / "study")
    path = study.folder / "study.json"
    path.write_text(json.dumps(json.loads(path.read_text(encoding="utf-8")) | {part: wrong}), encoding="utf-8")
    with pytest.raises(RecordsError, match=r"^study\.json") as refused:
        open_study(study.folder)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("content", ["{}", "[]", "", '{"format": "tsis-study-truth", "version": 1}', "\xff"])
def test_a_seal_that_is_none_is_one_sentence(tmp_path: Path, content: str) -> None:
    study = made_study(tmp_path / "study")
    (study.folder / "sealed.json").write_text(content, encoding="latin-1")
    with pytest.raises((RecordsError, InputError)) as refused:
        read_seal(study)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", ["x" * 300, "no\0name", "nothing"])
def test_a_folder_without_a_study_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(RecordsError, match=r"must be the folder of a study"):
        open_study(tmp_path / name)


def test_a_plan_or_seal_that_is_no_json_is_named_once(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study")
    (study.folder / "sealed.json").write_bytes(b"{")
    with pytest.raises(RecordsError, match=r"^sealed\.json must be a readable JSON file"):
        read_seal(study)
    (study.folder / "study.json").write_bytes(b"plan")
    with pytest.raises(RecordsError, match=r"^study\.json must be a readable JSON file"):
        open_study(study.folder)


def test_a_threshold_that_is_none_any_more_is_named_with_its_line(tmp_path: Path) -> None:
    study = read_study(tmp_path, present=2, blank=2)
    log = study.folder / "log.jsonl"
    log.write_bytes(log.read_bytes().replace(b'"threshold":0.5', b'"threshold":"low"'))
    with pytest.raises(RecordsError, match=r"^log\.jsonl, line 2, must hold the threshold of 'feeler'; .*got 'low'"):
        open_study(study.folder).threshold_of("feeler")


@pytest.fixture
def usual_collection() -> Iterator[None]:
    """Collect garbage as often as Python does outside of tests."""
    often = gc.get_threshold()
    gc.set_threshold(700, 10, 10)
    yield
    gc.set_threshold(*often)


@pytest.mark.usefixtures("usual_collection")
def test_a_large_seal_is_the_same_document_written_target_by_target() -> None:
    """Memory at 10^5 targets stays within a few times the file, which a whole document exceeded ten times."""
    targets = random_targets(600, 1500, rng=np.random.default_rng(3))
    seal = SealedTruth(salt="5a17", seed=3, truths={f"T-{number}": item for number, item in enumerate(targets)})
    progress: list[tuple[int, int]] = []
    tracemalloc.start()
    content = seal.content(lambda done, total: progress.append((done, total)))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    whole = json.loads(content)
    assert content == (json.dumps(whole, indent=1) + "\n").encode()
    assert whole["targets"] == {code: truth.json_values() for code, truth in seal.truths.items()}
    assert parse_seal(content, "sealed.json") == seal
    assert progress == [(0, 2100), (1000, 2100), (2000, 2100)]
    assert peak < 4 * len(content)


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
    from tsis.files.hash_chain import LogDraft
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
    from tsis.files.hash_chain import LogDraft
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
