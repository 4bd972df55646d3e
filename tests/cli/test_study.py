"""Blinded studies from the command line, and what ``tsis study plan`` prints, writes and refuses."""

from __future__ import annotations

import json
import signal
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import typer
from tests.cli.published import faults
from tests.study.made import HEADINGS, table
from typer.testing import CliRunner

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.cli.study import plan
from tsis.errors import InputError
from tsis.study.folder import open_study
from tsis.study.plan import DeviceReading
from tsis.study.search import ScanPlan, measured_detection_range

if TYPE_CHECKING:
    from tests.cli.conftest import RunTsis


def made(run_tsis: RunTsis, *options: str) -> Path:
    done = run_tsis("study", "new", "trial", "--probe", "tsis-2011", "--seed", "2", *options)
    assert done.code == 0, done.err
    return Path("trial")


def fed(run_tsis: RunTsis, folder: Path, device: str = "feeler") -> None:
    Path("in.csv").write_text(table(open_study(folder)), encoding="utf-8")
    assert run_tsis("study", "import", folder, "in.csv", "--device", device).code == 0


def test_a_whole_study_of_another_device(run_tsis: RunTsis) -> None:
    folder = made(run_tsis, "--present", "2", "--blank", "2")
    shown = json.loads(run_tsis("study", "show", folder, "--json").out)
    assert (shown["left"], shown["unblinded"]) == (4, None)
    assert shown["next_code"] == open_study(folder).plan.codes[0]
    fed(run_tsis, folder)
    check_export_and_show(run_tsis, folder)
    found = json.loads(run_tsis("study", "analyse", folder, "--by", "Ada", "--yes", "--json").out)
    assert found["notice"] == RESEARCH_USE_ONLY
    assert [one["device"] for one in found["devices"]] == ["feeler"]
    check_analysis(run_tsis, folder, found)


def test_scores_on_one_side_of_the_threshold_are_told_at_the_import(run_tsis: RunTsis) -> None:
    folder = made(run_tsis, "--present", "2", "--blank", "2")
    codes = open_study(folder).plan.codes
    Path("in.csv").write_text("\n".join([HEADINGS, *(f"{code},4,Ben,1,,," for code in codes)]), encoding="utf-8")
    refused = run_tsis("study", "import", folder, "in.csv", "--device", "feeler")
    assert (refused.code, open_study(folder).readings) == (2, ())
    assert "where no threshold is given" in refused.err
    done = run_tsis("study", "import", folder, "in.csv", "--device", "feeler", "--threshold", "3", "--json")
    assert (done.code, json.loads(done.out)["threshold"]) == (0, 3.0)
    assert "All 4 scores of feeler lie at or above its threshold, 3" in done.err


@pytest.mark.slow
def test_a_whole_study(run_tsis: RunTsis) -> None:
    folder = made(run_tsis, "--present", "2", "--blank", "2")
    done = json.loads(
        run_tsis("study", "run", folder, "--operator", "Ada", "--strain", "small", "--save", "records", "--json").out
    )
    assert (done["entered"], done["undecided"], done["left"]) == (4, 0, 0)
    fed(run_tsis, folder)
    check_export_and_show(run_tsis, folder)
    found = json.loads(run_tsis("study", "analyse", folder, "--by", "Ada", "--yes", "--json").out)
    assert [one["device"] for one in found["devices"]] == ["virtual tsis-2011", "feeler"]
    assert found["devices"][0]["counts"]["true_positives"] == 2
    check_analysis(run_tsis, folder, found)
    stored = json.loads(run_tsis("records", "list", "--store", "records", "--json").out)
    assert len(stored["targets"]) == 4


def check_export_and_show(run_tsis: RunTsis, folder: Path) -> None:
    out = run_tsis("study", "export", folder, "out.csv", "--device", "feeler")
    assert out.code == 0
    assert Path("out.csv").read_text(encoding="utf-8").startswith(HEADINGS)
    shown_now = run_tsis("study", "show", folder)
    for word in ("detection", "blank", "inclusion"):
        assert word not in shown_now.out


def check_analysis(run_tsis: RunTsis, folder: Path, found: dict[str, Any]) -> None:
    assert {path.name for path in Path(found["folder"]).iterdir()} == {
        "analysis.json",
        "readings.csv",
        "report.html",
        "report.pdf",
    }
    assert faults(json.loads((Path(found["folder"]) / "analysis.json").read_text(encoding="utf-8"))) == []
    checked = run_tsis("study", "verify", folder, "--head", found["head"])
    assert checked.code == 0
    assert "as it was written" in checked.out
    refused = run_tsis("study", "run", folder, "--operator", "Ben")
    assert refused.code == 1
    assert "unblinded" in refused.err


def test_nobody_is_asked_where_nobody_answers(run_tsis: RunTsis) -> None:
    folder = made(run_tsis)
    fed(run_tsis, folder)
    done = run_tsis("study", "analyse", folder, "--by", "Ada")
    assert (done.code, open_study(folder).unblinded) == (2, None)
    assert "--yes must be given" in done.err


@pytest.mark.parametrize(("answer", "unblinded"), [("n\n", False), ("y\n", True)])
def test_unblinding_is_asked_for(
    run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch, answer: str, unblinded: bool
) -> None:
    import io
    import sys

    folder = made(run_tsis)
    fed(run_tsis, folder)
    terminal = io.StringIO(answer)
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stdin", terminal)
    done = run_tsis("study", "analyse", folder, "--by", "Ada")
    assert (open_study(folder).unblinded is not None) == unblinded
    assert done.code == (0 if unblinded else 1)


def test_a_study_that_is_not_read_whole_is_not_unblinded_unasked(run_tsis: RunTsis) -> None:
    folder = made(run_tsis)
    rows = table(open_study(folder)).splitlines(keepends=True)
    Path("in.csv").write_text("".join(rows[:-2]), encoding="utf-8")
    assert run_tsis("study", "import", folder, "in.csv", "--device", "feeler").code == 0
    done = run_tsis("study", "analyse", folder, "--by", "Ada", "--yes")
    assert done.code == 2
    assert "'feeler' lacks 2 of 16" in done.err
    assert open_study(folder).unblinded is None
    assert run_tsis("study", "analyse", folder, "--by", "Ada", "--yes", "--incomplete").code == 0


def test_a_change_ends_verify_with_1(run_tsis: RunTsis) -> None:
    folder = made(run_tsis)
    fed(run_tsis, folder)
    (folder / "study.json").write_bytes((folder / "study.json").read_bytes() + b"\n")
    done = run_tsis("study", "verify", folder)
    assert done.code == 1
    assert "study.json was changed" in done.out
    result = run_tsis("study", "verify", folder, "--json")
    assert result.code == 1
    assert json.loads(result.out)["sound"] is False


def test_ctrl_c_between_readings_keeps_what_was_read(run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch) -> None:
    from tsis.study import folder as folder_of_studies
    from tsis.study import readings as pressing

    folder = made(run_tsis, "--present", "2", "--blank", "1")
    enter = folder_of_studies.enter_readings

    def interrupted(*arguments: object, **named: object) -> object:
        assert threading.current_thread() is threading.main_thread()
        signal.raise_signal(signal.SIGINT)
        return enter(*arguments, **named)  # type: ignore[arg-type]

    def unread(
        _rig: object, _truth: object, _store: object, *, code: str, operator: str, repeat: int, seed: int
    ) -> DeviceReading:
        assert seed == 0
        return DeviceReading(
            code=code, device=device, operator=operator, repeat=repeat, score=None, reason="not pressed"
        )

    device = open_study(folder).plan.device
    for name in ("irradiance", "press_tables"):  # what a press needs is not the subject here
        monkeypatch.setattr(pressing, name, lambda *_, **__: None)
    monkeypatch.setattr(pressing._Rig, "read", unread)
    monkeypatch.setattr(pressing, "enter_readings", interrupted)
    done = run_tsis("study", "run", folder, "--operator", "Ada", "--strain", "small")
    assert done.code == 130
    assert "Repeat the command" in done.err
    assert len(open_study(folder).readings) == 1
    monkeypatch.undo()


def test_targets_of_ones_own_and_drawn_ones(run_tsis: RunTsis) -> None:
    Path("truth.csv").write_text("label,diameter_mm,depth_mm,young_kpa\ngel,,,\nlump,6,5,90\n", encoding="utf-8")
    done = json.loads(run_tsis("study", "new", "own", "--truth", "truth.csv", "--json").out)
    assert done["targets"] == len(done["codes"]) == 2
    drawn = [
        "study",
        "new",
        "drawn",
        "--like",
        "random",
        "--present",
        "5",
        "--blank",
        "4",
        "--forces",
        "0.5,0.8",
        "--json",
    ]
    assert json.loads(run_tsis(*drawn).out)["targets"] == 9
    assert open_study("drawn").plan.forces_n == (0.5, 0.8)
    assert open_study("drawn").plan.seed is None


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--truth", "truth.csv", "--present", "3"], "leave out --present"),
        (["--forces", "0.5;1"], "--forces must be numbers"),
        (["--forces", "0"], "forces_n must lie in"),
        (["--present", "0", "--blank", "0"], "a study needs a target"),
        (["--probe", "tsis-2012"], "did you mean 'tsis-2011'"),
        (["--truth", "absent.csv"], "does not exist"),
    ],
)
def test_what_makes_no_study_is_one_sentence(run_tsis: RunTsis, options: list[str], words: str) -> None:
    done = run_tsis("study", "new", "trial", *options)
    assert done.code == 2
    assert words in done.err
    assert done.err.count("\n") == 1
    assert not Path("trial").exists()


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
