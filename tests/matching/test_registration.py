"""The one entry: what it refuses, and what must hold whatever the method."""

from __future__ import annotations

import copy
import pickle
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.matching.distort import even_texture, tactile_surface
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tsis.errors import InputError, UnknownNameError, UntrustedError
from tsis.matching import Registration, register, registration
from tsis.matching import methods as fit
from tsis.matching.flags import MATCHING_FLAGS, UNTRUSTED_FLAGS
from tsis.matching.methods import UNMATCHED, MatchFit
from tsis.matching.registration import METHODS, PointMatch

if TYPE_CHECKING:
    from numpy.typing import NDArray


EVERY_METHOD = pytest.mark.parametrize("method", METHODS)
EVERY_DIMENSION = pytest.mark.parametrize("dimension", [2, 3], ids=["plane", "space"])
SEEDS = st.integers(0, 10_000)
SOME = settings(max_examples=1, derandomize=True)  # each is several registrations by each of the methods
LARGEST_SHIFT = 0.02  # of the shape's extent; the points lie some 0.1 apart


@dataclass(frozen=True)
class Task:
    """Points, where each of them went, and those places shuffled."""

    source: np.ndarray
    truth: np.ndarray
    order: np.ndarray

    @property
    def target(self) -> np.ndarray:
        return np.asarray(self.truth[self.order])

    def right(self, found: PointMatch) -> float:
        own = np.where(found.matches == UNMATCHED, UNMATCHED, self.order[found.matches])
        return float(np.mean(own == np.arange(len(own))))

    def rms(self, found: PointMatch) -> float:
        return float(np.sqrt(np.mean(np.sum((found.moved - self.truth) ** 2, axis=1))))


def _goes(points: np.ndarray) -> np.ndarray:
    return np.asarray(points + LARGEST_SHIFT * np.sin(4 * points[:, ::-1] + np.arange(points.shape[1])))


def _task(seed: int, dimension: int = 2, count: int = 40) -> Task:
    rng = np.random.default_rng(seed)
    source = (even_texture if dimension == 2 else tactile_surface)(count, rng=rng)
    return Task(source, _goes(source), rng.permutation(count))


@cache
def _answer(method: str, dimension: int = 2, count: int = 40) -> tuple[Task, Registration]:
    """A task and a method's answer, which several tests look at."""
    task = _task(2, dimension, count)
    return task, register(task.source, task.target, method=method)


POINTS = np.random.default_rng(0).normal(size=(20, 2))
SOLID = np.random.default_rng(0).normal(size=(20, 3))
LINE = np.outer(np.arange(9.0), [1.0, -2.0])


@pytest.mark.parametrize(
    ("source", "target", "message"),
    [
        (POINTS[:3], POINTS, "source must hold at least 4 distinct points; got 3"),
        (POINTS, POINTS[:1], "target must hold at least 4 distinct points; got 1"),
        (np.repeat(POINTS[:3], 9, axis=0), POINTS, "source must hold at least 4 distinct points; got 3"),
        (np.zeros((50, 2)), POINTS, "source must hold at least 4 distinct points; got 1"),
        (POINTS, LINE, "target must not lie in a line; got 9 points that do"),
        (POINTS, 1e6 + LINE, "target must not lie in a line"),
        (SOLID, np.column_stack([POINTS, POINTS.sum(axis=1)]), "source must lie in a plane as target does"),
        (SOLID, np.outer(np.arange(9.0), [1.0, 2.0, 3.0]), "target must not lie in a line"),
        (np.where(POINTS > 1, np.nan, POINTS), POINTS, "source must be finite; got [1-9].* NaN or infinite values"),
        (POINTS, np.where(POINTS > 1, np.inf, POINTS), "target must be finite"),
        (POINTS, SOLID, "as many coordinates; got 2 and 3"),
        (np.zeros((9, 4)), np.zeros((9, 4)), "source must have 2 or 3 coordinates each; got shape"),
        (np.arange(9.0)[:, None], np.arange(9.0)[:, None], "source must have 2 or 3 coordinates"),
        (np.arange(9.0), POINTS, "source must have 2 axes"),
        (POINTS, POINTS[None], "target must have 2 axes"),
        ([["a", "b"]] * 5, POINTS, "source must be an array of numbers"),
        ("points.csv", POINTS, "source must be an array of numbers"),
        (None, POINTS, "source must be an array of numbers"),
        ([[1.0, 2.0], [3.0]], POINTS, "source must be an array of numbers"),
        (POINTS + 1j, POINTS, "source must be an array of numbers"),
        ([], POINTS, "source must have 2 axes"),
        (np.empty((0, 2)), POINTS, "source must not be empty"),
    ],
)
def test_what_cannot_be_matched_is_refused(source: object, target: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        register(source, target)  # type: ignore[arg-type]


def test_integers_and_repeated_points_are_matched_as_numbers() -> None:
    task = _task(5, count=60)
    grid = np.round(1000 * task.source).astype(int)
    found = register(grid, np.round(1000 * task.target).astype(np.int16))
    assert found.reliable
    np.testing.assert_allclose(found.moved, 1000 * task.truth, atol=2.0)
    twice = register(np.repeat(task.source, 2, axis=0), np.repeat(task.target, 2, axis=0))
    assert twice.moved.shape == (120, 2)
    assert len(set(twice.matches[~twice.outliers])) == (~twice.outliers).sum()


def test_an_unknown_method_is_answered_with_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'tps-rpm'"):
        register(POINTS, POINTS, method="tps_rpm")


def test_chance_must_come_from_a_generator() -> None:
    with pytest.raises(InputError, match="rng must be a Generator"):
        register(POINTS, POINTS, rng=3)  # type: ignore[arg-type]


def test_too_many_points_are_refused_with_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registration, "MOST_POINTS", 19)
    with pytest.raises(InputError, match=r"source must hold at most 19 points; got 20 \(match a sample"):
        register(POINTS, POINTS)
    monkeypatch.undo()
    with pytest.raises(InputError, match="at most 200,000 points; got 1,000,000"):
        register(np.zeros((1_000_000, 2)), POINTS)


@EVERY_METHOD
@EVERY_DIMENSION
def test_a_small_deformation_is_found(method: str, dimension: int) -> None:
    task, found = _answer(method, dimension, 70)
    assert found.method == method
    assert found.reliable
    assert found.notes == ()
    assert task.right(found.untrusted) > 0.95
    assert task.rms(found.untrusted) < LARGEST_SHIFT / 2
    assert np.all((found.trust >= 0) & (found.trust <= 1))
    assert 0.5 < found.confidence <= 1
    np.testing.assert_array_equal(found.outliers, found.matches == UNMATCHED)


@EVERY_METHOD
@EVERY_DIMENSION
def test_the_transform_moves_the_source_and_takes_new_points_where_their_neighbours_go(
    method: str, dimension: int
) -> None:
    task, found = _answer(method, dimension, 70)
    np.testing.assert_allclose(found.transform(task.source), found.moved, atol=1e-12)
    between = (task.source[:, None] + task.source[None]).reshape(-1, dimension) / 2
    inside = between[np.linalg.norm(between - task.source.mean(axis=0), axis=1) < 0.25]
    wrong = found.transform(inside) - _goes(inside)
    assert np.sqrt(np.mean(np.sum(wrong**2, axis=1))) < 0.6 * LARGEST_SHIFT


@EVERY_METHOD
def test_the_transform_goes_over_many_points_in_blocks(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = _answer(method)[1].untrusted
    points = np.random.default_rng(0).uniform(0.3, 0.9, (100, 2))
    whole = found.transform(points)
    monkeypatch.setattr(fit, "BLOCK", 7)
    np.testing.assert_allclose(found.transform(points), whole, atol=1e-12)
    with pytest.raises(InputError, match="points must have 2 coordinates each, as the source"):
        found.transform(SOLID)
    with pytest.raises(InputError, match="points must be finite"):
        found.transform([[np.nan, 0.0]])


@EVERY_METHOD
@SOME
@given(seed=SEEDS)
def test_permuting_either_set_permutes_the_matches(method: str, seed: int) -> None:
    task = _task(seed)
    one = register(task.source, task.target, method=method).untrusted
    order = np.random.default_rng(seed + 1).permutation(len(task.source))
    other = register(task.source, task.target[order], method=method).untrusted
    np.testing.assert_array_equal(np.where(other.matches < 0, UNMATCHED, order[other.matches]), one.matches)
    np.testing.assert_allclose(other.moved, one.moved, atol=1e-3 * LARGEST_SHIFT)
    turned = register(task.source[order], task.target, method=method).untrusted
    assert np.mean(turned.matches == one.matches[order]) > 0.9  # other pairs may be drawn: not all need be the same


@EVERY_METHOD
@SOME
@given(seed=SEEDS, size=st.sampled_from([1e-9, 0.1, 7.0, 1e9]), x=st.floats(-3, 3), y=st.floats(-3, 3))
def test_moving_and_scaling_carry_over(method: str, seed: int, size: float, x: float, y: float) -> None:
    """Whether or not the result is reliable."""
    task, shift = _task(seed), np.array([x, y])
    one = register(task.source, task.target, method=method)
    there = register((task.source - shift) / size, size * (task.target + shift), method=method)
    np.testing.assert_array_equal(there.untrusted.matches, one.untrusted.matches)
    np.testing.assert_allclose(there.untrusted.moved / size, one.untrusted.moved + shift, atol=1e-3 * LARGEST_SHIFT)
    assert there.confidence == pytest.approx(one.confidence, abs=1e-3)


@EVERY_METHOD
@SOME
@given(seed=SEEDS, missing=st.integers(0, 20), stray=st.integers(0, 25))
def test_no_target_is_matched_twice_and_nothing_unmatched_is_trusted(
    method: str, seed: int, missing: int, stray: int
) -> None:
    task, rng = _task(seed), np.random.default_rng(seed)
    target = np.vstack([task.target[missing:], rng.uniform(0.2, 1.0, (stray, 2))])
    found = register(task.source, target, method=method).untrusted
    matched = found.matches[found.matches != UNMATCHED]
    assert len(set(matched)) == len(matched)
    assert np.all((matched >= 0) & (matched < len(target)))
    assert np.all(found.trust[found.outliers] == 0)
    assert np.all(np.isfinite(found.moved))


@EVERY_METHOD
def test_the_same_chance_gives_the_same_answer_and_changes_no_point(method: str) -> None:
    task, found = _answer(method)
    source, target = task.source.copy(), task.target.copy()
    seeded = register(source, target, method=method, rng=np.random.default_rng(0))
    np.testing.assert_array_equal(seeded.untrusted.moved, found.untrusted.moved)
    np.testing.assert_array_equal(seeded.untrusted.matches, found.untrusted.matches)
    np.testing.assert_array_equal(source, task.source)
    np.testing.assert_array_equal(target, task.target)


@EVERY_METHOD
def test_whole_numbers_lists_and_what_is_not_contiguous_do_as_well(method: str) -> None:
    task = _task(5)
    source, target = np.round(1e4 * task.source).astype(int), np.round(1e4 * task.target).astype(int)
    floats = register(source.astype(float), target.astype(float), method=method).untrusted
    lists = register(source.tolist(), target, method=method).untrusted
    strided = register(np.asfortranarray(source), np.repeat(target, 2, axis=0)[::2].tolist(), method=method).untrusted
    for found in (lists, strided):
        np.testing.assert_array_equal(found.matches, floats.matches)
        np.testing.assert_allclose(found.moved, floats.moved, atol=1e-6)


@EVERY_METHOD
def test_identical_sets_stay_where_they_are(method: str) -> None:
    source = even_texture(60, rng=np.random.default_rng(1))
    found = register(source, source, method=method).untrusted
    np.testing.assert_array_equal(found.matches, np.arange(60))
    np.testing.assert_allclose(found.moved, source, atol=0.01)


@EVERY_METHOD
def test_a_point_given_twice_is_matched_as_often(method: str) -> None:
    task = _task(7)
    source, target = np.repeat(task.source, 2, axis=0), np.repeat(task.truth, 2, axis=0)
    found = register(source, target, method=method).untrusted
    assert np.mean(found.matches // 2 == np.arange(len(source)) // 2) > 0.9
    np.testing.assert_allclose(found.moved[::2], found.moved[1::2], atol=1e-9)


@EVERY_METHOD
@pytest.mark.parametrize("count", [4, 6])
def test_the_fewest_points_are_answered(method: str, count: int) -> None:
    rng = np.random.default_rng(count)
    source = np.array([[0.0, 0.0], [3.0, 0.2], [2.8, 1.9], [0.3, 2.2], [1.4, 5.0], [-2.0, 1.0]])[:count]
    found = register(source, source[rng.permutation(count)], method=method).untrusted
    assert found.moved.shape == source.shape
    assert np.all(np.isfinite(found.moved))


@EVERY_METHOD
def test_sets_of_very_different_numbers_are_answered(method: str) -> None:
    rng = np.random.default_rng(8)
    few, many = even_texture(10, rng=rng), even_texture(150, rng=rng)
    for source, target in ((few, many), (many, few)):
        found = register(source, target, method=method).untrusted
        matched = found.matches[found.matches != UNMATCHED]
        assert len(set(matched)) == len(matched) <= 10


def test_masked_values_are_refused_rather_than_used() -> None:
    points = np.random.default_rng(0).uniform(size=(20, 2))
    hidden = np.ma.masked_array(points, mask=np.arange(40).reshape(20, 2) < 6)
    with pytest.raises(InputError, match="source must not hold masked values"):
        register(hidden, points)


def test_an_answer_without_matches_is_not_reliable(monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(source: NDArray[np.float64], target: NDArray[np.float64], /, *, rng: np.random.Generator) -> MatchFit:
        del target, rng
        return MatchFit(move=lambda points, /: points, matches=np.full(len(source), -1), trust=np.zeros(len(source)))

    monkeypatch.setattr(registration, "METHODS", {"nothing": nothing})
    points = np.random.default_rng(0).uniform(size=(40, 2))
    found = register(points, points, method="nothing")
    assert (found.confidence, found.reliable) == (0.0, False)


@pytest.mark.parametrize("dimension", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_unrelated_clouds_are_not_matched(dimension: int) -> None:
    kept = [
        register(*(np.random.default_rng([seed, part]).normal(size=(60, dimension)) for part in (0, 1))).reliable
        for seed in range(4)
    ]
    assert not any(kept)


@pytest.mark.parametrize("name", ["moved", "matches", "trust", "outliers"])
def test_a_number_of_a_withheld_match_raises_with_reasons_and_cures(name: str) -> None:
    found = _unrelated()
    assert found.flags == ("unrelated_sets",)
    with pytest.raises(UntrustedError, match=r"unrelated_sets.*nothing to do with each other.*check that both"):
        getattr(found, name)


def test_the_transform_of_a_withheld_match_raises_and_untrusted_gives_it() -> None:
    found = _unrelated()
    with pytest.raises(UntrustedError, match="untrusted gives the most probable transform"):
        found.transform([[0.0, 0.0]])
    assert np.isfinite(found.untrusted.transform([[0.0, 0.0]])).all()
    assert np.count_nonzero(~found.untrusted.outliers) > 0
    assert "not reliable" in repr(found)


def test_every_flag_that_withholds_has_a_cure() -> None:
    assert all(MATCHING_FLAGS[name].cure for name in UNTRUSTED_FLAGS)


@cache
def _unrelated() -> Registration:
    return register(*(np.random.default_rng(seed).normal(size=(60, 2)) for seed in (0, 1)))


FLAT = even_texture(60, rng=np.random.default_rng(4))


@pytest.mark.parametrize("degrees", [5.0, 50.0, 130.0, 180.0])
@pytest.mark.parametrize("across", [0.0, 0.01])
def test_points_of_a_plane_in_space_are_matched_in_their_plane(degrees: float, across: float) -> None:
    turn = Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, 0.0, 0.8])).as_matrix()
    flat = np.column_stack([FLAT, np.zeros(60)])
    truth = np.column_stack([_goes(FLAT), np.zeros(60)]) @ turn.T + [1.0, 2.0, 3.0]
    noise = across * np.random.default_rng(1).normal(size=truth.shape)
    found = register(flat, truth + noise)
    np.testing.assert_array_equal(found.matches, np.arange(60))
    np.testing.assert_allclose(found.moved, truth, atol=1e-6 + 4 * across)
    above = found.transform(np.add(flat, [0.0, 0.0, 0.1])) - found.moved
    np.testing.assert_allclose(above / np.linalg.norm(above, axis=1)[:, None], np.tile(turn[:, 2], (60, 1)), atol=0.1)


def test_a_flat_symmetric_set_may_lie_on_its_back() -> None:
    """A tee turned over about its stem is as likely as one that is not."""
    half = np.column_stack([np.linspace(0.05, 1.0, 20), 0.1 * np.sin(np.linspace(0, 9, 20))])
    stem = np.column_stack([np.zeros(15), np.linspace(-1.5, -0.1, 15)])
    tee = np.vstack([half, half * [-1.0, 1.0], stem])
    flat = np.column_stack([tee, np.zeros(len(tee))])
    found = register(flat, flat, rotation_sd_deg=1000.0)
    assert not found.reliable
    assert "several_poses" in found.flags
    assert found.alternatives[0].probability == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("arranged", ["repeated", "tiled"])
@EVERY_METHOD
def test_points_given_three_times_match_as_the_single_ones(method: str, arranged: str) -> None:
    task, single = _answer(method)
    order = np.repeat(np.arange(40), 3) if arranged == "repeated" else np.tile(np.arange(40), 3)
    found = register(task.source[order], task.target, method=method)
    assert found.confidence == single.confidence
    np.testing.assert_array_equal(found.untrusted.matches, single.untrusted.matches[order])
    np.testing.assert_allclose(found.untrusted.moved, single.untrusted.moved[order], atol=1e-12)


def test_few_points_are_said_to_tell_little() -> None:
    points = np.random.default_rng(0).uniform(size=(6, 2))
    assert any("so few points" in note for note in register(points, points[::-1]).notes)


@pytest.mark.parametrize("method", METHODS)
def test_a_registration_pickles(method: str) -> None:
    rng = np.random.default_rng(0)
    source = rng.uniform(size=(30, 2))
    registration = register(source, source + 0.01 * rng.normal(size=source.shape), method=method)
    for again in (pickle.loads(pickle.dumps(registration)), copy.deepcopy(registration)):
        np.testing.assert_array_equal(again.transform(source), registration.transform(source))
        np.testing.assert_array_equal(again.matches, registration.matches)


def test_the_accepted_share_of_wrong_answers_sets_the_threshold() -> None:
    shape = even_texture(30, rng=np.random.default_rng(5))
    noisy = shape + 0.05 * np.random.default_rng(6).normal(size=shape.shape)
    found = [register(shape, noisy, most_wrong=share) for share in (0.001, 0.003, 0.01, 0.03)]
    assert len({item.confidence for item in found}) == 1
    assert [item.reliable for item in found] == sorted(item.reliable for item in found)
    with pytest.raises(InputError, match="most_wrong must lie in"):
        register(shape, noisy, most_wrong=0.5)


@pytest.mark.parametrize("method", ["cpd", "bcpd", "shape-context", "rpm-lns"])
def test_the_trust_in_matches_is_how_many_are_right_by_any_method(method: str) -> None:
    """Points that slid by one along a contour lie close to a wrong partner each."""
    rng, angle = np.random.default_rng(7), np.linspace(0.0, 2 * np.pi, 80, endpoint=False)
    contour = np.column_stack(
        [
            np.cos(angle) + 0.2 * np.cos(3 * angle + 0.4) + 0.13 * np.sin(2 * angle),
            0.6 * np.sin(angle) + 0.17 * np.sin(2 * angle),
        ]
    ) + rng.normal(0.0, 0.02, (80, 2))
    turn = np.array([[np.cos(0.5), np.sin(0.5)], [-np.sin(0.5), np.cos(0.5)]])
    order = rng.permutation(80)
    result = register(contour, (contour @ turn)[order], method=method)
    matches, trust = result.untrusted.matches, result.untrusted.trust
    matched = matches >= 0
    right = matches == np.argsort(order)
    assert trust[matched].mean() == pytest.approx(right[matched].mean(), abs=0.15)
    assert right[trust > 0.95].mean() > 0.95
    assert not trust[~matched].any()
