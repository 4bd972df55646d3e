"""DeLong's variances and paired tests beside R's pROC, and beside the bootstrap."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.detection.references import REFERENCES

from tsis.errors import InputError
from tsis.study.roc import Roc, auc_covariance, bootstrap_compare_detectors, compare_detectors, drawn_areas

SETS = sorted(REFERENCES["roc"])


def _read(name: str) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    result = REFERENCES["roc"][name]
    return result, np.array([result["first"], result["second"]]), np.array(result["present"]) == 1


@pytest.mark.parametrize("name", SETS)
def test_areas_and_covariances_are_those_of_proc(name: str) -> None:
    result, scores, present = _read(name)
    found = auc_covariance(scores, present)
    assert found.auc == pytest.approx(result["auc"], abs=1e-10)
    assert np.diag(found.covariance) == pytest.approx(result["variance"], abs=1e-10)
    assert found.covariance[0, 1] == found.covariance[1, 0] == pytest.approx(result["covariance"], abs=1e-10)
    assert list(Roc.of(scores[0], present).auc_interval(0.9, "delong")) == pytest.approx(
        result["interval_90"], abs=1e-10
    )


@pytest.mark.parametrize("name", SETS)
def test_paired_tests_are_those_of_proc(name: str) -> None:
    result, scores, present = _read(name)
    found = compare_detectors(scores[0], scores[1], present)
    assert found.z == pytest.approx(result["z"], abs=1e-10)
    assert found.p == pytest.approx(result["p"], abs=1e-10)
    assert found.interval is not None
    assert list(found.interval) == pytest.approx(result["difference_interval_95"], abs=1e-10)
    assert found.method == found.interval.method == "delong"


def test_placements_by_sorting_are_those_of_all_pairs() -> None:
    rng = np.random.default_rng(4)
    present = rng.permutation(np.arange(30) < 11)
    scores = rng.integers(0, 6, (3, 30)) + present
    pairs = np.sign(scores[:, present][:, :, None] - scores[:, ~present][:, None, :]) / 2 + 0.5
    found = auc_covariance(scores, present)
    assert found.auc == pytest.approx(pairs.mean(axis=(1, 2)))
    by_pairs = np.cov(pairs.mean(axis=2)) / 11 + np.cov(pairs.mean(axis=1)) / 19
    np.testing.assert_allclose(found.covariance, by_pairs, atol=1e-15)


@given(st.integers(0, 2**32), st.integers(2, 15), st.integers(2, 15))
def test_swapping_the_methods_turns_the_difference(seed: int, m: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    present = np.arange(m + n) < m
    first, second = rng.integers(0, 4, (2, m + n))
    one, two = compare_detectors(first, second, present), compare_detectors(second, first, present)
    assert one.difference == pytest.approx(-two.difference, abs=1e-15)
    assert one.standard_error == two.standard_error
    assert one.p == two.p
    assert (one.interval is None) == (one.standard_error == 0) == bool(one.remark)


@pytest.mark.parametrize("other", [lambda scores: scores, np.exp, lambda scores: 2 * scores - 7])
def test_equal_rankings_are_said_to_have_no_spread(other: Any) -> None:
    rng = np.random.default_rng(5)
    present = np.arange(40) < 17
    scores = rng.normal(size=40) + present
    for found in (
        compare_detectors(scores, other(scores), present),
        bootstrap_compare_detectors(scores, other(scores), present, rng=rng, draws=200),
    ):
        assert found.difference == found.standard_error == 0
        assert (found.z, found.p, found.interval) == (None, None, None)
        assert "does not vary" in found.remark


def test_a_faultless_method_beside_a_useless_one_has_a_difference_without_spread() -> None:
    found = compare_detectors([1, 2, 3, 4], [4, 3, 2, 1], [False, False, True, True])
    assert found.difference == 1.0
    assert found.p is None
    assert found.remark


@pytest.mark.parametrize("name", ["large", "uneven"])
def test_the_bootstrap_compares_alike(name: str) -> None:
    result, scores, present = _read(name)
    heard: list[tuple[int, int]] = []
    found = bootstrap_compare_detectors(
        scores[0], scores[1], present, rng=np.random.default_rng(6), draws=20000, progress=lambda *at: heard.append(at)
    )
    assert found.z == pytest.approx(result["z"], rel=0.05)
    assert found.interval is not None
    assert list(found.interval) == pytest.approx(result["difference_interval_95"], abs=0.02)
    assert heard[-1] == (20000, 20000)
    assert len(heard) > 1


def test_delongs_standard_error_is_that_of_ten_thousand_bootstraps() -> None:
    # With 300 targets of each kind what both neglect is below a percent; 10,000 draws leave 0.7 %.
    rng = np.random.default_rng(7)
    present = np.arange(600) < 300
    scores = rng.normal(size=600) + 1.2 * present
    drawn = drawn_areas(scores[None], present, rng=rng, draws=10_000)
    variance = auc_covariance(scores[None], present).covariance[0, 0]
    assert drawn.std() == pytest.approx(np.sqrt(variance), rel=0.02)


def test_draws_are_those_of_targets_picked_one_by_one() -> None:
    rng = np.random.default_rng(8)
    present = np.arange(12) < 5
    scores = rng.integers(0, 5, (2, 12)).astype(float)
    drawn = drawn_areas(scores, present, rng=rng, draws=20_000)
    plain = np.empty((5_000, 2))
    for areas in plain:
        picked = np.concatenate([rng.integers(0, 5, 5), rng.integers(5, 12, 7)])
        areas[:] = [Roc.of(row[picked], present).auc for row in scores]
    assert drawn.mean(axis=0) == pytest.approx(plain.mean(axis=0), abs=0.015)
    np.testing.assert_allclose(np.cov(drawn.T), np.cov(plain.T), atol=0.0025)


@pytest.mark.parametrize(
    ("first", "second", "present", "said"),
    [
        ([1, 2, 3], [1, 2, 3], [True, False, False], "present must be True for at least 2 targets for a paired test"),
        ([1, 2, 3, 4], [1, 2, 3], [True, True, False, False], "second and present must be equally long"),
        ([1, 2, 3], [1, 2, 3, 4], [True, True, False, False], "first and present must be equally long"),
        ([1, 2, np.nan, 4], [1, 2, 3, 4], [True, True, False, False], "first must be finite"),
        ([1, 2, 3, 4], [1, 2, 3, 4], [1, 1, 0, 0], "present must hold True and False"),
    ],
)
def test_bad_pairs_are_told(first: list[float], second: list[float], present: list[bool], said: str) -> None:
    with pytest.raises(InputError, match=said):
        compare_detectors(first, second, present)


def test_a_table_of_the_wrong_shape_is_told() -> None:
    with pytest.raises(InputError, match=r"scores must have one column a target, 4 in all; got shape \(2, 3\)"):
        auc_covariance([[1, 2, 3], [1, 2, 3]], [True, True, False, False])
