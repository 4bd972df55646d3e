"""The performance card and repeatability of a study: checks that a biased device fails, pages, commands."""

from __future__ import annotations

import json
import math
import re
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest
from statsmodels.formula.api import ols
from statsmodels.stats.anova import anova_lm
from tests.cli.published import faults
from tests.study.made import HEADINGS, made_study, table
from typer.testing import CliRunner

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.cli.study import app
from tsis.errors import InputError, RecordsError
from tsis.present.html import html_bytes
from tsis.present.precision import precision_page
from tsis.study.card import (
    OPERATORS,
    PROBES,
    Precision,
    analyse_precision,
    performance_card,
    reference_targets,
    rehearse_reference_run,
)
from tsis.study.folder import new_study, open_study, read_seal, unblind
from tsis.study.readings import import_readings

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.study.folder import Study


NOW = datetime(2026, 5, 4, tzinfo=UTC)


def read(folder: Path, *, scale: float = 1.0, seed: int = 0) -> Study:
    """Reference phantoms read by two operators with a scatter of 2 %, all sizes times ``scale``."""
    study = new_study(folder / "study", reference_targets(), seed=5, probe="tsis-2011", repeats=3, actor="maker")
    rng, rows = np.random.default_rng(seed), [HEADINGS]
    for operator in ("A", "B"):
        for repeat in (1, 2, 3):
            for code, truth in read_seal(study)[0].truths.items():
                sizes = [f"{scale * value * (1 + 0.02 * rng.standard_normal()):.4f}" for value in truth.values.values()]
                rows.append(
                    ",".join([code, str(float(truth.has_inclusion)), operator, str(repeat), *(sizes or [""] * 3)])
                )
    (folder / "r.csv").write_text("\n".join(rows), encoding="utf-8")
    return unblind(import_readings(study, folder / "r.csv", device="feeler", actor="A"), by="Ada")


def test_a_faultless_device_passes_and_a_biased_one_fails(tmp_path: Path) -> None:
    (tmp_path / "good").mkdir()
    (tmp_path / "bad").mkdir()
    card = performance_card(read(tmp_path / "good"), now=NOW)
    assert card.passed, [check for check in card.checks if check.passed is False]
    assert {item.quantity for item in card.results} == {"diameter_mm", "depth_mm", "young_kpa"}
    failed = [c.name for c in performance_card(read(tmp_path / "bad", scale=1.3), now=NOW).checks if c.passed is False]
    assert "diameter_mm: slope of the line" in failed or "diameter_mm: bias" in failed


def test_a_faultless_device_seldom_fails(tmp_path: Path) -> None:
    passed = []
    for seed in range(100, 106):
        (tmp_path / str(seed)).mkdir()
        passed.append(performance_card(read(tmp_path / str(seed), seed=seed), now=NOW).passed)
    assert sum(passed) >= 5


def test_the_command_writes_two_sheets(tmp_path: Path) -> None:
    study = read(tmp_path)
    arguments = ["card", str(study.folder), "--out", str(tmp_path / "out"), "--json"]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    document = json.loads(done.output)
    assert faults(document) == []
    assert faults(json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))) == []
    assert document["passed"]
    assert document["detection"] == {"true_positives": 7, "present": 7, "false_positives": 0, "absent": 2}
    paper = (tmp_path / "out" / "report.pdf").read_bytes()
    assert len(re.findall(rb"/Type /Page\b", paper)) == 2
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    for text in ("Performance card: feeler", "curvature", "head of the log", "numpy"):
        assert text in page


def test_options_of_another_run_are_refused_for_a_study_that_exists(tmp_path: Path) -> None:
    study = read(tmp_path)
    options = ["--probe", "tsis-2011", "--operator", "Eve", "--repeats", "9", "--seed", "2", "--strain", "small"]
    done = CliRunner().invoke(app, ["card", str(study.folder), "--out", str(tmp_path / "out"), *options])
    assert isinstance(done.exception, InputError)
    assert "--probe and --operator and --repeats and --seed and --strain must be left out" in str(done.exception)
    assert not (tmp_path / "out").exists()


def test_a_changed_log_fails_a_check(tmp_path: Path) -> None:
    study = read(tmp_path)
    log = study.folder / "log.jsonl"
    log.write_text(log.read_text().replace('"maker"', '"Maker"', 1))
    assert not performance_card(study, now=NOW).checks[0].passed


@pytest.mark.slow
def test_the_guided_run_of_a_virtual_probe(tmp_path: Path) -> None:
    study = rehearse_reference_run(tmp_path / "run", probe="tsis-domed", repeats=2, seed=17, strain="small")
    card = performance_card(study, now=NOW)
    assert {reading.operator for reading in study.readings} == {"A", "B"}
    counts = card.decisions.counts()
    assert counts is not None
    assert counts.true_positives >= 5
    assert counts.false_positives == 0
    of = {item.quantity: item for item in card.results}
    assert abs(of["diameter_mm"].relative_bias) < 0.05
    assert of["diameter_mm"].within.within_cv is not None
    assert of["diameter_mm"].within.within_cv < 0.05  # one probe: its own errors do not scatter


LEFT_OUT = 2  # targets without a modulus in one reading


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """Two devices, two operators and three repeats; one device lacks two moduli."""
    folder = tmp_path_factory.mktemp("precision")
    made = made_study(folder / "study", present=8, blank=2, repeats=3)
    inside = [code for code, truth in read_seal(made)[0].truths.items() if truth.has_inclusion]
    for device, seed in (("feeler", 0), ("rival", 5)):
        rows = table(made, seed=seed, operators=("Cleo", "Dan")).splitlines()
        for code in inside[:LEFT_OUT] if device == "rival" else []:
            at = next(number for number, row in enumerate(rows) if row.startswith(code))
            rows[at] = rows[at].rsplit(",", 1)[0] + ","
        (folder / "r.csv").write_text("\n".join(rows), encoding="utf-8")
        made = import_readings(made, folder / "r.csv", device=device, threshold=0.5, actor="Cleo")
    return unblind(made, by="Ada")


def of(study: Study, device: str, quantity: str, over: str = OPERATORS) -> Precision:
    results = analyse_precision(study).results
    return next(each for each in results if (each.quantity, each.over) == (quantity, over) and device in each.device)


@pytest.mark.parametrize("quantity", ["diameter_mm", "young_kpa"])
def test_numbers_are_those_of_statsmodels(study: Study, quantity: str) -> None:
    found = of(study, "rival", quantity)
    assert len(found.incomplete) == (LEFT_OUT if quantity == "young_kpa" else 0)
    rows = pd.DataFrame(
        [
            {"y": item.values[quantity], "target": item.code, "operator": item.operator}
            for item in study.readings
            if item.device == "rival" and item.code in found.complete
        ]
    )
    squares = anova_lm(ols("y ~ C(target) * C(operator)", rows).fit())
    mean_square = squares["mean_sq"]
    assert found.within.within_sd == pytest.approx(math.sqrt(mean_square["Residual"]), rel=1e-9)
    assert found.within.degrees_of_freedom == squares["df"]["Residual"]
    n = len(found.complete)
    operator = max((mean_square["C(operator)"] - mean_square["C(target):C(operator)"]) / (3 * n), 0)
    interaction = (mean_square["C(target):C(operator)"] - mean_square["Residual"]) / 3
    assert found.between is not None
    assert found.between.operator_sd == pytest.approx(math.sqrt(operator), rel=1e-9, abs=1e-9)
    assert found.between.interaction_sd == pytest.approx(math.sqrt(max(interaction, 0)), rel=1e-9, abs=1e-9)
    assert found.between.sd == pytest.approx(
        math.sqrt(
            (mean_square["C(operator)"] - mean_square["C(target):C(operator)"]) / (3 * n)
            + interaction
            + mean_square["Residual"]
        ),
        rel=1e-9,
    )
    first = rows.groupby(["operator", "target"])["y"].first()
    difference = first["Cleo"] - first["Dan"]
    limits = found.limits["Cleo", "Dan"]
    assert limits.bias == pytest.approx(difference.mean())
    assert limits.limits()[1] - limits.bias == pytest.approx(1.959964 * difference.std(), rel=1e-6)


def test_bias_and_line_are_those_of_the_target_means(study: Study) -> None:
    found = of(study, "feeler", "diameter_mm")
    truths = read_seal(study)[0].truths
    means = {
        code: np.mean([r.values["diameter_mm"] for r in study.readings if r.code == code and r.device == "feeler"])
        for code in found.complete
    }
    true = np.array([truths[code].values["diameter_mm"] for code in means])
    read = np.array(list(means.values()))
    assert found.errors.bias == pytest.approx((read - true).mean())
    assert found.relative_bias == pytest.approx((read / true - 1).mean())
    assert found.line is not None
    assert found.line.slope == pytest.approx(np.polyfit(true, read, 1)[0])
    assert of(study, "feeler", "young_kpa").line is None  # all moduli are 100 kPa


def test_probes_are_compared_with_one_operator(study: Study) -> None:
    found = of(study, "feeler", "depth_mm", PROBES)
    assert found.device == "feeler and rival, operator Cleo"
    assert found.conditions == ("feeler", "rival")
    assert found.repeats == 3


def test_a_blind_study_and_one_without_repeats_are_refused(tmp_path: Path) -> None:
    blind = made_study(tmp_path / "blind", repeats=2)
    with pytest.raises(RecordsError, match="must be unblinded"):
        analyse_precision(blind)
    single = made_study(tmp_path / "single", present=2, blank=2)
    (tmp_path / "r.csv").write_text(table(single), encoding="utf-8")
    single = unblind(import_readings(single, tmp_path / "r.csv", device="feeler", actor="Cleo"), by="Ada")
    with pytest.raises(RecordsError, match="at least 2 repeats"):
        analyse_precision(single)


def test_the_page_is_whole(study: Study) -> None:
    page = html_bytes(precision_page(analyse_precision(study))).decode()
    assert page.count(RESEARCH_USE_ONLY) == 2
    assert not re.search(r"\b(nan|inf)\b", re.sub(r'src="data:[^"]*"', "", page), re.IGNORECASE)
    for part in ("within-subject CV", "reproducibility coefficient", "Cleo less Dan, lower limit", "slope of the line"):
        assert part in page


def test_the_commands_print_described_documents(study: Study, tmp_path: Path) -> None:
    done = CliRunner().invoke(
        app, ["repeatability", str(open_study(study.folder).folder), "--out", str(tmp_path / "out"), "--json"]
    )
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert faults(document) == []
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"index.html", "report.pdf", "result.json"}
    assert faults(json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))) == []
    assert len(document["results"]) == 9
    planned = CliRunner().invoke(app, ["size", "--width", "0.2", "--json"])
    assert planned.exit_code == 0, planned.output
    document = json.loads(planned.stdout)
    assert faults(document) == []
    assert document["designs"][1] | {"upper_repeatability": 0, "upper_reproducibility": 0} == {
        "operators": 2,
        "repeats": 3,
        "phantoms": 18,
        "presses": 108,
        "upper_repeatability": 0,
        "upper_reproducibility": 0,
    }
