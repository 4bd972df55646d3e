"""What a program that uses the built wheel sees: types for strict checkers, and a file that runs."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from release.extras import PLAIN, built_wheel, installed

pytestmark = pytest.mark.release
EXAMPLE = Path(__file__).parents[2] / "examples" / "first_estimate.py"


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs of a new environment with the wheel."""
    folder = tmp_path_factory.mktemp("consumer")
    return installed(built_wheel(folder / "wheel"), PLAIN, folder / "environment")


def test_the_example_finds_the_diameter(programs: Path, tmp_path: Path) -> None:
    command = [str(programs / "python"), "-W", "error", str(EXAMPLE)]
    printed = subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    low, high, truth = map(float, re.findall(r"\d+\.?\d*", printed))
    assert low < truth < high
    assert high - low < 2.0


def test_mypy_is_strict_and_content(programs: Path, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.py"
    wrong.write_text(EXAMPLE.read_text().replace('load_probe("tsis-domed")', "load_probe(7)"))
    command = [sys.executable, "-m", "mypy", "--strict", "--python-executable", str(programs / "python")]
    right = subprocess.run([*command, str(EXAMPLE)], cwd=tmp_path, check=False, capture_output=True, text=True)
    assert right.returncode == 0, right.stdout
    refused = subprocess.run([*command, str(wrong)], cwd=tmp_path, check=False, capture_output=True, text=True)
    assert '"load_probe" has incompatible type "int"' in refused.stdout


def test_pyright_is_strict_and_content(programs: Path, tmp_path: Path) -> None:
    pyright = shutil.which("pyright")
    if pyright is None:
        pytest.skip("pyright is not installed here")
    (tmp_path / "pyrightconfig.json").write_text('{"typeCheckingMode": "strict"}')
    shutil.copy(EXAMPLE, tmp_path)
    command = [pyright, "--pythonpath", str(programs / "python")]
    checked = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout
