"""How often each matching method is confidently wrong, or withholds a right answer, on shapes of a second generator.

    python -m benchmarks.matching_trust --seed 1001 --cases 40 --rows trust.jsonl

runs ``--cases`` trials of each family and degradation, and prints the tables. A run that was stopped continues with the
rows in the file. ``--generator calibration --calibrate`` prints the weights of `tsis.matching._posterior` instead.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from dataclasses import asdict
from pathlib import Path

import numpy as np
from benchmarks.matching_trust_shapes import DEGRADATIONS, FAMILIES, Generator, trust_trial

from tsis.compiled import one_blas_thread
from tsis.matching import METHODS
from tsis.matching.trials import TrustCase, fit_trust, trust_case

WRONG, RIGHT, RIVALRY = 0.1, 0.02, 0.01  # errors, and the probability of other poses above which withholding is right
OURS = "tprl"


def run_cases(generator: Generator, *, seed: int, count: int, rows: Path) -> list[TrustCase]:
    """All cases of our method, and of one rival in turn, with those that the file already holds."""
    cases = _read(rows)
    done = {(case.trial, case.method) for case in cases}
    rivals = [name for name in METHODS if name != OURS]
    with one_blas_thread(), rows.open("a", encoding="utf-8") as file:
        for number in range(count):
            for place, degradation in enumerate(DEGRADATIONS):
                for family in FAMILIES:
                    for method in (OURS, rivals[(number + place) % len(rivals)]):
                        if (f"{generator}/{family}/{degradation}/{number}", method) in done:
                            continue
                        trial = trust_trial(generator, family, degradation, number, seed=seed)
                        cases.append(trust_case(trial, method))
                        file.write(json.dumps(asdict(cases[-1])) + "\n")
                        file.flush()
    return cases


def _read(rows: Path) -> list[TrustCase]:
    lines = rows.read_text(encoding="utf-8").splitlines() if rows.exists() else []
    records = [json.loads(line) for line in lines]
    return [TrustCase(**{**record, "measures": tuple(record["measures"])}) for record in records]


def trust_table(cases: list[TrustCase]) -> list[str]:
    """A Markdown row for each method: cases, wrong, confidently wrong, reliable, withheld though right."""
    lines = [
        "| method | cases | wrong | confidently wrong | reliable | withheld though right |",
        "|---|---|---|---|---|---|",
    ]
    for method in METHODS:
        own = [case for case in cases if case.method == method]
        wrong = [case for case in own if case.error > WRONG]
        right = [case for case in own if case.error < RIGHT and case.second < RIVALRY]
        withheld = sum(not case.reliable for case in right)
        counts = (len(own), len(wrong), sum(case.reliable for case in wrong), sum(case.reliable for case in own))
        lines.append(f"| {method} | {' | '.join(map(str, counts))} | {withheld} of {len(right)} |")
    return lines


def cell_table(cases: list[TrustCase]) -> list[str]:
    """A Markdown row for each family and degradation of our method."""
    lines = ["| family | degradation | cases | median RMS | wrong | confidently wrong | reliable | median time / ms |"]
    lines.append("|---|---|---|---|---|---|---|---|")
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
        lines.append(f"| {family} | {degradation} | {len(own)} | {error:.4f} | {numbers} | {1e3 * seconds:.0f} |")
    return lines


def reliability_table(cases: list[TrustCase]) -> list[str]:
    """A Markdown row for each tenth of the confidence: cases, mean confidence, and how many were right."""
    confidence = np.array([case.confidence for case in cases])
    right = np.array([case.error <= WRONG for case in cases])
    lines = ["| confidence | cases | mean confidence | right |", "|---|---|---|---|"]
    for tenth in range(10):
        chosen = np.minimum((10 * confidence).astype(int), 9) == tenth
        if chosen.any():
            mean = f"{confidence[chosen].mean():.3f} | {right[chosen].mean():.3f}"
            lines.append(f"| {tenth / 10:.1f} to {(tenth + 1) / 10:.1f} | {chosen.sum()} | {mean} |")
    return lines


def main() -> None:
    """Run the cases and print the tables or the weights."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--generator", choices=("calibration", "test"), default="test")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--cases", type=int, default=100, help="trials of each family and degradation")
    parser.add_argument("--rows", type=Path, required=True, help="JSON lines, a case each; continued where it exists")
    parser.add_argument("--calibrate", action="store_true", help="print the weights of the regression")
    chosen = parser.parse_args()
    cases = run_cases(chosen.generator, seed=chosen.seed, count=chosen.cases, rows=chosen.rows)
    if chosen.calibrate:
        sound = [case for case in cases if case.measures]
        right = np.array([float(case.error <= WRONG) for case in sound])
        print(", ".join(f"{weight:.4g}" for weight in fit_trust(np.array([case.measures for case in sound]), right)))
        return
    for table in (trust_table(cases), cell_table(cases), reliability_table(cases)):
        print("\n".join(table), end="\n\n")


if __name__ == "__main__":
    main()
