"""How tests use the demo that was kept: its files, and the program's answers in JSON."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis

KNOWN = ("--calibration", "demo/calibration.json", "--scale-mm", "0.0336,0.0392", "--strain", "small")
FRAMES = ("demo/target-0.5N.png", "demo/target-1N.png")
FORCES = ("--force-n", "0.5", "--force-n", "1")


def told(run: RunTsis, *arguments: str | Path) -> Any:
    finished = run(*arguments, "--json")
    assert finished.code == 0, finished.err
    return json.loads(finished.out)
