from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

import tsis

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis


@pytest.mark.parametrize("command", ["demo", "examine", "simulate"])
def test_help_ends_with_an_example(run_tsis: RunTsis, command: str) -> None:
    finished = run_tsis(command, "--help")
    assert finished.code == 0
    assert f"Example: tsis {command}" in " ".join(finished.out.split())
    assert "--json" in finished.out


def test_version(run_tsis: RunTsis) -> None:
    assert run_tsis("--version").out.strip() == f"tsis {tsis.__version__}"


def test_an_unknown_option_ends_with_2(run_tsis: RunTsis) -> None:
    assert run_tsis("demo", "--dept-mm", "3").code == 2


@pytest.mark.system
def test_the_installed_program_prints_no_traceback(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "from tsis.cli import main; main()", "examine", "absent.png"]
    finished = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60)
    assert finished.returncode == 2
    assert "Traceback" not in finished.stderr
    assert "absent.png" in finished.stderr


@pytest.mark.system
def test_importing_loads_no_room_and_touches_nothing(tmp_path: Path) -> None:
    code = "import sys, tsis; print(sorted(name for name in sys.modules if name.startswith(('cv2', 'matplotlib'))))"
    finished = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=60
    )
    assert finished.stdout.strip() == "[]"
    assert list(tmp_path.iterdir()) == []
