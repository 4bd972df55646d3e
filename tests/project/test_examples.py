"""Examples run as they stand and assert their own numbers; `tests/release` runs the first one with the built wheel."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_a_press_is_followed_to_its_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(EXAMPLES / "press_to_report.py"))["main"](tmp_path / "out")
    assert "it is 9 mm. Research use only." in capsys.readouterr().out
    report = (tmp_path / "out" / "report.html").read_text()
    assert "Press on a phantom" in report
    assert "Research use only" in report
    assert "<script" not in report
