"""Summary of many trials: median, mean, failures and the ratio to the best rival; cases that calibrate the trust."""

from __future__ import annotations

import time
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy
from benchmarks.matching.trials import matching_error

from tsis.matching.methods import NormalFrame
from tsis.matching.posterior import least_confidence, probability_right, trust_features
from tsis.matching.registration import fit_and_measures
from tsis.model.require import require_number

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Sequence

    from benchmarks.matching.distort import Floats, Trial
    from benchmarks.matching.runs import TrialRow

    from tsis.matching.posterior import PosePosterior


FAILURE_RMS = 0.1  # least root-mean-square error of a failure, for a shape that about fills the unit box
DRAWS = 2000
LEVEL = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorRatio:
    """Mean error of a method over that of the best rival on the same trials."""

    value: float  # the ratio; below 1 the method is better
    # low, high: bootstrap interval of 95 %, trials drawn with replacement, method and rival together
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialSummary:
    """One method on all trials of one kind."""

    # group, level: shape and distortion, and its level; the level of a pooled summary is empty
    group: str
    level: str
    method: str  # name of the method
    trials: int  # number of trials
    # median, mean: of the errors, in the unit of the points
    median: float
    mean: float
    failures: float  # fraction of the trials whose error exceeds the limit, in [0, 1]
    unannounced: float | None  # fraction of the trials that failed although rated as reliable; None without ratings
    withheld: float | None  # fraction of the trials not rated as reliable; None without ratings
    refused: float  # fraction of the trials without a result
    seconds: float  # median time
    ratio: ErrorRatio | None  # to the best rival; None where there is no rival, or one that never errs
    # Name of the best rival: that of the lowest mean error at each level. Empty where pooled levels differ in it.
    rival: str


def summarise(
    rows: Iterable[TrialRow], *, rivals: Collection[str], failure: float = FAILURE_RMS, seed: int = 0
) -> list[TrialSummary]:
    """One summary a group, level and method, in the order of the rows of `benchmarks.matching.runs.run_trials`.

    All methods are compared with the best of ``rivals``; ``failure`` is the least error of a failed trial, in the unit
    of the points, positive (else `InputError`), and ``seed`` that of the bootstrap.
    """
    require_number("failure", failure, 1e-300, 1e300)
    return [
        _summary(group, level, method, cell[method], _best(cell, rivals), failure, seed)
        for (group, level), cell in _cells(rows).items()
        for method in cell
    ]


def summarise_pooled(
    rows: Iterable[TrialRow], *, rivals: Collection[str], failure: float = FAILURE_RMS, seed: int = 0
) -> list[TrialSummary]:
    """One summary a kind of distortion and method, over all shapes and levels, as `summarise`.

    The rival is the best at each level; the kind is the last part of the group's name.
    """
    require_number("failure", failure, 1e-300, 1e300)
    kinds: dict[str, list[dict[str, list[TrialRow]]]] = defaultdict(list)
    for (group, _), cell in _cells(rows).items():
        kinds[group.rsplit("/", 1)[-1]].append(cell)
    results = []
    for kind, cells in kinds.items():
        bests = [_best(cell, rivals) for cell in cells]
        names = {best[0].method for best in bests if best}
        against = [row for best in bests for row in best]
        for method in dict.fromkeys(name for cell in cells for name in cell):
            own = [row for cell in cells for row in cell.get(method, [])]
            summary = _summary(kind, "", method, own, against, failure, seed, rival=", ".join(sorted(names)))
            results.append(summary)
    return results


def ratio_of_means(
    errors: Floats, others: Floats, *, rng: np.random.Generator, draws: int = DRAWS
) -> ErrorRatio | None:
    """Ratio of the mean ``errors`` to those of a rival on the same trials, with its bootstrap interval of 95 %.

    None where the rival never errs.

    Examples
    --------
    >>> ratio_of_means(np.array([1.0, 2.0]), np.array([2.0, 4.0]), rng=np.random.default_rng(0))
    ErrorRatio(value=0.5, low=0.5, high=0.5)
    """
    picked = rng.integers(0, len(errors), (draws, len(errors)))
    with np.errstate(divide="ignore", invalid="ignore"):
        drawn = errors[picked].mean(axis=1) / others[picked].mean(axis=1)
        value = float(np.divide(errors.mean(), others.mean()))
    if not np.isfinite(drawn).all() or not np.isfinite(value):
        return None
    low, high = np.quantile(drawn, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return ErrorRatio(value=value, low=float(low), high=float(high))


def _cells(rows: Iterable[TrialRow]) -> dict[tuple[str, str], dict[str, list[TrialRow]]]:
    """Rows by group and level, then by method."""
    cells: dict[tuple[str, str], dict[str, list[TrialRow]]] = defaultdict(lambda: defaultdict(list))
    for row in rows:
        cells[row.group, row.level][row.method].append(row)
    return cells


def _best(cell: dict[str, list[TrialRow]], rivals: Collection[str]) -> list[TrialRow]:
    """Rows of the rival with the lowest mean error; empty without rivals."""
    present = [cell[name] for name in rivals if name in cell]
    return min(present, key=lambda rows: np.mean([row.error for row in rows]), default=[])


def _summary(
    group: str,
    level: str,
    method: str,
    rows: Sequence[TrialRow],
    against: Sequence[TrialRow],
    failure: float,
    seed: int,
    *,
    rival: str | None = None,
) -> TrialSummary:
    errors = np.array([row.error for row in rows])
    failed = errors > failure
    entries = [bool(wrong) and row.reliable == "yes" for wrong, row in zip(failed, rows, strict=True)]
    rated = any(row.reliable for row in rows)
    other = {row.trial: row.error for row in against}
    shared = [row for row in rows if row.trial in other]
    ratio = None
    if shared:
        pair = np.array([(row.error, other[row.trial]) for row in shared])
        ratio = ratio_of_means(pair[:, 0], pair[:, 1], rng=np.random.default_rng(seed))
    return TrialSummary(
        group=group,
        level=level,
        method=method,
        trials=len(rows),
        median=float(np.median(errors)),
        mean=float(errors.mean()),
        failures=float(failed.mean()),
        unannounced=float(np.mean(entries)) if rated else None,
        withheld=float(np.mean([row.reliable == "no" for row in rows])) if rated else None,
        refused=float(np.mean([bool(row.refused) for row in rows])),
        seconds=float(np.median([row.seconds for row in rows])),
        ratio=ratio,
        rival=(against[0].method if against else "") if rival is None else rival,
    )


MOST_WRONG = 0.001  # share of wrong answers among the reliable ones, the default of `tsis.matching.register`
RIDGE = 0.02  # on the weights but the constant
FREE = (0,)  # column whose weight may be negative: the constant


@dataclass(frozen=True, slots=True, kw_only=True)
class TrustCase:
    """One answer, how far it is wrong, and what was said of it."""

    # trial, method: names of the trial and of the method
    trial: str
    method: str
    error: float  # root-mean-square error, in the trial's unit
    unmoved_error: float  # error of the source where it is, which an abstaining answer has
    confidence: float  # calibrated probability that the error is at most 0.1
    reliable: bool  # whether the confidence suffices
    second: float  # posterior probability of all poses but the best
    seconds: float  # duration; of all but the first method of a trial without the search for poses, which they share
    measures: tuple[float, ...]  # what the confidence depends on; empty for other programs

    def rated(self) -> TrustCase:
        """The answer with the confidence that the present weights give its measures."""
        confidence = probability_right(np.array(self.measures))
        return replace(self, confidence=confidence, reliable=confidence >= least_confidence(MOST_WRONG))


def trust_cases(trial: Trial, methods: Sequence[str], *, rotation_sd_deg: float | None = None) -> Iterator[TrustCase]:
    """Match a trial by methods of `tsis.matching.registration.METHODS` and compare the answers with the truth.

    The search for poses is that of the first method.
    """
    here, there = NormalFrame.of(trial.source), NormalFrame.of(trial.target)
    source, target = here.inward(trial.source), there.inward(trial.target)
    centre = trial.target.mean(axis=0) - trial.source.mean(axis=0)
    searched: PosePosterior | None = None
    for method in methods:
        start = time.process_time()
        fit, posterior, measures = fit_and_measures(
            method, source, target, rotation_sd_deg=rotation_sd_deg, searched=searched
        )
        moved, confidence = fit.move(source), probability_right(measures)
        seconds = time.process_time() - start
        searched = searched or posterior
        poses = posterior.alternatives()
        yield TrustCase(
            trial=trial.name,
            method=method,
            error=matching_error(trial, there.outward(moved)),
            unmoved_error=matching_error(trial, trial.source + centre),
            confidence=confidence,
            reliable=confidence >= least_confidence(MOST_WRONG),
            second=1 - poses[0].probability if poses else 1.0,
            seconds=seconds,
            measures=tuple(measures.tolist()),
        )


def fit_trust(measures: Floats, right: Floats) -> Floats:
    """Weights, shape (k,), of the logistic regression of being right, shape (n,), on measures, shape (n, 8).

    A weak ridge on standardised columns bounds the weights, which are not negative but for the constant.
    """
    features = trust_features(measures)
    scale = np.maximum(np.std(features, axis=0), 1e-9)
    scale[0] = 1.0
    scaled = features / scale

    def loss(weights: Floats) -> tuple[float, Floats]:
        logit = scaled @ weights
        chance = 1 / (1 + np.exp(-np.clip(logit, -50, 50)))
        value = np.logaddexp(0, logit).sum() - right @ logit + 0.5 * RIDGE * (weights[1:] ** 2).sum()
        return float(value), scaled.T @ (chance - right) + RIDGE * np.append(0.0, weights[1:])

    bounds = [(None, None) if column in FREE else (0.0, None) for column in range(len(scale))]
    result = scipy.optimize.minimize(
        loss, np.zeros(len(scale)), jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 2000}
    )
    return np.asarray(result.x / scale)


def threshold(chance: Floats, share: float) -> float:
    """The least probability of being right from which on at most a ``share`` of answers, shape (n,), is wrong.

    Examples
    --------
    >>> threshold(np.array([0.99, 0.97, 0.5]), 0.02)
    0.97
    """
    falling = np.sort(chance)[::-1]
    wrong = np.cumsum(1 - falling) / np.arange(1, len(falling) + 1)
    return float(falling[max(int(np.count_nonzero(wrong <= share + 1e-12)) - 1, 0)])
