"""What somebody has who installs the built wheel, and nothing of this repository."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
from release.extras import FIRST, PLAIN, built_wheel, cost, extras, installed
from release.notebooks import NOTEBOOKS, code_of, five_lines

import tsis
from tsis.present.labels import quantity_of

pytestmark = pytest.mark.release
README = Path(__file__).parents[2] / "README.md"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built_wheel(tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def programs(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs of a new environment with the wheel in it."""
    return installed(wheel, PLAIN, tmp_path_factory.mktemp("fresh") / "environment")


def run(programs: Path, folder: Path, *arguments: str) -> str:
    command = [str(programs / "tsis"), *arguments]
    return subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout


def test_version_is_that_of_the_repository(programs: Path, tmp_path: Path) -> None:
    assert run(programs, tmp_path, "--version") == f"tsis {tsis.__version__}\n"


def test_demo_finds_what_the_readme_prints(programs: Path, tmp_path: Path) -> None:
    found = json.loads(run(programs, tmp_path, "demo", "--json"))["estimate"]["parameters"]
    rows = [line.strip("| ").split(" | ") for line in README.read_text("utf-8").splitlines() if line.startswith("| ")]
    printed = {heading: values for heading, *values in rows}
    for name, one in found.items():
        mean, interval, *spreads, truth = printed[quantity_of(name).axis]
        means = [float(mean), *map(float, interval.split(" to ")), float(truth)]
        assert [one["mean"], *one["interval_90"], one["truth"]] == pytest.approx(means, 0.01)
        assert [one["sd"], one["prior_sd"]] == pytest.approx([float(each) for each in spreads], 0.05)


def test_the_five_lines_of_the_readme_lead_to_a_picture(programs: Path, tmp_path: Path) -> None:
    run(programs, tmp_path, "demo")
    command = [str(programs / "python"), "-W", "error", "-c", five_lines()]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    assert (tmp_path / "posterior.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_ends_in_its_number(programs: Path, tmp_path: Path, path: Path) -> None:
    command = [str(programs / "python"), "-W", "error", "-c", code_of(path)]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)


def test_saved_frames_are_examined(programs: Path, tmp_path: Path) -> None:
    run(programs, tmp_path, "demo", "--out", "demo")
    forces = ("0.5", "1")
    frames = [f"demo/target-{force}N.png" for force in forces]
    options = [
        *(text for force in forces for text in ("--force-n", force)),
        *(text for force in forces for text in ("--reference-press", f"demo/reference-{force}N.png")),
        *("--calibration", "demo/calibration.json", "--scale-mm", "0.0336,0.0392", "--json"),
    ]
    found = json.loads(run(programs, tmp_path, "examine", *frames, *options))["estimate"]["parameters"]["diameter_mm"]
    made = json.loads((tmp_path / "demo" / "result.json").read_text())["estimate"]["parameters"]["diameter_mm"]
    assert found["interval_90"] == made["interval_90"]


def test_points_are_matched(programs: Path, tmp_path: Path) -> None:
    points = [(x, y) for x in range(6) for y in range(x + 2)]
    (tmp_path / "a.csv").write_text("".join(f"{x},{y}\n" for x, y in points))
    (tmp_path / "b.csv").write_text("".join(f"{x + 3},{y - 1}\n" for x, y in points))
    run(programs, tmp_path, "match", "a.csv", "b.csv", "--out", "moved.csv")
    assert (tmp_path / "moved.csv").read_text().count("\n") >= len(points)


@pytest.mark.parametrize("extra", [PLAIN, *extras()])
def test_each_extra_alone_is_enough_for_what_it_brings(wheel: Path, tmp_path: Path, extra: str) -> None:
    assert set(FIRST) == {PLAIN, *extras()}
    measured = cost(wheel, extra, tmp_path)
    if extra == PLAIN:
        assert measured.packages <= 40
        assert measured.megabytes <= 680


WITHOUT = {
    "records list": ("the store of records", "SQLAlchemy", "records"),
    "demo --save": ("the store of records", "SQLAlchemy", "records"),
    "console": ("the console", "NiceGUI", "console"),
    "login list": ("the console", "NiceGUI", "console"),
    "acquire --camera opencv:0": ("the camera source opencv", "OpenCV", "camera"),
    "acquire --camera pylon:": ("the camera source pylon", "pypylon", "camera-pylon"),
    "detect train c.json --young-kpa 60 --none 1": ("tsis detect", "scikit-learn", "study"),
    "sweep run plan.toml --out data": ("sweep", "pyarrow", "cluster"),
}


@pytest.mark.parametrize("line", WITHOUT)
def test_without_an_extra_one_sentence_names_it_and_the_command_that_brings_it(
    programs: Path, tmp_path: Path, line: str
) -> None:
    feature, product, extra = WITHOUT[line]
    (tmp_path / "plan.toml").write_text(run(programs, tmp_path, "sweep", "example"))
    command = [str(programs / "tsis"), *line.split()]
    finished = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)
    assert finished.returncode == 2
    assert finished.stderr.count("\n") == 1
    assert feature in finished.stderr
    assert f"{product}, which is not installed" in finished.stderr
    assert finished.stderr.endswith(f'install it with: python -m pip install "tsis[{extra}]"\n')


def test_the_doctor_names_what_is_missing(programs: Path, tmp_path: Path) -> None:
    findings = json.loads(run(programs, tmp_path, "doctor", "--no-cameras", "--json"))["findings"]
    states = {item["what"]: item["state"] for item in findings}
    assert states["numpy"] == "ok"
    for extra in set(extras()) - {"camera-aravis"}:  # which names a system library
        assert states[f"extra {extra}"] == "absent"
