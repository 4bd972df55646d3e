"""``tsis examine --budget``: the uncertainty budget for people, programs and the page."""

from __future__ import annotations

import io
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from rich.console import Console
from tests.cli.kept_demo import FORCES, FRAMES, KNOWN, told
from tests.present.pdf_readers import sheet_count, sheets

import tsis
from tsis.model.estimate import Estimate
from tsis.present.page import Table
from tsis.present.terminal import rich_table

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis

REFERENCES = ("--reference-press", "demo/reference-0.5N.png", "--reference-press", "demo/reference-1N.png")
BUDGET = ("examine", *FRAMES, *KNOWN, *FORCES, *REFERENCES, "--budget")


@pytest.mark.slow
def test_the_budget_of_the_demo(run: RunTsis, kept: Path, tmp_path: Path) -> None:
    document = told(run, *BUDGET, "--pdf", "--out", tmp_path / "made")
    budget, estimate = document["budget"], document["estimate"]
    assert budget["withheld"] == {"young_kpa": "not identified"}
    assert set(budget["parameters"]) == {"diameter_mm", "depth_mm"}
    for name, quantity in budget["parameters"].items():
        assert quantity["value"] == estimate["parameters"][name]["mean"]
        assert quantity["sampled_sd"] == estimate["parameters"][name]["sd"]
        assert quantity["combined"] == pytest.approx(
            math.hypot(*(part["contribution"] for part in quantity["components"]))
        )
        assert quantity["expanded"] == pytest.approx(1.96 * quantity["combined"], rel=1e-3)
        assert quantity["departure"] == pytest.approx(quantity["sampled_sd"] / quantity["combined"] - 1)
        assert abs(quantity["departure"]) < 0.5
    documented = budget["parameters"]["diameter_mm"]  # in docs/explanation/intervals.md
    assert documented["combined"] == pytest.approx(0.111, abs=0.005)
    assert documented["departure"] == pytest.approx(0.15, abs=0.05)
    largest = max(documented["components"], key=lambda part: part["contribution"])
    assert (largest["source"], round(largest["fraction"], 1)) == ("prior of the modulus", 0.6)
    assert [force["image"] for force in budget["forces"]] == [
        *("target-0.5N.png", "target-1N.png", "reference-0.5N.png", "reference-1N.png")
    ]
    response = tsis.load_calibration(kept / "demo" / "calibration.json").response
    assert [force["combined"] for force in budget["forces"]] == pytest.approx(
        [response.force_sd * force["value"] for force in budget["forces"]]
    )
    page = (tmp_path / "made" / "index.html").read_text(encoding="utf-8")
    for shown in ("Uncertainty budget: depth", "force of each frame", "sd of the samples", "target-0.5N.png"):
        assert shown in page
    assert sheet_count((tmp_path / "made" / "report.pdf").read_bytes()) > 2
    plain = told(run, *(part for part in BUDGET if part != "--budget"), "--out", tmp_path / "without")
    assert "budget" not in plain
    assert plain["estimate"]["parameters"] == estimate["parameters"]


@pytest.mark.parametrize("columns", [80, 120])
def test_a_terminal_shows_whole_numbers(columns: int) -> None:
    rows = (
        ("heterogeneity of the tissue", "B, rectangular", "0.00179 mm2", "9.97e+03", "0.00019", "100.0%"),
        ("sd of the samples", "", "", "", "10.9", "+13%"),
    )
    first = ("source", "type, distribution", "standard uncertainty")
    headings = (*first, "sensitivity / kPa per unit", "contribution / kPa", "variance")
    table = rich_table(Table(title="Budget", columns=headings, values=rows))
    shown = Console(file=io.StringIO(), width=columns)
    shown.print(table)
    assert isinstance(shown.file, io.StringIO)
    lines = shown.file.getvalue().splitlines()
    assert max(map(len, lines)) <= columns
    words = " ".join(lines).split()
    for cell in (*headings, *(cell for row in rows for cell in row)):
        assert set(cell.split()) <= set(words)


def test_withheld_numbers_stay_withheld(run: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tsis.inclusion import budget
    from tsis.inclusion.estimation import analyse

    def untrusted(*args: Any, **options: Any) -> Any:
        found = analyse(*args, **options)
        estimate = Estimate(untrusted=found.estimate.untrusted, trusted=False, flags=("model_does_not_fit",))
        return replace(found, estimate=estimate)

    monkeypatch.setattr(budget, "analyse", untrusted)
    finished = run(*BUDGET, "--out", str(tmp_path / "made"))
    assert finished.code == 3
    assert "The uncertainty budget of the depth is withheld: not to be trusted." in " ".join(finished.out.split())
    assert "Uncertainty budget: depth" not in finished.out
    assert "sd of the samples" not in (tmp_path / "made" / "index.html").read_text(encoding="utf-8")


@pytest.mark.system  # poppler
def test_the_budget_is_in_the_pdf(run: RunTsis, tmp_path: Path) -> None:
    told(run, *BUDGET, "--pdf", "--out", tmp_path / "made")
    printed = " ".join(sheets((tmp_path / "made" / "report.pdf").read_bytes(), tmp_path))
    for shown in ("Uncertainty budget: depth", "force of each frame", "sd of the samples", "target-0.5N.png"):
        assert shown in printed
