"""Machine code on disk: thrown away when any source of its package changes; switched off, functions stay Python."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest

import tsis.compiled

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.system

STEPS = """
import numpy as np
from copied_package.caller import twice
print(twice(3.0), *twice.dispatcher.stats.cache_hits.values())
"""


def copied_package(tmp_path: Path) -> Path:
    """Make a package with the compiler's file, a function, and another file whose function it calls."""
    package = tmp_path / "copied_package"
    package.mkdir()
    (package / "__init__.py").touch()
    shutil.copy(tsis.compiled.__file__, package)
    head = "from __future__ import annotations\nfrom copied_package.compiled import compiled\n"
    called = "@compiled\ndef factor() -> float:\n    return 2.0\n"
    (package / "called.py").write_text(head + called)
    caller = (
        "from copied_package.called import factor\n@compiled\ndef twice(x: float) -> float:\n    return factor() * x\n"
    )
    (package / "caller.py").write_text(head + caller)
    return package


def run(folder: Path, code: str, **variables: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(folder), **variables}
    return subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, env=environment
    ).stdout.strip()


def test_a_change_in_another_file_of_the_package_is_noticed(tmp_path: Path) -> None:
    package = copied_package(tmp_path)
    assert run(tmp_path, STEPS) == "6.0"
    assert run(tmp_path, STEPS) == "6.0 1", "from disk"
    called = package / "called.py"
    called.write_text(called.read_text().replace("2.0", "50.0"))
    assert run(tmp_path, STEPS) == "150.0"


def test_threads_may_be_the_first_to_call_it(tmp_path: Path) -> None:
    copied_package(tmp_path)
    code = (
        "from concurrent.futures import ThreadPoolExecutor\n"
        "from copied_package.caller import twice\n"
        "with ThreadPoolExecutor(8) as pool: print(*set(pool.map(twice, [3.0] * 8)))"
    )
    assert run(tmp_path, code) == "6.0"


def test_without_a_compiler_the_same_comes_out(tmp_path: Path) -> None:
    code = "from tsis.optics import guided_modes as f; print(*f([1.5], [2.0], wavelength_um=0.6).n_eff)"
    slow, fast = (run(tmp_path, code, **variables).split() for variables in ({"NUMBA_DISABLE_JIT": "1"}, {}))
    np.testing.assert_allclose(np.array(slow, float), np.array(fast, float), rtol=1e-14)
