"""``tsis study plan`` by itself: what it prints, writes and refuses."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
import typer
from typer.testing import CliRunner

from tsis.cli.study import plan
from tsis.errors import InputError
from tsis.study.search import ScanPlan, measured_detection_range

if TYPE_CHECKING:
    from pathlib import Path

TABLE = "diameter_mm,depth_mm,reach_mm\n4,4,3\n4,8,1\n10,4,6\n10,8,4\n"
AREA = ["--width-mm", "60", "--height-mm", "40"]


@pytest.fixture(name="app")
def the_app() -> typer.Typer:
    made = typer.Typer(pretty_exceptions_enable=False)
    made.command()(plan)
    return made


def test_a_plan_is_told_drawn_and_written(app: typer.Typer, tmp_path: Path) -> None:
    (tmp_path / "reach.csv").write_text(TABLE)
    asked = [*AREA, "--diameter-mm", "10", "--depth-mm", "8", "--detection-range", str(tmp_path / "reach.csv")]
    made = CliRunner().invoke(app, [*asked, "--json", "--out", str(tmp_path / "made")])
    assert made.exit_code == 0, made.output
    document = json.loads(made.stdout)
    assert document["notice"].startswith("Research use only")
    # half diagonals of at most 4 mm: 11 strips of 7 presses, found by hand among all pairs
    pairs = [(n, m) for n in range(1, 40) for m in range(1, 40) if (60 / n) ** 2 + (40 / m) ** 2 <= 64]
    assert document["presses"] == min(n * m for n, m in pairs)
    assert len(document["positions_mm"]) == document["presses"]
    by_hand = ScanPlan(
        width_mm=60, height_mm=40, strips=document["strips"], presses_a_strip=document["presses_a_strip"], radius_mm=12
    )
    assert document["positions_mm"] == by_hand.positions_mm.tolist()
    limits = {one["depth_mm"]: one["diameter_mm"] for one in document["smallest_found"]}
    worst = document["worst_distance_mm"]
    assert limits[8.0] == pytest.approx(4 + 6 * (worst - 1) / 3, rel=1e-6)
    assert limits[4.0] == pytest.approx(4 + 6 * (worst - 3) / 3, rel=1e-6)
    assert (tmp_path / "made" / "plan.png").read_bytes().startswith(b"\x89PNG")


def test_people_read_how_long_it_takes(app: typer.Typer) -> None:
    shown = CliRunner().invoke(
        app, [*AREA, "--overlap", "0.5", "--press-s", "6", "--speed-mm-s", "10", "--probe", "tsis-2011"]
    )
    assert shown.exit_code == 0, shown.output
    text = " ".join(shown.stdout.split())
    by_hand = ScanPlan(width_mm=60, height_mm=40, strips=5, presses_a_strip=4, radius_mm=12)
    assert f"{(20 * 6 + by_hand.travel_mm / 10) / 60:.1f} min" in text
    assert "Research use only" in text
    assert "The detection between presses is unknown" in text


def test_without_a_table_of_its_own_a_plan_takes_the_measured_one(app: typer.Typer) -> None:
    made = CliRunner().invoke(app, [*AREA, "--diameter-mm", "6", "--depth-mm", "8", "--json"])
    assert made.exit_code == 0, made.output
    document = json.loads(made.stdout)
    measured = measured_detection_range("tsis-domed")
    assert measured is not None
    assert document["worst_distance_mm"] <= measured(6, 8)
    for one in document["smallest_found"]:
        if one["diameter_mm"] is not None:
            assert measured(one["diameter_mm"], one["depth_mm"]) >= document["worst_distance_mm"] - 1e-6
    result = CliRunner().invoke(app, [*AREA, "--spacing-mm", "5"])
    assert "of this probe on the virtual rig" in " ".join(result.stdout.split())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "exactly one of --spacing-mm"),
        (["--spacing-mm", "5", "--overlap", "0.5"], "exactly one of --spacing-mm"),
        (["--diameter-mm", "5"], "together, and with --detection-range"),
        (
            ["--diameter-mm", "5", "--depth-mm", "6", "--probe", "tsis-2011"],
            "with --detection-range where none is known",
        ),
        (["--diameter-mm", "3", "--depth-mm", "4", "--detection-range", "{table}"], "got 0: choose a larger"),
        (["--spacing-mm", "-5"], "spacing_mm must lie"),
        (["--detection-range-mm", "5", "--detection-range", "none.csv"], "does not exist"),
    ],
)
def test_what_does_not_belong_together_is_refused(
    app: typer.Typer, tmp_path: Path, arguments: list[str], said: str
) -> None:
    (tmp_path / "reach.csv").write_text(TABLE)
    asked = [one.format(table=tmp_path / "reach.csv") for one in arguments]
    refused = CliRunner().invoke(app, [*AREA, *asked])
    assert isinstance(refused.exception, InputError)
    assert said in str(refused.exception)
