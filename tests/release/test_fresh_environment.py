"""What somebody has who installs the built wheel, and nothing of this repository."""

from __future__ import annotations

import json
import subprocess
import sys
import venv
from pathlib import Path

import pytest

import tsis

pytestmark = pytest.mark.release
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs of a new environment with the wheel in it."""
    folder = tmp_path_factory.mktemp("fresh")
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    subprocess.run(build, check=True)
    (wheel,) = folder.glob("tsis-*.whl")
    venv.create(folder / "environment", with_pip=True)
    programs = folder / "environment" / "bin"
    pinned = ["--constraint", str(ROOT / "constraints.txt")]
    subprocess.run([programs / "python", "-m", "pip", "install", "--quiet", *pinned, str(wheel)], check=True)
    return programs


def run(programs: Path, folder: Path, *arguments: str) -> str:
    command = [str(programs / "tsis"), *arguments]
    return subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout


def test_version_is_that_of_the_repository(programs: Path, tmp_path: Path) -> None:
    assert run(programs, tmp_path, "--version") == f"tsis {tsis.__version__}\n"


def test_demo_finds_the_inclusion(programs: Path, tmp_path: Path) -> None:
    found = json.loads(run(programs, tmp_path, "demo", "--json"))["estimate"]["parameters"]["diameter_mm"]
    low, high = found["interval_90"]
    assert low < 10.0 < high


def test_points_are_matched(programs: Path, tmp_path: Path) -> None:
    points = [(x, y) for x in range(6) for y in range(x + 2)]
    (tmp_path / "a.csv").write_text("".join(f"{x},{y}\n" for x, y in points))
    (tmp_path / "b.csv").write_text("".join(f"{x + 3},{y - 1}\n" for x, y in points))
    run(programs, tmp_path, "match", "a.csv", "b.csv", "--out", "moved.csv")
    assert (tmp_path / "moved.csv").read_text().count("\n") >= len(points)
