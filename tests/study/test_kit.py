"""The validation kit: its folder, moulds that are closed bodies of the right volume, the score of a bench test."""

from __future__ import annotations

import csv
import hashlib
import json
import struct
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.cli.published import faults
from typer.testing import CliRunner

from tsis.cli.study import app
from tsis.errors import FileInputError, InputError, RecordsError
from tsis.present.kit import score_document, score_page
from tsis.study.folder import Study, enter_readings, new_study, read_seal, unblind
from tsis.study.kit import (
    MODULUS_COLUMNS,
    bench_moduli,
    cup,
    kit_files,
    score_validation,
    sphere_mould,
    stl_bytes,
)
from tsis.study.plan import DeviceReading
from tsis.study.readings import read_truth_table

if TYPE_CHECKING:
    from pathlib import Path


BATCHES = {"1;2;3;4;5": 82.0, "6;7": 60.0, "tissue": 5.0}  # true moduli, kPa; the recipe says 90, 55 and 5
TRAVEL = np.linspace(0.1, 1.0, 10)


def ball_on_pad(young_kpa: float, rng: np.random.Generator) -> np.ndarray:
    """Force in N of a ball of 5 mm on an incompressible pad of 15 mm, Dimitriadis and others (2002), with 1 % noise."""
    chi = np.sqrt(5.0 * TRAVEL) / 15.0
    correction = 1 + 1.133 * chi + 1.283 * chi**2 + 0.769 * chi**3 + 0.0975 * chi**4
    force = 16 / 9 * young_kpa * np.sqrt(5.0) * TRAVEL**1.5 * correction / 1000
    return np.asarray(force * (1 + 0.01 * rng.standard_normal(len(force))))


def bench_sheet(folder: Path, *, specimens: int = 3, seed: int = 3) -> Path:
    rng = np.random.default_rng(seed)
    rows = [
        [batch, number, "indentation", 5, 15, force, travel + 0.2]
        for batch, young in BATCHES.items()
        for number in range(specimens)
        for force, travel in zip(ball_on_pad(young, rng), TRAVEL, strict=True)
    ]
    return written(folder, *rows)


def written(folder: Path, *rows: list[Any]) -> Path:
    with (folder / "modulus.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([MODULUS_COLUMNS, *rows])
    return folder / "modulus.csv"


def kit_study(folder: Path) -> Study:
    """The sealed study of the kit's phantoms, and the folder of the kit for its bench tests."""
    (folder / "kit").mkdir()
    (folder / "phantoms.csv").write_bytes(kit_files()["phantoms.csv"])
    return new_study(
        folder / "study", read_truth_table(folder / "phantoms.csv"), seed=4, probe="tsis-2011", actor="maker"
    )


def read_true(study: Study) -> Study:
    """Readings of a device that reads true diameters, and the true moduli 10 % too large."""
    readings = []
    for code, truth in read_seal(study)[0].truths.items():
        values = dict(truth.values)
        if values:
            values["young_kpa"] = 1.1 * (82.0 if values["young_kpa"] == 90 else 60.0)
        intervals = {name: (0.95 * value, 1.05 * value) for name, value in values.items()}
        readings.append(
            DeviceReading(
                code=code,
                device="feeler",
                operator="Ada",
                repeat=1,
                score=float(truth.has_inclusion),
                values=values,
                interval_90=intervals,
            )
        )
    return enter_readings(study, readings, actor="Ada")


def test_the_kit_is_whole(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["kit", str(tmp_path / "kit"), "--json"])
    assert done.exit_code == 0, done.output
    document = json.loads(done.output)
    assert faults(document) == []
    stored = json.loads((tmp_path / "kit" / "kit.json").read_text())
    assert faults(stored) == []
    for name, sha256 in stored["files"].items():
        assert hashlib.sha256((tmp_path / "kit" / name).read_bytes()).hexdigest() == sha256
    assert {path.name for path in (tmp_path / "kit").iterdir()} == {*stored["files"], "kit.json"}
    assert (tmp_path / "kit" / "modulus.csv").read_text().split() == [",".join(MODULUS_COLUMNS)]
    sealed = read_truth_table(tmp_path / "kit" / "phantoms.csv")
    assert [target.has_inclusion for target in sealed] == [True] * 7 + [False] * 3


def test_the_score_takes_the_measured_moduli(tmp_path: Path) -> None:
    study = read_true(kit_study(tmp_path))
    bench_sheet(tmp_path / "kit")
    with pytest.raises(RecordsError, match="must be unblinded before it is scored"):
        score_validation(study, bench_moduli(tmp_path / "kit" / "modulus.csv"))
    unblind(study, by="Ada")
    command = ["score", str(tmp_path / "kit"), "--study", str(study.folder), "--poisson", "0.4999"]
    done = CliRunner().invoke(app, [*command, "--out", str(tmp_path / "out"), "--json"])
    assert done.exit_code == 0, done.output
    document = json.loads(done.output)
    assert faults(document) == []
    assert faults(json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))) == []
    assert document["detection"] == {"true_positives": 7, "present": 7, "false_positives": 0, "absent": 3}
    by = {item["quantity"]: item for item in document["quantities"]}
    assert (by["diameter_mm"]["hits"], by["diameter_mm"]["bias"]) == (7, 0)
    assert (by["young_kpa"]["hits"], by["young_kpa"]["count"]) == (0, 7)  # 10 % off with intervals of 5 %
    assert by["young_kpa"]["relative_bias"] == pytest.approx(0.1, abs=0.03)
    assert document["moduli"]["3"]["young_kpa"] == pytest.approx(82.0, rel=0.03)
    assert document["moduli"]["7"]["specimens"] == 3
    assert "those of the recipe" in " ".join(document["notes"])
    assert (tmp_path / "out" / "report.pdf").read_bytes().startswith(b"%PDF")


def test_intervals_count_where_every_value_is_withheld(tmp_path: Path) -> None:
    study = kit_study(tmp_path)
    readings = [
        DeviceReading(
            code=code, device="feeler", operator="Ada", repeat=1, score=1.0, interval_90={"young_kpa": (81.0, 84.0)}
        )
        for code, truth in read_seal(study)[0].truths.items()
        if truth.has_inclusion
    ]
    study = unblind(enter_readings(study, readings, actor="Ada"), by="Ada")
    score = score_validation(study, bench_moduli(bench_sheet(tmp_path), poisson=0.4999))
    (only,) = score.quantities
    assert (only.quantity, only.bias, only.relative_bias, only.bias_interval) == ("young_kpa", None, None, None)
    assert (only.hits, only.count, only.phantoms) == (5, 7, 0)  # batch B is of 60 kPa
    assert faults(score_document(score)) == []
    assert tuple(score_page(score).tables[0].rows[0][at] for at in (0, 1, 3, 4)) == (
        "modulus / kPa",
        "5 of 7",
        "-",
        "-",
    )


def test_intervals_are_widened_by_what_is_not_known_of_the_sizes(tmp_path: Path) -> None:
    study = kit_study(tmp_path)
    readings = [
        DeviceReading(
            code=code,
            device="feeler",
            operator="Ada",
            repeat=1,
            score=1.0,
            values={"depth_mm": truth.values["depth_mm"] + 0.25},
            interval_90={"depth_mm": (truth.values["depth_mm"] + 0.15, truth.values["depth_mm"] + 0.35)},
        )
        for code, truth in read_seal(study)[0].truths.items()
        if truth.has_inclusion
    ]
    study = unblind(enter_readings(study, readings, actor="Ada"), by="Ada")
    moduli = bench_moduli(bench_sheet(tmp_path, specimens=1))
    # 1.645 sd beside 0.1 mm must reach 0.25 mm: from an sd of 0.139 mm on
    for sd, hits in ((0.0, 0), (0.138, 0), (0.140, 7)):
        (depth,) = score_validation(study, moduli, depth_sd_mm=sd, diameter_sd_mm=5.0).quantities
        assert (depth.hits, depth.hits_widened, depth.count) == (0, hits, 7)
    with pytest.raises(InputError, match="depth_sd_mm must lie in"):
        score_validation(study, moduli, depth_sd_mm=-1.0)


GOOD = ["1", 1, "compression", 20, 15, 1.0, 0.1]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([], "must hold the points of the bench tests; it has headings alone"),
        ([["1", 1, "squeeze", 20, 15, 1, 0.1]], "kind must be indentation or compression; got 'squeeze'.*line 2"),
        ([GOOD, ["1", 1, "compression", 20, 15, "", 0.1]], "force_n must be a positive number in every row.*line 3"),
        ([GOOD, ["", 1, "compression", 20, 15, 1, 0.1]], "phantom must be given in every row.*line 3"),
        ([GOOD, ["1", 1, "compression", 20, 16, 1, 0.2]], "must be the same for all points of a specimen.*line 3"),
        ([GOOD], "at least 5; got 1 and 1 .1, specimen 1, compression"),
    ],
)
def test_wrong_sheets_are_refused(tmp_path: Path, rows: list[list[object]], message: str) -> None:
    with pytest.raises((FileInputError, InputError), match=message):
        bench_moduli(written(tmp_path, *rows))


def test_untested_phantoms_are_refused(tmp_path: Path) -> None:
    study = unblind(read_true(kit_study(tmp_path)), by="Ada")
    moduli = bench_moduli(bench_sheet(tmp_path, specimens=1))
    del moduli["6"]
    with pytest.raises(InputError, match="name each phantom with an inclusion, and no other but tissue; 6 missing"):
        score_validation(study, moduli)
    with pytest.raises(InputError, match="'8' is none"):
        score_validation(study, {**moduli, "6": moduli["7"], "8": moduli["7"]})


def read_back(content: bytes) -> np.ndarray:
    (count,) = struct.unpack_from("<I", content, 80)
    record = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    assert len(content) == 84 + 50 * count
    return np.frombuffer(content, record, offset=84)["corners"].astype(float)


@pytest.mark.parametrize("diameter", [3.0, 13.0])
def test_half_a_mould_of_a_sphere(diameter: float) -> None:
    radius = diameter / 2
    expected = np.pi * (radius + 3) ** 2 * (radius + 3) - 2 / 3 * np.pi * radius**3
    check(sphere_mould(diameter), expected)


@pytest.mark.parametrize(("diameter", "height"), [(20.0, 10.0), (90.0, 30.0)])
def test_a_cup(diameter: float, height: float) -> None:
    radius = diameter / 2
    check(cup(diameter, height), np.pi * ((radius + 3) ** 2 * (height + 3) - radius**2 * height))


def check(triangles: np.ndarray, expected: float) -> None:
    stored = read_back(stl_bytes(triangles, "mould"))
    np.testing.assert_allclose(stored, triangles, atol=1e-5, rtol=0)
    places = np.rint(stored * 1e4).astype(np.int64) + 2**20  # tenths of a micrometre, 21 bits each
    corner = np.unique(places @ (1 << np.array([42, 21, 0])), return_inverse=True)[1].reshape(-1, 3)
    there, back = corner, np.roll(corner, -1, axis=1)
    one_way, count = np.unique(there * len(stored) * 3 + back, return_counts=True)
    assert (count == 1).all()
    assert np.array_equal(one_way, np.unique(back * len(stored) * 3 + there))  # watertight, one orientation
    volume = np.linalg.det(stored).sum() / 6  # by the divergence theorem; negative where triangles point inwards
    assert volume == pytest.approx(expected, rel=1e-3)


def test_sizes_that_nobody_prints_are_refused() -> None:
    with pytest.raises(InputError, match="diameter_mm must lie in"):
        sphere_mould(0.1)
