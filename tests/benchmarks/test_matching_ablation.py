"""What a match loses without a part: pairs of trials, and parts that are back afterwards."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from benchmarks.matching.ablation import PARTS, part_rows
from benchmarks.matching.summary import TrustCase

if TYPE_CHECKING:
    import pytest


def _case(trial: int, part: str, error: float, *, reliable: bool) -> TrustCase:
    return TrustCase(
        trial=f"fresh/hand/noise/{trial}",
        method=part,
        error=error,
        unmoved_error=1.0,
        confidence=float(reliable),
        reliable=reliable,
        second=0.0,
        seconds=0.25,
        measures=(),
    )


def test_differences_are_of_the_same_trials() -> None:
    cases = [_case(trial, part, 0.01, reliable=trial > 0) for trial in range(4) for part in PARTS if part != "outline"]
    cases += [_case(trial, "outline", 0.5 if trial == 3 else 0.01, reliable=trial > 0) for trial in (2, 3, 0, 1)]
    rows = {row[0]: row[1:] for row in part_rows(cases)}
    assert rows["nothing"] == ["0.0100", "0.0", "+0.0 ± 0.0", "0", "25", "250"]
    # one of four is wrong: a standard deviation of sqrt(3) / 4, over two
    spread = 100 * np.sqrt(3) / 8
    assert rows["outline"] == ["0.1325", "25.0", f"+25.0 ± {spread:.1f}", "1", "33", "250"]


def test_each_part_is_there_to_be_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    for part, changes in PARTS.items():
        for module, name, instead in changes:
            assert getattr(module, name) is not instead, part
            monkeypatch.setattr(module, name, instead)
