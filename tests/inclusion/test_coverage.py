"""Do the intervals hold, over virtual presses that the estimator knows nothing about? And is the judge itself right?"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import benchmarks.coverage
import numpy as np
import pytest
from benchmarks.coverage import beside_informed, held_or_named, kept_at, prior_goals, run
from benchmarks.judgement import Judgement, compared
from benchmarks.press_bank import PressBank
from benchmarks.simulated_presses import PROTOCOLS, simulate
from benchmarks.worlds import WORLDS

from tsis.errors import InputError
from tsis.inclusion import InclusionPrior, load_prior
from tsis.inclusion.prior import PARAMETERS
from tsis.model.estimate import Estimate
from tsis.model.phantom import Inclusion
from tsis.virtual.examinations import DEEPEST_FRACTION, LARGEST_DRAWN_POISSON, draw_phantom

if TYPE_CHECKING:
    from pathlib import Path

    import tsis

PRIOR = InclusionPrior(heterogeneity_sd=0.0)  # the presses are on even tissue; allowing for more over-covers
FLAT = PROTOCOLS["flat"]
UNEVEN = 1e-3  # chance below which ranks of a toy count as uneven; even ones of three parameters go below 0.01 in 3 %


def bank(seed: int = 3) -> PressBank:
    return PressBank(protocol=FLAT, prior=PRIOR, seed=seed)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_ninety_percent_intervals_hold_the_truth() -> None:
    """Of 500 presses, whose coverage scatters by 1.3 %; the first 200 alone hold the diameter in 83.5 %."""
    found = Judgement.of(run(bank(seed=1), 500))
    assert found.truth.shape == (500, 3)
    for name, coverage in zip(PARAMETERS, found.coverage(0.9), strict=True):
        assert 0.85 <= coverage <= 0.95, f"{name}: {coverage:.3f}"
    narrowing = found.sd / np.array([PRIOR.sd[name] for name in PARAMETERS])
    assert (narrowing[:, :2].mean(axis=0) < 0.3).all(), "intervals that say something"


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
@pytest.mark.parametrize("law", ["traced", "growing", "absorbing"])
def test_intervals_hold_with_the_calibration_of_the_product(law: str) -> None:
    """Of 40 presses; each coverage scatters by 5 % around 90."""
    lamps = PressBank(protocol=PROTOCOLS["domed"], prior=PRIOR, seed=9, world=WORLDS[f"lamps-{law}"])
    found = Judgement.of(run(lamps, 40))
    assert (np.array(found.coverage(0.9)) >= 0.78).all(), "two and a half standard deviations below"
    assert "light_not_measured" not in found.flags, "pads measure it"


def test_phantoms_are_drawn_from_the_prior() -> None:
    rng = np.random.default_rng(1)
    drawn = [draw_phantom(PRIOR, rng) for _ in range(4000)]
    lumps = [one.inclusion for one in drawn if one.inclusion is not None]
    for name, low, high in zip(PARAMETERS, PRIOR.low, PRIOR.high, strict=True):
        share = (np.array([getattr(lump, name) for lump in lumps]) - low) / (high - low)
        # Uniform over the whole range: thick slabs, not small inclusions, make room for large deep ones.
        np.testing.assert_allclose(np.histogram(share, bins=5, range=(0, 1))[0] / len(share), 0.2, atol=0.03)
    young = np.log([one.young_kpa / PRIOR.tissue_young_kpa for one in drawn])
    assert (young.mean(), young.std()) == pytest.approx((0.0, PRIOR.tissue_young_sd), abs=0.005)
    roomy = [one.thickness_mm for one, lump in zip(drawn, lumps, strict=True) if lump.bottom_mm < 15.0]
    thickness = np.log(np.array(roomy) / PRIOR.thickness_mm)
    assert (thickness.mean(), thickness.std()) == pytest.approx((0.0, PRIOR.thickness_sd), abs=0.01)
    assert all(lump.bottom_mm < DEEPEST_FRACTION * one.thickness_mm for one, lump in zip(drawn, lumps, strict=True))
    poisson = np.array([one.poisson for one in drawn])
    assert poisson.max() == LARGEST_DRAWN_POISSON
    assert (np.median(poisson), poisson.std()) == pytest.approx((PRIOR.poisson, PRIOR.poisson_sd), abs=3e-4)
    assert [lump.poisson for lump in lumps] == poisson.tolist()


def test_a_case_is_the_same_whatever_was_pressed_before_and_other_than_its_neighbour() -> None:
    first, again, other = (simulate(FLAT, PRIOR, seed=5, index=index) for index in (1, 1, 2))
    assert first.phantom == again.phantom != other.phantom
    np.testing.assert_array_equal(first.frames[0].grey, again.frames[0].grey)
    assert (first.frames[0].grey != other.frames[0].grey).any()
    assert (first.frames[0].grey != first.references[0].grey).any()


def test_protocols_press_what_they_say() -> None:
    case = simulate(replace(PROTOCOLS["domed"], probe_name="tsis-2011"), PRIOR, seed=5, index=0)
    assert [frame.force_n for frame in case.frames] == [frame.force_n for frame in case.references] == [0.5, 1.0]
    alone = simulate(PROTOCOLS["flat-alone"], PRIOR, seed=5, index=0)
    assert (len(alone.frames), alone.references) == (1, ())
    assert (
        PROTOCOLS["domed"].described == "tsis-domed, 0.5 and 1 N, each with a reference press, presses at small strain"
    )


def line_of(index: int) -> dict[str, Any]:
    """A line as `judge` makes them, of no press."""
    return {
        "index": index,
        "truth": [1.0 + index] * 3,
        "mean": [2.0] * 3,
        "sd": [1.0] * 3,
        "rank": [0.5] * 3,
        "trusted": index > 0,
        "flags": [],
    }


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_run_that_was_cut_off_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out, calls = tmp_path / "deep" / "cases.jsonl", []

    def judge(_: PressBank, index: int, _strain: str | None, *, informed: bool) -> dict[str, Any]:
        assert not informed
        calls.append(index)
        return line_of(index)

    monkeypatch.setattr(benchmarks.coverage, "judge", judge)
    assert run(bank(), 1, out=out) == [line_of(0)]
    with out.open("a") as file:
        file.write("\n" + json.dumps(line_of(2)) + "\n" + json.dumps(line_of(1))[:-9])
    assert run(bank(), 2, out=out) == [line_of(0), line_of(1)]
    assert run(bank(), 3, out=out) == [line_of(0), line_of(1), line_of(2)]
    assert calls == [0, 1], "what half a line stood for, and nothing else, was judged again"


def test_finished_cases_of_another_estimator_are_not_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    here = kept_at(tmp_path, bank())
    assert here == kept_at(tmp_path, bank())
    assert here != kept_at(tmp_path, bank(seed=4))
    monkeypatch.setattr(benchmarks.coverage, "code", lambda: "other")
    assert here != kept_at(tmp_path, bank())


def toy(spread: float, *, cases: int = 2000) -> Judgement:
    """Truths known through normal noise of standard deviation 1; samples claim ``spread`` times that."""
    rng = np.random.default_rng(1)
    lines = []
    for _ in range(cases):
        truth = rng.uniform(PRIOR.low, PRIOR.high)
        seen = truth + rng.standard_normal(3)
        samples = dict(zip(PARAMETERS, (seen + spread * rng.standard_normal((2000, 3))).T, strict=True))
        diameter, depth, young = truth.tolist()
        lump = Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=young)
        found = Estimate(samples=samples, prior_sd=PRIOR.sd, flags=("toy",))
        line = compared(found, lump)
        inside = [low <= value <= high for value, (low, high) in zip(truth, found.interval(0.9).values(), strict=True)]
        lines.append(line | {"inside": inside})
    judged = Judgement.of(lines)
    result = np.array([line["inside"] for line in lines])
    assert (judged.holds(0.9) == result).mean() > 0.995, "ranks say what intervals say, but for the last sample"
    return judged


def test_honest_samples_are_found_honest() -> None:
    found = toy(1.0)
    summary = found.summary(PRIOR)
    for name in PARAMETERS:
        row = summary[name]
        assert row["coverage_90"] == pytest.approx(0.9, abs=0.02)
        assert row["coverage_50"] == pytest.approx(0.5, abs=0.03)
        assert row["coverage_90_within"][0] < row["coverage_90"] < row["coverage_90_within"][1]
        assert row["rmse"] == pytest.approx(1.0, abs=0.05)
        assert row["rmse_over_sd"] == pytest.approx(1.0, abs=0.05)
        assert row["prior_mean_rmse"] == pytest.approx(PRIOR.sd[name], rel=0.03)
        assert row["rmse_over_prior_mean"] == pytest.approx(1 / PRIOR.sd[name], rel=0.08)
        assert row["median_narrowing"] == pytest.approx(1 / PRIOR.sd[name], rel=0.08)
        assert row["uniform_ranks"] > UNEVEN
    assert found.keeps_the_claim()
    assert found.flags == {"toy": 2000}


@pytest.mark.parametrize("spread", [0.7, 1.5])
def test_samples_that_claim_too_much_or_too_little_are_found_out(spread: float) -> None:
    found = toy(spread, cases=600)
    summary = found.summary(PRIOR)
    assert not found.keeps_the_claim()
    for row in summary.values():
        assert row["rmse_over_sd"] == pytest.approx(1 / spread, rel=0.05)
        assert (row["coverage_90"] < 0.85) == (spread < 1)
        assert row["uniform_ranks"] < UNEVEN


def test_refusals_are_counted_and_kept_apart() -> None:
    found = Judgement.of([line_of(0), {"index": 1, "refused": "no"}, {"index": 2, "refused": "no"}])
    assert (found.truth.shape, found.refused, found.distrusted, found.flags) == ((1, 3), {"no": 2}, 1, {})


def test_a_refusal_of_the_estimator_is_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> tsis.Estimate:
        raise InputError("not today")

    monkeypatch.setattr(benchmarks.coverage, "estimate", refuse)
    assert benchmarks.coverage.judge(bank(), 0) == {"index": 0, "refused": "not today"}


@pytest.mark.parametrize("scale", [1.0, 1.3])
def test_the_ratio_to_the_bound_is_that_of_the_errors(scale: float) -> None:
    rng, spread, cases = np.random.default_rng(7), np.array([0.3, 0.2, 5.0]), 4000
    truth = rng.uniform(PRIOR.low, PRIOR.high, (cases, 3))
    mean = truth + scale * spread * rng.standard_normal((cases, 3))
    known = {"sd": spread, "informed_sd": spread, "informed_rank": 3 * [0.5]}
    lines = [{"truth": one, "mean": other, **known} for one, other in zip(truth, mean, strict=True)]
    rows = {name: values for name, *values in beside_informed(lines)}
    ratio, chance = (np.array(rows[name], dtype=float) for name in ("rmse over bound", "its standard error"))
    assert (np.abs(ratio - scale) < 4 * chance).all()
    assert rows["bound"] == ["0.3", "0.2", "5"]


def test_errors_of_a_shipped_prior_are_beside_its_goals() -> None:
    prior = load_prior("breast-ex-vivo")
    assert np.array_equal(prior.young_kpa, (7.5, 65.0))
    lines = [line_of(0) | {"truth": [2.0, 2.0, 2.0], "mean": [2.1, 2.02, 2.5]}]
    goals = prior_goals(Judgement.of(lines).summary(prior))
    assert [round(each.value, 6) for each in goals] == [5.0, 1.0, 25.0, 25.0]
    assert [each.met for each in goals] == [False, True, False, False]


def test_an_interval_under_a_layer_holds_or_the_layer_is_named() -> None:
    missed = {"rank": [0.99, 0.5, 0.5]}
    lines = [
        line_of(1),
        line_of(2) | missed,
        line_of(3) | missed | {"trusted": False, "flags": ["superficial_layer"]},
        {"index": 4, "refused": "too soft"},
    ]
    assert held_or_named(lines) == [
        ["90 holds", "1 of 3", "3 of 3", "3 of 3"],
        ["or the layer is named", "2 of 3", "3 of 3", "3 of 3"],
    ]
