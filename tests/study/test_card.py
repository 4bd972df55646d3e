"""The performance card: two sheets, checks that a biased device fails, and the guided run."""

from __future__ import annotations

import json
import re
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.cli.published import faults
from tests.study.made import HEADINGS
from typer.testing import CliRunner

from tsis.cli.study import app
from tsis.study.card import performance_card, reference_targets, rehearse_reference_run
from tsis.study.folder import new_study, read_seal, unblind
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
