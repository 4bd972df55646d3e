"""Machine code on disk: thrown away when any source of its room changes; switched off, functions stay Python."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tsis.model

pytestmark = pytest.mark.system

ROOM = Path(tsis.model.__file__).parent
STEPS = """
import numpy as np
from copied_room.caller import twice
print(twice(3.0), *twice.stats.cache_hits.values())
"""


def copied_room(tmp_path: Path) -> Path:
    """A room with the compiler's file, a function, and another file whose function it calls."""
    room = tmp_path / "copied_room"
    room.mkdir()
    (room / "__init__.py").touch()
    shutil.copy(ROOM / "compiled.py", room)
    head = "from __future__ import annotations\nfrom copied_room.compiled import compiled\n"
    called = "@compiled\ndef factor() -> float:\n    return 2.0\n"
    (room / "called.py").write_text(head + called)
    caller = (
        "from copied_room.called import factor\n@compiled\ndef twice(x: float) -> float:\n    return factor() * x\n"
    )
    (room / "caller.py").write_text(head + caller)
    return room


def run(folder: Path, code: str, **variables: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(folder), **variables}
    return subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, env=environment
    ).stdout.strip()


def test_a_change_in_another_file_of_the_room_is_noticed(tmp_path: Path) -> None:
    room = copied_room(tmp_path)
    assert run(tmp_path, STEPS) == "6.0"
    assert run(tmp_path, STEPS) == "6.0 1", "from disk"
    called = room / "called.py"
    called.write_text(called.read_text().replace("2.0", "50.0"))
    assert run(tmp_path, STEPS) == "150.0"


def test_without_a_compiler_the_same_comes_out(tmp_path: Path) -> None:
    code = "from tsis.optics import guided_modes as f; print(*f([1.5], [2.0], wavelength_um=0.6).n_eff)"
    slow, fast = (run(tmp_path, code, **variables).split() for variables in ({"NUMBA_DISABLE_JIT": "1"}, {}))
    np.testing.assert_allclose(np.array(slow, float), np.array(fast, float), rtol=1e-14)
