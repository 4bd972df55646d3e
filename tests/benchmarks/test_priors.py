"""The benchmark of the priors: what it makes of lines, on estimates whose errors and bound are known."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.press_bank import PressBank
from benchmarks.priors import PRIOR_WORLDS, PriorTable, judge, knowing, named_prior
from benchmarks.simulated_presses import PROTOCOLS
from benchmarks.worlds import RANDOM_SD

from tsis.catalog.priors import list_inclusion_priors

SPREAD = np.array([0.3, 0.2, 5.0])
CASES = 4000


def lines_of(scale: float) -> list[dict[str, object]]:
    """Normal posteriors of a known spread around means that err by ``scale`` times as much."""
    rng, prior = np.random.default_rng(7), named_prior("breast-ex-vivo")
    lines: list[dict[str, object]] = [{"index": 0, "refused": "too soft"}]
    for index in range(CASES):
        truth = rng.uniform(prior.low, prior.high)
        off = scale * rng.standard_normal(3)
        lines.append(
            {
                "index": index + 1,
                "truth": truth.tolist(),
                "mean": (truth + SPREAD * off).tolist(),
                "sd": SPREAD.tolist(),
                "rank": [0.5, 0.5, 0.96],
                "trusted": True,
                "flags": [],
                "identified": [True, True, bool(truth[2] < 40)],
                "best_sd": SPREAD.tolist(),
                "best_rank": [0.5, 0.5, 0.5],
            }
        )
    return lines


@pytest.mark.parametrize("scale", [1.0, 1.3])
def test_the_ratio_to_the_bound_is_that_of_the_errors(scale: float) -> None:
    table = PriorTable.of(lines_of(scale), named_prior("breast-ex-vivo"))
    np.testing.assert_allclose(table.bound, SPREAD)
    np.testing.assert_allclose(table.rmse / table.bound, scale, rtol=4 / np.sqrt(2 * CASES))
    missed = [each.name for each in table.wanted() if not each.met]
    assert ("RMSE of E over the Bayes bound" in missed) == (scale > 1.15)


def test_what_is_withheld_is_counted_and_its_errors_are_kept_apart() -> None:
    lines = lines_of(1.0)
    table = PriorTable.of(lines, named_prior("breast-ex-vivo"))
    kept = [line for line in lines if "refused" not in line and line["truth"][2] < 40]  # type: ignore[index]
    by_hand = sorted(100 * abs(line["mean"][2] / line["truth"][2] - 1) for line in kept)  # type: ignore[index]
    numbers = table.numbers()
    assert numbers["identified, %"][2] == pytest.approx(100 * len(kept) / CASES)
    middle = (by_hand[len(kept) // 2] + by_hand[(len(kept) - 1) // 2]) / 2
    assert numbers["median where identified, %"][2] == pytest.approx(middle)
    assert numbers["90 % interval holds, %"] == [100.0, 100.0, 0.0]


def test_priors_are_as_they_ship_and_the_bound_knows_the_world() -> None:
    for name in list_inclusion_priors():
        assert named_prior(name).name == name
    prior = named_prior("breast-ex-vivo")
    assert np.array_equal(prior.young_kpa, (7.5, 65.0))
    assert knowing(prior, PRIOR_WORLDS["as-model"]).heterogeneity_sd == 0.0
    assert knowing(prior, PRIOR_WORLDS["uneven"]).heterogeneity_sd == RANDOM_SD[1]


@pytest.mark.slow
def test_a_case_is_pressed_and_judged() -> None:
    bank = PressBank(protocol=PROTOCOLS["domed"], prior=named_prior("phantom-2011"), seed=3)
    line = judge(bank, 0)
    assert len(line["identified"]) == len(line["best_sd"]) == len(line["mean"]) == 3
