from __future__ import annotations

import math
import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from tests.study.made import made_study

from tsis.errors import InputError, RecordsError
from tsis.records.store import open_store
from tsis.study import readings as pressing
from tsis.study.folder import enter_readings, open_study, unblind, verify_study
from tsis.study.readings import press_study

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.study.folder import Study


def said(study: Study) -> list[tuple[str, float | None, str]]:
    return [(each.code, each.score, each.evidence["frames_sha256"]) for each in study.readings]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """A study that was pressed without a break, with a store."""
    folder = tmp_path_factory.mktemp("whole")
    study = made_study(folder / "study", present=2, blank=2)
    with open_store(folder / "records") as store:
        return press_study(study, operator="Ada", save=store, strain="small").study


def test_inclusions_score_above_blanks(whole: Study) -> None:
    from tsis.study.folder import read_seal

    truths = read_seal(whole)[0].truths
    assert [each.code for each in whole.readings] == list(whole.plan.codes)
    scores: dict[bool, list[float]] = {True: [], False: []}
    for each in whole.readings:
        assert each.score is not None
        assert each.rank is not None
        scores[truths[each.code].has_inclusion].append(each.score)
        assert each.values or not truths[each.code].has_inclusion
        assert not each.values or each.score > 0.05, "no size of what is absent"
        assert each.evidence["tsis"]
        odds = each.score / (1 - each.score) if each.score < 1 else float("inf")
        assert min(odds, 1e12) == pytest.approx(min(math.exp(min(each.rank, 700)), 1e12), rel=1e-3)
        assert each.device == "virtual tsis-2011"
    assert min(scores[True]) > max(scores[False])
    assert max(scores[False]) < 0.5
    assert verify_study(whole.folder).sound


def test_neither_the_log_nor_the_store_is_told_of_the_truth(whole: Study) -> None:
    files = [path for path in whole.folder.parent.rglob("*") if path.is_file() and path.name != "sealed.json"]
    held = [path.read_bytes() for path in files]
    assert len(held) > 5
    for word in (b"detection-1", b"detection-2", b"detection-blank"):
        assert not any(word in content for content in held)
    with open_store(whole.folder.parent / "records") as store:
        targets = [each.target for each in store.targets()]
    assert sorted(target.name for target in targets) == sorted(whole.plan.codes)
    assert not any(target.truth for target in targets)


@pytest.fixture
def undecided(monkeypatch: pytest.MonkeyPatch) -> None:
    """An estimator that refuses every press, where only the order of the readings matters."""

    def refuse(*_: object, **__: object) -> None:
        raise InputError("images must show contact; got none")

    monkeypatch.setattr(pressing, "estimate", refuse)


@pytest.mark.usefixtures("undecided")
def test_a_run_that_was_ended_goes_on_with_the_same_presses(whole: Study, tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", present=2, blank=2)
    steps: list[int] = []
    done = press_study(
        study, operator="Ada", progress=lambda done, _: steps.append(done), ended=lambda: len(steps) > 2, strain="small"
    )
    assert (done.entered, done.left) == (2, 2)
    done = press_study(done.study, operator="Ada", strain="small")
    assert (done.entered, done.left) == (2, 0)
    assert [frames for *_, frames in said(done.study)] == [frames for *_, frames in said(whole)]
    assert press_study(done.study, operator="Ada", strain="small").entered == 0


KILLED = """
import os, sys
from tsis.study.folder import open_study
from tsis.study.readings import press_study
press_study(open_study(sys.argv[1]), operator="Ada", progress=lambda done, _: done == 2 and os._exit(9), strain="small")
"""


@pytest.mark.system
def test_a_killed_run_loses_no_reading(whole: Study, tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", present=2, blank=2)
    killed = subprocess.run([sys.executable, "-c", KILLED, str(study.folder)], env=os.environ, check=False)
    assert killed.returncode == 9
    study = open_study(study.folder)
    assert len(study.readings) == 2
    assert said(press_study(study, operator="Ada", strain="small").study) == said(whole)


@pytest.mark.usefixtures("undecided")
def test_two_runs_do_not_read_at_once(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", present=1, blank=1)
    refused: list[str] = []

    def meanwhile(done: int, _: int) -> None:
        if done == 1:
            with pytest.raises(RecordsError) as said:
                press_study(study, operator="Ben", strain="small")
            refused.append(str(said.value))

    assert press_study(study, operator="Ada", progress=meanwhile, strain="small").entered == 2
    assert "must be read by one run at a time; another one is under way" in refused[0]
    assert press_study(study, operator="Ben", strain="small").entered == 2, (
        "once the first has ended, and from a study read before it"
    )
    assert [each.operator for each in open_study(study.folder).readings] == ["Ada", "Ada", "Ben", "Ben"]


@pytest.mark.slow
def test_every_repeat_operator_and_seed_has_errors_of_its_own(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", present=1, blank=1, repeats=2)
    for operator in ("Ada", "Ben"):
        study = press_study(study, operator=operator, strain="small").study
    study = press_study(study, operator="Eve", seed=1, strain="small").study
    frames = [each.evidence["frames_sha256"] for each in study.readings]
    assert len(set(frames)) == len(frames) == 12
    assert [each.repeat for each in study.readings[:4]] == [1, 1, 2, 2]


@pytest.mark.usefixtures("undecided")
def test_a_refused_estimate_is_undecided_and_no_guess(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", present=1, blank=1)
    done = press_study(study, operator="Ada", strain="small")
    assert (done.entered, done.undecided, done.left) == (2, 2, 0)
    assert [(each.score, each.reason) for each in done.study.readings] == [
        (None, "images must show contact; got none")
    ] * 2


def test_a_press_that_fails_tells_nothing_of_the_target(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise InputError("depth_mm must be less; got 8 of detection-2")

    study = made_study(tmp_path / "study", present=1, blank=1)
    monkeypatch.setattr("tsis.virtual.VirtualProbe.press", fail)
    done = press_study(study, operator="Ada", strain="small")
    assert {each.reason for each in done.study.readings} == {"the press could not be computed"}
    assert "detection" not in (study.folder / "log.jsonl").read_text(encoding="utf-8")


def test_a_changed_truth_and_an_unblinded_study_are_not_pressed(whole: Study, tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", present=1, blank=1)
    path = study.folder / "sealed.json"
    path.write_bytes(path.read_bytes().replace(b"detection-1", b"detection-3"))
    with pytest.raises(RecordsError, match="sealed truth must be the one"):
        press_study(study, operator="Ada", strain="small")
    other = made_study(tmp_path / "other", present=1, blank=1)
    first = whole.readings[0]
    from dataclasses import replace

    other = enter_readings(other, [replace(first, code=other.plan.codes[0])], actor="Ada")
    with pytest.raises(RecordsError, match="nothing was pressed"):
        press_study(unblind(other, by="Ada"), operator="Ada", strain="small")
