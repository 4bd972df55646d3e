"""How often each matching method is confidently wrong, or withholds a right answer, on shapes of a second generator.

    python -m benchmarks.matching.trust --seed 1001 --cases 40 --rows trust.jsonl --peers pycpd --figure trust.png

runs ``--cases`` trials of each family and degradation, and prints the tables. A run that was stopped continues with the
rows in the file. ``--peers`` are programs of `benchmarks.matching.methods.PEERS`; with ``--chosen-by FILE``, rows of
the calibration generator, each cell is compared with the peer that erred least there. ``--figure`` draws the
reliability diagram. ``--rate`` computes the confidence of rows again, of a version with the same search but other
weights.
``--generator calibration --calibrate`` prints the weights of `tsis.matching.posterior` instead, how well the
present ones fit, and how often answers above a log odds of being right were wrong, with weights of the other trials.
``--clutter 30`` matches as many shapes among three outliers an inlier instead, uniform and in clusters.
"""

from __future__ import annotations

import json
import sys
import time
from collections import defaultdict
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench, Choice
from benchmarks.matching import fresh_shapes
from benchmarks.matching.methods import BenchmarkMethod
from benchmarks.matching.summary import TrustCase, fit_trust, ratio_of_means, threshold, trust_cases
from benchmarks.matching.trials import matching_error
from benchmarks.matching.trust_shapes import DEGRADATIONS, FAMILIES, clutter_trial, trust_trial
from matplotlib.figure import Figure
from scipy.optimize import minimize
from scipy.stats import beta

from tsis.compiled import one_blas_thread
from tsis.matching.posterior import THRESHOLDS, WIDEST, trust_features, trust_log_odds
from tsis.matching.registration import METHODS

if TYPE_CHECKING:
    from benchmarks.matching.distort import Trial

WRONG, RIGHT, CLOSE = 0.1, 0.02, 0.04  # errors
RIVALRY = 0.01  # probability of other poses above which withholding is right
OURS = "tprl"
FOLDS, LEVELS = 5, (3.0, 3.5, 4.0, 4.5, 5.0, 6.0)  # of the cross-validation, and log odds of being right


def run_cases(
    generator: str, *, seed: int, count: int, rows: Path, peers: tuple[str, ...] = (), among: int = 1
) -> list[TrustCase]:
    """All cases of our method, of ``among`` rivals in turn and of the peers, with those that the file already holds."""
    cases = read_rows(rows)
    done = {(case.trial, case.method) for case in cases}
    rivals = [name for name in METHODS if name != OURS]
    with one_blas_thread(), rows.open("a", encoding="utf-8") as file:
        for number in range(count):
            for place, degradation in enumerate(KINDS[generator]):
                for family in KINDS[generator][degradation]:
                    name = f"{generator}/{family}/{degradation}/{number}"
                    turn = [rivals[(number + place + k) % len(rivals)] for k in range(among)]
                    methods = [OURS, *turn, *peers]
                    left = [method for method in methods if (name, method) not in done]
                    if not left:
                        continue
                    trial = _trial(generator, family, degradation, number, seed)
                    own = trust_cases(trial, [method for method in left if method in METHODS])
                    for case in [*own, *(peer_case(trial, method) for method in left if method not in METHODS)]:
                        cases.append(case)
                        file.write(json.dumps(asdict(case)) + "\n")
                    file.flush()
    return cases


KINDS: dict[str, dict[str, tuple[str, ...]]] = {
    "calibration": dict.fromkeys(DEGRADATIONS, FAMILIES),
    "test": dict.fromkeys(DEGRADATIONS, FAMILIES),
    "fresh": dict.fromkeys(fresh_shapes.AMOUNTS, tuple(fresh_shapes.SHAPES)),
}


def _trial(generator: str, family: str, degradation: str, number: int, seed: int) -> Trial:
    if generator == "fresh":
        return fresh_shapes.fresh_trial(family, degradation, number, seed=seed)
    return trust_trial(generator, family, degradation, number, seed=seed)


def peer_case(trial: Trial, name: str) -> TrustCase:
    """The error of another program, which rates no confidence."""
    start = time.process_time()
    outcome = BenchmarkMethod(name=name)(trial.source, trial.target, rng=np.random.default_rng(0))
    return TrustCase(
        trial=trial.name,
        method=name,
        error=matching_error(trial, outcome.transformed),
        unmoved_error=matching_error(trial, trial.source + trial.target.mean(axis=0) - trial.source.mean(axis=0)),
        confidence=0.0,
        reliable=False,
        second=1.0,
        seconds=time.process_time() - start,
        measures=(),
    )


def read_rows(rows: Path) -> list[TrustCase]:
    """Cases of a file of rows; none where it is absent."""
    lines = rows.read_text(encoding="utf-8").splitlines() if rows.exists() else []
    records = [json.loads(line) for line in lines]
    return [TrustCase(**{**record, "measures": tuple(record["measures"])}) for record in records]


def trust_table(cases: list[TrustCase]) -> list[str]:
    """A Markdown row for each method: cases, wrong, confidently wrong, reliable, withheld though right or close."""
    lines = [
        "| method | cases | wrong | confidently wrong | reliable | withheld though right | withheld though close |",
        "|---|---|---|---|---|---|---|",
    ]
    for method in METHODS:
        own = [case for case in cases if case.method == method]
        wrong = [case for case in own if case.error > WRONG]
        right = [case for case in own if case.error < RIGHT and case.second < RIVALRY]
        withheld = sum(not case.reliable for case in right)
        counts = (len(own), len(wrong), sum(case.reliable for case in wrong), sum(case.reliable for case in own))
        lines.append(f"| {method} | {' | '.join(map(str, counts))} | {withheld} of {len(right)} | {_withheld(own)} |")
    return lines


def _withheld(cases: list[TrustCase]) -> str:
    """How many answers whose error is below `CLOSE` are withheld, whatever other poses there are."""
    close = [case for case in cases if case.error < CLOSE]
    return f"{sum(not case.reliable for case in close)} of {len(close)}"


def cell_table(cases: list[TrustCase]) -> list[str]:
    """A Markdown row for each family and degradation of our method."""
    heads = ("family", "degradation", "cases", "median RMS", "wrong", "confidently wrong", "reliable")
    lines = [f"| {' | '.join((*heads, 'withheld though close', 'median time / ms'))} |"]
    lines.append("|---|---|---|---|---|---|---|---|---|")
    cells: dict[tuple[str, str], list[TrustCase]] = defaultdict(list)
    for case in cases:
        if case.method == OURS:
            _, family, degradation, _ = case.trial.split("/")
            cells[family, degradation].append(case)
    for (family, degradation), own in sorted(cells.items()):
        wrong = [case for case in own if case.error > WRONG]
        error, seconds = np.median([case.error for case in own]), np.median([case.seconds for case in own])
        counts = (len(wrong), sum(case.reliable for case in wrong), sum(case.reliable for case in own))
        numbers = " | ".join(map(str, counts))
        cell = f"{family} | {degradation} | {len(own)} | {error:.4f} | {numbers} | {_withheld(own)}"
        lines.append(f"| {cell} | {1e3 * seconds:.0f} |")
    return lines


def reliability_table(cases: list[TrustCase]) -> list[str]:
    """A Markdown row for each tenth of the confidence: cases, mean confidence, and how many were right."""
    lines = ["| confidence | cases | mean confidence | right |", "|---|---|---|---|"]
    for tenth, count, mean, right in tenths(cases):
        lines.append(f"| {tenth / 10:.1f} to {(tenth + 1) / 10:.1f} | {count} | {mean:.3f} | {right:.3f} |")
    return lines


def tenths(cases: list[TrustCase]) -> list[tuple[int, int, float, float]]:
    """Of each tenth of the confidence with cases: its number, cases, mean confidence and fraction right."""
    confidence = np.array([case.confidence for case in cases if case.method in METHODS])
    right = np.array([case.error <= WRONG for case in cases if case.method in METHODS])
    place = np.minimum((10 * confidence).astype(int), 9)
    return [
        (tenth, int(some.sum()), float(confidence[some].mean()), float(right[some].mean()))
        for tenth in range(10)
        if (some := place == tenth).any()
    ]


def draw_reliability(cases: list[TrustCase], path: Path) -> None:
    """Fraction right against the mean confidence of each tenth, with intervals of 95 % (Jeffreys), and the numbers."""
    import matplotlib as mpl

    mpl.use("Agg")

    rows = tenths(cases)
    count, mean, right = (np.array([row[column] for row in rows], dtype=float) for column in (1, 2, 3))
    wrong = count * (1 - right)
    low, high = np.asarray(beta.ppf([[0.025], [0.975]], count - wrong + 0.5, wrong + 0.5))
    figure = Figure(figsize=(5, 6), layout="constrained")
    above, below = figure.subplots(2, 1, height_ratios=(3, 1), sharex=True)
    above.plot([0, 1], [0, 1], color="0.6", linestyle="--", label="calibrated")
    reach = np.maximum([right - low, high - right], 0)
    above.errorbar(mean, right, yerr=reach, fmt="o", capsize=3, label="right, with 95 %")
    above.set(ylabel=f"fraction with an RMS error of at most {WRONG}", ylim=(-0.02, 1.02))
    above.legend()
    below.bar([0.05 + row[0] / 10 for row in rows], count, width=0.09)
    below.set(xlabel="confidence", ylabel="answers", yscale="log", xlim=(-0.02, 1.02))
    figure.savefig(path, dpi=120)


def ratio_table(cases: list[TrustCase], chosen: dict[tuple[str, str], str]) -> list[str]:
    """Mean errors over the chosen peer's: all answers, abstentions at the unmoved source's error, and without them."""
    lines = ["| family | degradation | peer | answers | abstentions at the prior | without abstentions |"]
    lines.append("|---|---|---|---|---|---|")
    own = {case.trial: case for case in cases if case.method == OURS}
    peers = {(case.trial, case.method): case.error for case in cases if case.method not in METHODS}
    pairs: dict[tuple[str, str], list[tuple[TrustCase, float]]] = defaultdict(list)
    for trial, case in own.items():
        _, family, degradation, _ = trial.split("/")
        if (error := peers.get((trial, chosen.get((family, degradation), "")))) is not None:
            for cell in ((family, degradation), (family, "all"), ("all", degradation), ("all", "all")):
                pairs[cell].append((case, error))
    for (family, degradation), some in sorted(pairs.items()):
        other = np.array([error for _, error in some])
        errors = np.array([case.error for case, _ in some])
        reliable = np.array([case.reliable for case, _ in some])
        prior = np.where(reliable, errors, [case.unmoved_error for case, _ in some])
        ratios = [_ratio(errors, other), _ratio(prior, other), _ratio(errors[reliable], other[reliable])]
        lines.append(f"| {family} | {degradation} | {chosen.get((family, degradation), '-')} | {' | '.join(ratios)} |")
    return lines


def _ratio(errors: np.ndarray, others: np.ndarray) -> str:
    ratio = ratio_of_means(errors, others, rng=np.random.default_rng(0)) if len(errors) else None
    return "-" if ratio is None else f"{ratio.value:.2f} [{ratio.low:.2f}, {ratio.high:.2f}]"


def best_peers(cases: list[TrustCase]) -> dict[tuple[str, str], str]:
    """The peer of the least mean error in each family and degradation."""
    errors: dict[tuple[str, str], dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for case in cases:
        if case.method not in METHODS:
            _, family, degradation, _ = case.trial.split("/")
            errors[family, degradation][case.method].append(case.error)
    return {cell: min(some, key=lambda name: float(np.mean(some[name]))) for cell, some in errors.items()}


def calibration(cases: list[TrustCase]) -> list[str]:
    """The weights of all cases, thresholds, and wrong answers above `LEVELS` with weights of the other trials."""
    sound = [case for case in cases if case.measures and case.measures[-1] and case.measures[5] <= WIDEST]
    measures, right = np.array([case.measures for case in sound]), np.array([case.error <= WRONG for case in sound])
    fold = np.array([int(case.trial.rsplit("/", 1)[1]) % FOLDS for case in sound])
    logit = np.empty(len(sound))
    for number in range(FOLDS):
        weights = fit_trust(measures[fold != number], right[fold != number].astype(float))
        logit[fold == number] = trust_features(measures[fold == number]) @ weights
    counts = [(level, (logit >= level).sum(), ((logit >= level) & ~right).sum()) for level in LEVELS]
    printed = ", ".join(f"{weight:.4g}" for weight in fit_trust(measures, right.astype(float)))
    chance = 1 / (1 + np.exp(-logit))
    levels = ", ".join(f"{share:g}: {threshold(chance, share):.4f}" for share, _ in THRESHOLDS)
    return [
        printed,
        f"least confidence by share of wrong answers: {levels}",
        _recalibrated(trust_log_odds(measures), right),
        *(f"log odds >= {level}: {count} answers, {wrong} wrong" for level, count, wrong in counts),
    ]


def _recalibrated(logit: np.ndarray, right: np.ndarray) -> str:
    """The constant and factor that fit log odds of being right, shape (n,), to who was right (Platt)."""

    def loss(line: np.ndarray) -> float:
        fitted = line[0] + line[1] * logit
        return float(np.logaddexp(0, fitted).sum() - fitted[right].sum())

    constant, factor = minimize(loss, [0.0, 1.0]).x
    return f"log odds of the present weights: {constant:.3f} + {factor:.3f} times"


def clutter_table(count: int, seed: int) -> list[str]:
    """A Markdown row for each kind of clutter and method: mean error of all answers and of the reliable ones."""
    lines = ["| clutter | method | trials | mean RMS | reliable | their mean RMS | confidently wrong |"]
    lines.append("|---|---|---|---|---|---|---|")
    for clustered in (False, True):
        trials = [clutter_trial(number, clustered=clustered, seed=seed) for number in range(count)]
        cases = [case for trial in trials for case in trust_cases(trial, (OURS, "cpd", "bcpd"))]
        for method in dict.fromkeys(case.method for case in cases):
            own = [case for case in cases if case.method == method]
            reliable = [case.error for case in own if case.reliable]
            mean = f"{np.mean(reliable):.4f}" if reliable else "-"
            start = f"| {'clustered' if clustered else 'uniform'} | {method} | {len(own)} "
            error, wrong = np.mean([case.error for case in own]), sum(error > WRONG for error in reliable)
            lines.append(f"{start}| {error:.4f} | {len(reliable)} | {mean} | {wrong} |")
    return lines


def main() -> int:
    """Run the cases and print the tables or the weights."""
    bench = Bench(
        __doc__,
        generator=Choice(tuple(KINDS), "test"),
        seed=int,
        cases=100,
        rows=Path("trust.jsonl"),
        rate=False,
        calibrate=False,
        rivals=1,
        peers="",
        chosen_by=Path,
        figure=Path,
        clutter=0,
    )
    if bench.clutter:
        with one_blas_thread():
            print("\n".join(clutter_table(bench.clutter, bench.seed)))
        return bench.end()
    peers = tuple(filter(None, bench.peers.split(",")))
    cases = run_cases(
        bench.generator, seed=bench.seed, count=bench.cases, rows=bench.rows, peers=peers, among=bench.rivals
    )
    if bench.rate:
        cases = [case.rated() if case.method in METHODS else case for case in cases]
    if bench.calibrate:
        print("\n".join(calibration(cases)))
        return bench.end()
    tables = [trust_table(cases), cell_table(cases), reliability_table(cases)]
    if peers:
        tables.append(ratio_table(cases, best_peers(read_rows(bench.chosen_by) if bench.chosen_by else cases)))
    for table in tables:
        print("\n".join(table), end="\n\n")
    if bench.figure:
        draw_reliability(cases, bench.figure)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
