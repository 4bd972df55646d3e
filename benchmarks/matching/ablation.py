"""What the match of the method tprl loses without each of its modules, on trials of the third generator and in clutter.

    python -m benchmarks.matching.ablation --seed 60015 --cases 5 --rows ablation.jsonl

runs ``--cases`` trials of each family and degradation as they are and without each part of `PARTS`, and prints a table.
A second one is of clutter: five times as many trials of each shape of the second generator, of textures and of surfaces
in space, all with outliers. ``--parts relaxation`` leaves the other parts out. Differences of the share of wrong
answers have the standard error of pairs. A run that was stopped continues with the rows in the file. Without

- ``outline`` no points are joined to curves: no alignment, no piece is laid, nothing slides;
- ``refinement`` the maps of the search stay as soft and nearest pairs leave them;
- ``relaxation`` labels propose no poses;
- ``pose_search`` the source starts as it lies;
- ``pose_evidence`` maps are judged by their squared residuals and points without partner;
- ``posterior`` the map of the best pairs is the answer: no prior of the rotation, no sum over the maps of a pose, and
  its confidence is its share of the evidence.
"""

from __future__ import annotations

import json
import sys
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import numpy as np
from benchmarks.harness import Bench
from benchmarks.matching import summary
from benchmarks.matching.distort import Distortion, distort, even_texture, scattered_texture, tactile_surface
from benchmarks.matching.fresh_shapes import AMOUNTS, SHAPES, fresh_trial
from benchmarks.matching.summary import TrustCase, trust_cases
from benchmarks.matching.trust import CLOSE, OURS, WRONG, read_rows
from benchmarks.matching.trust_shapes import FAMILIES, trust_trial

from tsis.compiled import one_blas_thread
from tsis.matching import pose_evidence, pose_search, posterior

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from benchmarks.matching.distort import Trial

    from tsis.matching.methods import Floats, Integers
    from tsis.matching.pose_evidence import PoseEvidence, SmoothField
    from tsis.matching.pose_search import PoseSearch

TEXTURES = (scattered_texture, even_texture, tactile_surface)
RESIDUAL, MISSING = 0.03, 4.5  # standard deviation of a pair in radii, and log probability of a point without partner


def _no_curves(points: Floats) -> Integers:
    return np.full(len(points), -1)


def _as_it_lies(search: PoseSearch, *, rng: np.random.Generator) -> list[PoseEvidence]:
    del rng
    pose = pose_search.settled(search, search.source)
    return [] if pose is None else [pose]


_EVIDENCE = pose_evidence.paired_evidence


def _residual_evidence(
    field: SmoothField, rows: Integers, partners: Floats, target: Floats, *rest: Integers, **options: Any
) -> PoseEvidence:
    found = _EVIDENCE(field, rows, partners, target, *rest, **options)
    away = ((found.moved[rows] - partners) ** 2).sum() + options["scatter"]
    missing = len(found.moved) + len(target) - 2 * found.paired
    return replace(found, log=float(-0.5 * away / RESIDUAL**2 - MISSING * missing))


def _best_pairs(search: PoseSearch, maps: list[PoseEvidence]) -> Floats:
    del search
    return np.array([pose.log for pose in maps])


PARTS: dict[str, tuple[tuple[Any, str, Callable[..., Any]], ...]] = {
    "nothing": (),
    "outline": ((pose_search, "successors", _no_curves),),
    "refinement": (
        (pose_search, "_improved_again", lambda _, evidence: evidence),
        (pose_search, "_mended", lambda *given: [given[-1]]),
        (pose_search, "_followed", lambda _, pose: pose),
    ),
    "relaxation": ((pose_search, "poses", lambda *_, **__: []),),
    "pose_search": ((posterior, "search_poses", _as_it_lies),),
    "pose_evidence": ((pose_evidence, "paired_evidence", _residual_evidence),),
    "posterior": (
        (posterior, "_judged", _best_pairs),
        (posterior, "log_rotation_prior", lambda *_: 0.0),
        (summary, "probability_right", lambda measures: float(1 / (1 + np.exp(-measures[0])))),
    ),
}


def fresh_trials(seed: int, count: int) -> Iterator[Trial]:
    """Trials of each family and degradation of the third generator."""
    for number in range(count):
        for degradation in AMOUNTS:
            for family in SHAPES:
                yield fresh_trial(family, degradation, number, seed=seed)


def clutter_trials(seed: int, count: int) -> Iterator[Trial]:
    """Trials with outliers: of each shape of the second generator, and of textures and surfaces without curves."""
    for number in range(count):
        for family in FAMILIES:
            yield trust_trial("test", family, "outliers", number, seed=seed)
        for place, shape in enumerate(TEXTURES):
            rng = np.random.default_rng([seed, place, number])
            amounts = Distortion(
                bending=0.04, affine=0.1, outlier_ratio=rng.uniform(0.2, 1.0), rotation_deg=rng.uniform(0.0, 60.0)
            )
            name = f"clutter/{shape.__name__}/outliers/{number}"
            yield distort(shape(100, rng=rng), amounts, rng=rng, name=name)


def run_parts(trials: Iterable[Trial], parts: Sequence[str], rows: Path) -> list[TrustCase]:
    """The cases of the trials as they are and without each of the parts; the method of a case names the part."""
    cases = {(case.trial, case.method): case for case in read_rows(rows)}
    found = []
    with one_blas_thread(), rows.open("a", encoding="utf-8") as file:
        for trial in trials:
            for part in parts:
                if (trial.name, part) not in cases:
                    with ExitStack() as stack:
                        for module, name, instead in PARTS[part]:
                            stack.enter_context(patch.object(module, name, instead))
                        cases[trial.name, part] = replace(next(trust_cases(trial, (OURS,))), method=part)
                    file.write(json.dumps(asdict(cases[trial.name, part])) + "\n")
                    file.flush()
                found.append(cases[trial.name, part])
    return found


def part_rows(cases: list[TrustCase]) -> list[list[str]]:
    """A row for each part: mean error, wrong answers more than with it, withheld though close, seconds."""
    own: dict[str, dict[str, TrustCase]] = {}
    for case in cases:
        own.setdefault(case.method, {})[case.trial] = case
    names = sorted(own["nothing"])
    base = np.array([own["nothing"][name].error > WRONG for name in names], dtype=float)
    table = []
    for part, some in own.items():
        found = [some[name] for name in names]
        wrong = np.array([case.error > WRONG for case in found], dtype=float)
        more = 100 * (wrong - base)
        close = [case for case in found if case.error < CLOSE]
        table.append(
            [
                part,
                f"{np.mean([case.error for case in found]):.4f}",
                f"{100 * wrong.mean():.1f}",
                f"{more.mean():+.1f} ± {more.std() / np.sqrt(len(more)):.1f}",
                str(sum(case.reliable for case in found if case.error > WRONG)),
                f"{100 * np.mean([not case.reliable for case in close]):.0f}",
                f"{1e3 * np.mean([case.seconds for case in found]):.0f}",
            ]
        )
    return table


def main() -> int:
    """Run the trials and print the table."""
    bench = Bench(__doc__, seed=int, cases=5, parts=",".join(PARTS), rows=Path("ablation.jsonl"))
    parts = list(dict.fromkeys(["nothing", *filter(None, bench.parts.split(","))]))
    heads = ("without", "mean RMS", "wrong, %", "more", "confidently wrong", "withheld though close, %", "ms")
    fresh = run_parts(fresh_trials(bench.seed, bench.cases), parts, bench.rows)
    bench.table("Without each module", heads, part_rows(fresh))
    clutter = run_parts(clutter_trials(bench.seed, 5 * bench.cases), parts, bench.rows)
    bench.table("Without each module, in clutter", heads, part_rows(clutter))
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
