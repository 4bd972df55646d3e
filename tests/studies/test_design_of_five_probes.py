"""What the study says of five designs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from studies.design_of_five_probes import EARLIER, Result, draw, report, run

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def result() -> Result:
    return run()


def test_what_the_study_says(result: Result) -> None:
    np.testing.assert_allclose(result.rmse("flat, no reference"), [0.85, 0.92, 23.09], rtol=0.02)
    np.testing.assert_allclose(result.rmse("flat, with a reference"), [0.37, 0.63, 23.00], rtol=0.02)
    np.testing.assert_allclose(result.rmse("domed, two forces"), [0.42, 0.62, 22.56], rtol=0.02)
    np.testing.assert_allclose(result.rmse("domed, two forces"), result.exact_rmse, rtol=0.02)
    broken = {one.protocol.name: set(one.limits.broken) for one in result.designs if one.limits.broken}
    assert broken == {"dome of 30 mm, two forces": {"contact", "saturation"}}


def test_other_tissue_at_the_reference_costs_most_under_a_dome(result: Result) -> None:
    cost = [
        one.information.rmse["diameter_mm"] / alike.information.rmse["diameter_mm"]
        for one, alike in zip(result.designs, result.alike, strict=True)
    ]
    assert cost[0] == pytest.approx(1.0)
    assert 1.0 < cost[1] < 1.15
    assert min(cost[2:]) > 1.25


def test_the_table_names_what_it_compares(result: Result, tmp_path: Path) -> None:
    text = report(result)
    assert text.count("earlier *") == len(EARLIER) == 3
    assert "an earlier computation with a simpler model" in text
    assert text.endswith("Research use only")
    draw(result, tmp_path / "five.png")
    assert (tmp_path / "five.png").read_bytes().startswith(b"\x89PNG")
