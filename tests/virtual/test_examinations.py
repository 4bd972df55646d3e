"""Counting how often intervals hold: the draws, the counts, and refusals."""

from __future__ import annotations

import numpy as np
import pytest

import tsis
from tsis.errors import InputError
from tsis.inclusion import InclusionPrior, load_prior
from tsis.inclusion.prior import PARAMETERS
from tsis.virtual.examinations import RepeatedExamination, coverage_counts, stored_coverage

DOMED = RepeatedExamination(probe=tsis.load_probe("tsis-domed"), prior=InclusionPrior(), strain="small")


def test_an_examination_says_whether_each_interval_holds_its_own_truth() -> None:
    first, second = DOMED.once(7001), DOMED.once(7002)
    assert first["truth"] != second["truth"]
    for case in (first, second):
        for name, (low, high) in zip(PARAMETERS, zip(DOMED.prior.low, DOMED.prior.high, strict=True), strict=True):
            assert low <= case["truth"][name] <= high
            assert case["held"]["0.9"][name] or not case["held"]["0.5"][name]  # the wider interval contains the other


@pytest.mark.slow
def test_a_seed_gives_the_same_examination_again() -> None:
    assert DOMED.once(7001) == DOMED.once(7001)


def test_counts_are_sums_over_the_cases() -> None:
    rng = np.random.default_rng(3)
    held = rng.random((40, 2, 3)) < 0.7
    trusted = rng.random(40) < 0.8
    cases = [
        {
            "seed": seed,
            "trusted": bool(trusted[seed]),
            "held": {
                level: dict(zip(PARAMETERS, row.tolist(), strict=True))
                for level, row in zip(("0.5", "0.9"), held[seed], strict=True)
            },
        }
        for seed in range(40)
    ]
    counts = coverage_counts([*cases, {"seed": 40, "refused": "MechanicsError: the tissue wraps the rim"}])
    assert (counts["cases"], counts["answered"], counts["trusted"]) == (41, 40, int(trusted.sum()))
    assert counts["refused"] == {"MechanicsError": 1}
    for kind, among in (("held", held), ("held_trusted", held[trusted])):
        for level, row in zip(("0.5", "0.9"), among.sum(axis=0), strict=True):
            assert list(counts[kind][level].values()) == row.tolist()


def test_the_stored_counts_are_those_of_a_run_that_anyone_can_repeat() -> None:
    stored = stored_coverage()
    assert stored["protocol"]["command"] == "tsis demo --seeds 100 --seed 0"
    assert (stored["protocol"]["probe"], stored["protocol"]["strain"]) == ("tsis-domed", "finite")
    assert stored["counts"] == coverage_counts(stored["examinations"])


@pytest.mark.slow
def test_the_stored_cases_come_out_again() -> None:
    stored = stored_coverage()
    protocol = stored["protocol"]
    finite = RepeatedExamination(
        probe=tsis.load_probe(protocol["probe"]),
        prior=load_prior(protocol["prior"]),
        forces_n=tuple(protocol["forces_n"]),
        strain=protocol["strain"],
    )
    for case in stored["examinations"][:4]:
        again = finite.once(case["seed"])
        assert {key: again.get(key) for key in ("held", "trusted")} == {
            key: case.get(key) for key in ("held", "trusted")
        }


def test_wrong_input_is_refused() -> None:
    with pytest.raises(InputError, match=r"no strain is called 'finit'"):
        RepeatedExamination(probe=DOMED.probe, prior=DOMED.prior, strain="finit")
    with pytest.raises(InputError, match=r"seed must .*got -1"):
        DOMED.once(-1)
    with pytest.raises(InputError, match=r"count must .*got 0"):
        DOMED.run(0)
