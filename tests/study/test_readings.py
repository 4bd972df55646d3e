"""Readings by the virtual probe and from tables: errors by seed, interruptions, what is refused, data frames."""

from __future__ import annotations

import csv
import io
import math
import os
import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.study.made import HEADINGS, made_study, read_study, table

from tsis.errors import FileInputError, InputError, MissingExtraError, RecordsError
from tsis.records.store import open_store
from tsis.study import readings as pressing
from tsis.study.analysis import analyse, results_table
from tsis.study.folder import enter_readings, open_study, read_seal, unblind, verify_study
from tsis.study.plan import DeviceReading
from tsis.study.readings import (
    export_readings,
    import_readings,
    import_table,
    press_study,
    read_truth_table,
    readings_table,
    threshold_note,
)

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


@pytest.fixture(scope="module")
def blind(tmp_path_factory: pytest.TempPathFactory) -> Study:
    return made_study(tmp_path_factory.mktemp("blind") / "study")


def test_readings_come_out_as_they_went_in(tmp_path: Path) -> None:
    study = read_study(tmp_path)
    given_rows = list(csv.reader(io.StringIO((tmp_path / "readings.csv").read_text())))
    out = list(csv.reader(io.StringIO(export_readings(study).decode())))
    assert out[0] == given_rows[0]
    for was, result in zip(given_rows[1:], out[1:], strict=True):
        assert [float(each) if each else None for each in (was[1], *was[3:])] == [
            float(each) if each else None for each in (result[1], *result[3:])
        ]
        assert (was[0], was[2]) == (result[0], result[2])
    twin = made_study(tmp_path / "twin")
    (tmp_path / "out.csv").write_bytes(export_readings(study))
    assert import_readings(twin, tmp_path / "out.csv", device="feeler").readings == study.readings


@pytest.mark.parametrize("operator", ["=1+1", "+cmd", "-2", "@SUM(A1)", "'quoted", "＝1", "Ada"])
def test_no_operator_becomes_a_formula(tmp_path: Path, operator: str) -> None:
    study = made_study(tmp_path / "study")
    row = f"{study.plan.codes[0]},0.5,{operator},1,,,"
    guarded = operator if operator != "'quoted" else "''quoted"
    study = import_table(study, f"{HEADINGS}\n{row.replace(operator, guarded)}\n".encode(), "a.csv", device="feeler")
    assert study.readings[0].operator == operator
    result = list(csv.reader(io.StringIO(export_readings(study).decode())))[1][2]
    assert not result.startswith(("=", "+", "-", "@", "＝"))
    twin = import_table(made_study(tmp_path / "twin"), export_readings(study), "b.csv", device="feeler")
    assert twin.readings[0].operator == operator


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (["T-0000,0.5,Cleo,1,,,"], "code must be one of this study's codes; got 'T-0000' (a.csv, line 2)"),
        (["CODE,nan,Cleo,1,,,"], "score must be a finite number"),
        (["CODE,inf,Cleo,1,,,"], "score must be a finite number"),
        (["CODE,0x10,Cleo,1,,,"], "score must be a finite number"),
        (["CODE,1_0,Cleo,1,,,"], "score must be a finite number"),
        (["CODE,١,Cleo,1,,,"], "score must be a finite number"),
        (["CODE,0;5,Cleo,1,,,"], "score must be a finite number"),
        (["CODE,1e300,Cleo,1,,,"], "score must lie in"),
        (["CODE,0.5,Cleo,1.5,,,"], "repeat must be a whole number from 1"),
        (["CODE,0.5,Cleo,,,,"], "repeat must be a whole number from 1"),
        (["CODE,0.5,Cleo,0,,,"], "repeat must lie in"),
        (["CODE,0.5,Cleo,2,,,"], "repeat must be at most 1, which the plan asks for"),
        (["CODE,4,Cleo,1,,,"], "score must be a probability from 0 to 1 where no threshold is given"),
        (["CODE,-0.1,Cleo,1,,,"], "got '-0.1' (a.csv, line 2)"),
        (["CODE,0.5,,1,,,"], "operator must be"),
        (["CODE,0.5,a\x1b[2J,1,,,"], "operator must be"),
        (["CODE,0.5,Cleo,1,-3,,"], "diameter_mm must lie in"),
        (["CODE,0.5,Cleo,1"], "a row must have 7 cells"),
        (["CODE,0.5,Cleo,1,,,", "CODE,0.6,Cleo,1,,,"], "line 3"),
        (['"CODE,0.5,Cleo,1,,,'], "line 2"),
        (["CODE,0.5," + "x" * 600 + ",1,,,"], "at most"),
        ([], "at least one reading"),
    ],
)
def test_what_is_no_reading_is_one_sentence_and_enters_nothing(blind: Study, rows: list[str], words: str) -> None:
    content = "\n".join([HEADINGS, *rows]).replace("CODE", blind.plan.codes[0]) + "\n"
    with pytest.raises(InputError) as refused:
        import_table(blind, content.encode(), "a.csv", device="feeler")
    said = str(refused.value)
    assert words in said
    assert "a.csv" in said
    assert "\n" not in said
    assert said.isprintable()
    assert not open_study(blind.folder).readings


@pytest.mark.parametrize(
    ("headings", "words"),
    [
        (HEADINGS.replace(",repeat", ""), "missing: repeat"),
        (HEADINGS + ",present", "got 'present'"),
        (HEADINGS + ",code", "one of them twice"),
        ("", "it is empty"),
    ],
)
def test_headings_that_will_not_do(blind: Study, headings: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        import_table(blind, f"{headings}\n".encode(), "a.csv", device="feeler")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=150)
@given(st.one_of(st.binary(max_size=300), st.text(max_size=200).map(lambda text: f"{HEADINGS}\n{text}".encode())))
def test_no_bytes_make_it_fail_in_another_way(blind: Study, content: bytes) -> None:
    with pytest.raises(InputError) as refused:
        import_table(blind, content, "a.csv", device="feeler")
    assert "\n" not in str(refused.value)


def test_an_empty_score_is_undecided_and_never_a_guess(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study")
    row = f"{study.plan.codes[0]},,Cleo,1,5,,\n"
    study = import_table(study, f"\ufeff{HEADINGS}\r\n\r\n{row}".encode(), "a.csv", device="feeler")
    assert study.readings[0].score is None
    assert study.readings[0].undecided
    assert "feeler" in study.devices
    assert export_readings(study).decode().splitlines()[1].split(",")[1] == ""


def test_a_device_keeps_the_threshold_of_its_first_readings(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", repeats=1)
    rows = table(study).splitlines(keepends=True)
    study = import_table(study, "".join(rows[:4]).encode(), "a.csv", device="feeler", threshold=3.0)
    assert study.threshold_of("feeler") == 3.0
    with pytest.raises(InputError, match="must stay"):
        import_table(study, "".join([rows[0], *rows[4:]]).encode(), "b.csv", device="feeler", threshold=2.0)
    study = import_table(study, "".join([rows[0], *rows[4:]]).encode(), "b.csv", device="feeler")
    assert study.threshold_of("feeler") == 3.0
    assert study.threshold_of("another") == 0.5


def test_repeats_count_from_1(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study", repeats=2)
    code = study.plan.codes[0]
    second, first = f"{code},0.9,Cleo,2,,,", f"{code},,Cleo,1,,,"
    with pytest.raises(FileInputError, match=r"repeat must count from 1 .*has 2 of 'Cleo' without 1 \(a.csv, line 2\)"):
        import_table(study, f"{HEADINGS}\n{second}\n".encode(), "a.csv", device="feeler")
    assert len(import_table(study, f"{HEADINGS}\n{second}\n{first}\n".encode(), "a.csv", device="feeler").readings) == 2
    apart = made_study(tmp_path / "apart", repeats=2, seed=3)
    for row in (first, second):
        apart = import_table(apart, f"{HEADINGS}\n{row}\n".encode(), "a.csv", device="feeler")
    assert len(apart.readings) == 2


@pytest.mark.parametrize(
    ("scores", "threshold", "said"),
    [
        ((4, 2, 5), 1.0, "All 3 scores of feeler lie at or above its threshold, 1"),
        ((0.1, 0.2, 0.3), None, "All 3 scores of feeler lie below its threshold, 0.5"),
        ((0.1, 0.5, 0.3), None, ""),
        ((0.9,), None, ""),
    ],
)
def test_scores_on_one_side_of_the_threshold_are_told(
    tmp_path: Path, scores: tuple[float, ...], threshold: float | None, said: str
) -> None:
    study = made_study(tmp_path / "study")
    rows = "\n".join(f"{code},{score},Cleo,1,,," for code, score in zip(study.plan.codes, scores, strict=False))
    study = import_table(study, f"{HEADINGS}\n{rows}\n".encode(), "a.csv", device="feeler", threshold=threshold)
    note = threshold_note(study, "feeler")
    assert note.startswith(said)
    assert bool(note) == bool(said)


def test_the_virtual_probes_name_is_its_own(blind: Study) -> None:
    with pytest.raises(InputError, match="choose another name"):
        import_table(blind, b"", "a.csv", device="virtual tsis-2011")


def test_an_export_names_whose_readings(tmp_path: Path) -> None:
    study = read_study(tmp_path)
    study = import_table(study, table(study, seed=1).encode(), "b.csv", device="camera")
    with pytest.raises(InputError, match="feeler, camera"):
        export_readings(study)
    with pytest.raises(InputError, match="got 'absent'"):
        export_readings(study, "absent")
    assert export_readings(study, "camera") != export_readings(study, "feeler")


def test_targets_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "truth.csv"
    path.write_text("label,diameter_mm,depth_mm,young_kpa,tissue_kpa\ngel,,,,\nlump,6,5,90,7\n", encoding="utf-8")
    blank, lump = read_truth_table(path)
    assert (blank.has_inclusion, blank.phantom.young_kpa) == (False, 5.0)
    assert lump.values == {"diameter_mm": 6.0, "depth_mm": 5.0, "young_kpa": 90.0}
    assert lump.phantom.young_kpa == 7.0


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("a,6,,90", "depth_mm must be given where diameter_mm is"),
        ("a,60,5,90", "must be less than thickness_mm"),
        ("a,nan,5,90", "must be a finite number"),
        (",6,5,90", "label must be"),
        ("a,6,5,90\na,6,5,90", "different in every row"),
        ("a,6,5,-90", "young_kpa must lie in"),
    ],
)
def test_a_target_that_is_none_is_one_sentence_with_its_line(tmp_path: Path, row: str, words: str) -> None:
    path = tmp_path / "truth.csv"
    path.write_text(f"label,diameter_mm,depth_mm,young_kpa\n{row}\n", encoding="utf-8")
    with pytest.raises(InputError, match=words) as refused:
        read_truth_table(path)
    assert "line" in str(refused.value)


def test_an_import_after_the_unblinding_is_refused(tmp_path: Path) -> None:
    from tsis.study.folder import unblind

    study = unblind(read_study(tmp_path), by="Ada")
    with pytest.raises(RecordsError, match="unblinded"):
        import_table(study, table(study, seed=2).encode(), "b.csv", device="camera")


QUANTITIES = ["diameter_mm", "depth_mm", "young_kpa"]


def test_readings_are_those_of_the_exported_file(tmp_path: Path) -> None:
    study = read_study(tmp_path, repeats=2)
    frame = readings_table(study)
    exported = pd.read_csv(io.BytesIO(export_readings(study)))
    for name in exported.columns:
        np.testing.assert_array_equal(frame[name].to_numpy(), exported[name].to_numpy())
    assert set(frame["device"]) == {"feeler"}
    assert frame["rank"].isna().all()
    assert not frame["undecided"].any()
    assert frame.groupby("code")["repeat"].max().eq(2).all()
    assert not any(column.startswith("true_") for column in frame.columns)


def test_a_study_without_readings_has_the_same_columns(tmp_path: Path) -> None:
    empty = readings_table(made_study(tmp_path / "empty"))
    assert len(empty) == 0
    assert list(empty.columns) == list(readings_table(read_study(tmp_path)).columns)


def test_results_lie_beside_the_truth(tmp_path: Path) -> None:
    study = read_study(tmp_path, repeats=2)
    (tmp_path / "other.csv").write_text(table(study, seed=9), encoding="utf-8")
    study = import_readings(study, tmp_path / "other.csv", device="other", actor="Cleo")
    unblind(study, by="Cleo")
    study = open_study(tmp_path / "study")
    analysis = analyse(study)
    frame = results_table(analysis)
    truths = read_seal(study)[0].truths
    assert len(frame) == 2 * len(study.plan.codes)
    for row in frame.itertuples():
        assert row.has_inclusion == truths[row.code].has_inclusion
        assert row.label == truths[row.code].label
        expected = [truths[row.code].values.get(name, np.nan) for name in QUANTITIES]
        np.testing.assert_array_equal([getattr(row, f"true_{name}") for name in QUANTITIES], expected)
    for device in analysis.devices:
        own = frame[frame["device"] == device.results.device]
        assert device.counts is not None
        called = pd.crosstab(own["called"], own["has_inclusion"])
        assert called.loc[True, True] == device.counts.true_positives
        assert called.loc[False, False] == device.counts.true_negatives
    first = readings_table(study).query("device == 'feeler' and repeat == 1").set_index("code")
    own = frame[frame["device"] == "feeler"].set_index("code")
    pd.testing.assert_frame_equal(own[QUANTITIES].sort_index(), first[QUANTITIES].sort_index())


def test_intervals_survive_the_table_that_carries_readings(tmp_path: Path) -> None:
    study = made_study(tmp_path / "study")
    code = study.plan.codes[0]
    stated = DeviceReading(
        code=code,
        device="feeler",
        operator="Ben",
        repeat=1,
        score=1.0,
        values={"diameter_mm": 8.25},
        sd={"diameter_mm": 0.5, "young_kpa": 9.0},
        interval_90={"diameter_mm": (7.5, 9.0), "young_kpa": (0.0, 80.0)},
    )
    (tmp_path / "out.csv").write_bytes(export_readings(enter_readings(study, [stated], actor="Ben")))
    again = import_readings(made_study(tmp_path / "again"), tmp_path / "out.csv", device="feeler", actor="Ben")
    assert again.readings == (stated,)


@pytest.mark.parametrize(("low", "high"), [("7.5", ""), ("9", "7.5"), ("-1", "7")])
def test_a_half_interval_is_refused(tmp_path: Path, low: str, high: str) -> None:
    study = made_study(tmp_path / "study")
    row = f"{study.plan.codes[0]},1,Ben,1,8,,,{low},{high}"
    (tmp_path / "t.csv").write_text(f"{HEADINGS},diameter_mm_low,diameter_mm_high\n{row}\n", encoding="utf-8")
    with pytest.raises(FileInputError, match=r"diameter_mm_low and diameter_mm_high must be given together.*line 2"):
        import_readings(study, tmp_path / "t.csv", device="feeler")


@pytest.mark.parametrize(("value", "said"), [("8", "80 and 90"), ("90.5", "80 and 90"), ("85", "")])
def test_an_interval_beside_its_value_is_refused(tmp_path: Path, value: str, said: str) -> None:
    study = made_study(tmp_path / "study")
    row = f"{study.plan.codes[0]},1,Ben,1,{value},,,80,90"
    content = f"{HEADINGS},diameter_mm_low,diameter_mm_high\n{row}\n".encode()
    if not said:
        assert import_table(study, content, "t.csv", device="feeler").readings[0].interval_90 == {
            "diameter_mm": (80.0, 90.0)
        }
        return
    with pytest.raises(
        FileInputError, match=rf"diameter_mm must be between .*{said}.*got '{value}' \(t.csv, line 2\)$"
    ):
        import_table(study, content, "t.csv", device="feeler")


def test_without_pandas_one_sentence_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = made_study(tmp_path / "study")
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtraError, match=r'pandas, which is not installed; .*"tsis\[analysis\]"$'):
        readings_table(study)
