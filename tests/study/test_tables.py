"""Tables of studies for pandas hold what the log and the truth hold."""

from __future__ import annotations

import io
import sys
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest
from tests.study.made import HEADINGS, made_study, read_study, table

from tsis.errors import FileInputError, MissingExtraError
from tsis.study.analysis import analyse, results_table
from tsis.study.folder import enter_readings, open_study, read_seal, unblind
from tsis.study.plan import DeviceReading
from tsis.study.readings import export_readings, import_readings, readings_table

if TYPE_CHECKING:
    from pathlib import Path

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


def test_without_pandas_one_sentence_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = made_study(tmp_path / "study")
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtraError, match=r'pandas, which is not installed; .*"tsis\[analysis\]"$'):
        readings_table(study)
