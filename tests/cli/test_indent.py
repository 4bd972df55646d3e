"""The command ``tsis indent``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


def curve_file(path: Path, young_kpa: float) -> None:
    position = np.linspace(-0.3, 0.1, 400)
    force = 4 / 3 * young_kpa * 1e-3 / 0.76 * np.sqrt(3.0) * np.maximum(position, 0.0) ** 1.5
    force += 1e-3 * force.max() * np.random.default_rng(4).standard_normal(400)
    rows = "\n".join(f"{x:.6f},{1e3 * y:.6f}" for x, y in zip(position, force, strict=True))
    path.write_text(f"Travel [mm],Load [mN]\n{rows}\n")


def test_several_files_have_one_row_each(run_tsis: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    curve_file(tmp_path / "soft.csv", 8.0)
    curve_file(tmp_path / "hard.csv", 80.0)
    finished = run_tsis("indent", "soft.csv", "hard.csv", "--radius-mm", "3", "--json", "--html", "page.html")
    found = json.loads(finished.out)
    means = [each["estimate"]["parameters"]["young_kpa"]["mean"] for each in found["curves"]]
    assert [each["curve"] for each in found["curves"]] == ["soft.csv", "hard.csv"]
    assert np.allclose(means, [8.0, 80.0], rtol=0.06)
    assert "Research use only" in (tmp_path / "page.html").read_text()
    shown = run_tsis("indent", "soft.csv", "soft.csv", "hard.csv", "--radius-mm", "3").out
    assert "soft.csv" in shown
    assert "As repeats of one sample, 3 curves give" in " ".join(shown.split())


def test_a_missing_radius_is_told_in_one_sentence(run_tsis: RunTsis, tmp_path: Path) -> None:
    curve_file(tmp_path / "soft.csv", 8.0)
    finished = run_tsis("indent", tmp_path / "soft.csv")
    assert finished.err.startswith("Error: radius_mm must be given")
    assert finished.code == 2


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--radius-mm", "3", "--half-angle-deg", "30"), "--half-angle-deg must be left out with --indenter ball"),
        (("--indenter", "cone", "--half-angle-deg", "30", "--radius-mm", "3"), "--radius-mm must be left out"),
        (("--radius-mm", "3", "--base", "sliding"), "--base must be given with --thickness-mm"),
        (("--radius-mm", "3", "--thickness-sd", "0.3"), "--thickness-sd must be given with --thickness-mm"),
        (("--radius-mm", "3", "--indenter", "wedge"), "no indenter is called 'wedge'"),
    ],
)
def test_an_option_that_would_be_ignored_is_refused(
    options: tuple[str, ...], told: str, run_tsis: RunTsis, tmp_path: Path
) -> None:
    curve_file(tmp_path / "soft.csv", 8.0)
    finished = run_tsis("indent", tmp_path / "soft.csv", *options)
    assert told in " ".join(finished.err.split())
    assert finished.code == 2


def test_base_and_thickness_sd_count_for_a_layer(run_tsis: RunTsis, tmp_path: Path) -> None:
    curve_file(tmp_path / "soft.csv", 8.0)
    layer = ("--radius-mm", "3", "--thickness-mm", "2", "--thickness-sd", "0.03", "--json")
    sliding, bonded = (
        json.loads(run_tsis("indent", tmp_path / "soft.csv", *layer, "--base", base).out)["curves"][0]["estimate"]
        for base in ("sliding", "bonded")
    )
    assert bonded["parameters"]["young_kpa"]["mean"] < sliding["parameters"]["young_kpa"]["mean"]
