from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.study.made import HEADINGS, made_study, read_study, table

from tsis.errors import InputError, RecordsError
from tsis.study.folder import open_study
from tsis.study.readings import export_readings, import_readings, import_table, read_truth_table

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.study.folder import Study


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
