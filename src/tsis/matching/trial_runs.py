"""Runs of methods over trials, which may be interrupted and resumed."""

from __future__ import annotations

import multiprocessing
import time
import zlib
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Protocol

import numpy as np

from tsis.matching.distort import Distortion, distort
from tsis.matching.shapes import scattered_texture, tactile_surface
from tsis.matching.trial_rows import TrialRow, append_rows, resumable_rows
from tsis.matching.trials import matching_error
from tsis.model.check import require_integer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.matching.distort import Trial

MOST_WORKERS = 256
LONGEST_REASON = 120


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MatchOutcome:
    """What a method says.

    Attributes
    ----------
    moved
        The source's points after they were moved, shape (n, d).
    reliable
        Whether the method trusts its own answer; None where it does not say.
    """

    moved: NDArray[np.float64]
    reliable: bool | None


class Matcher(Protocol):
    """Anything that matches two point sets; picklable where several processes are asked for."""

    def __call__(
        self, source: NDArray[np.float64], target: NDArray[np.float64], *, rng: np.random.Generator
    ) -> MatchOutcome:
        """Match them."""


def run_trials(
    trials: Iterable[Trial],
    matchers: Mapping[str, Matcher],
    *,
    seed: int = 0,
    file: Path | None = None,
    resume: bool = False,
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> list[TrialRow]:
    """Run every method on every trial.

    Parameters
    ----------
    trials
        Trials of different names.
    matchers
        Methods by name.
    seed
        Of the methods' chance, in [0, 2**32); each trial and method has its own stream, whatever else is run.
    file
        CSV file that rows are added to as they are found; None keeps them in memory alone.
    resume
        Go on with the rows of ``file``; otherwise the file must not exist.
    workers
        Processes, in [1, 256]; times are comparable with one alone.
    progress
        Called with the number of trials that are done, and of all.

    Returns
    -------
    list of Row
        In the order of trials and methods, those of the file among them.

    Raises
    ------
    FileInputError
        When the file exists and is not to be resumed, was begun with another seed, or holds something else.
    InputError
        When a value is out of range.
    """
    require_integer("seed", seed, 0, 2**32 - 1)
    require_integer("workers", workers, 1, MOST_WORKERS)
    wanted = list(trials)
    kept = [] if file is None else resumable_rows(file, seed=seed, resume=resume)
    found = {(row.trial, row.method): row for row in kept}
    left = [(trial, [name for name in matchers if (trial.name, name) not in found]) for trial in wanted]
    todo = [(trial, names) for trial, names in left if names]
    done = len(wanted) - len(todo)
    with ExitStack() as stack:
        add = None if file is None else stack.enter_context(append_rows(file))
        for rows in _judged(todo, matchers, seed, workers, stack):
            found.update({(row.trial, row.method): row for row in rows})
            if add is not None:
                add(rows)
            done += 1
            if progress is not None:
                progress(done, len(wanted))
    return [found[trial.name, name] for trial in wanted for name in matchers]


def evaluate_trial(trial: Trial, matchers: Mapping[str, Matcher], *, seed: int) -> list[TrialRow]:
    """Run the methods on one trial.

    Parameters
    ----------
    trial
        What to match.
    matchers
        Methods by name.
    seed
        Of their chance.
    """
    return [_row(trial, name, matcher, seed) for name, matcher in matchers.items()]


def _row(trial: Trial, name: str, matcher: Matcher, seed: int) -> TrialRow:
    rng = np.random.default_rng([seed, zlib.crc32(f"{trial.name} {name}".encode())])
    start = time.perf_counter()
    refused, reliable = "", None
    try:
        matched = matcher(trial.source, trial.target, rng=rng)
        seconds = time.perf_counter() - start
        error, reliable = matching_error(trial, matched.moved), matched.reliable
    except Exception as broken:  # hours of other trials must not be lost because a method breaks on this one
        seconds = time.perf_counter() - start
        error = matching_error(trial, trial.source)
        refused = " ".join(f"{type(broken).__name__}: {broken}".split())[:LONGEST_REASON]
    return TrialRow(
        trial=trial.name,
        method=name,
        seed=seed,
        error=error,
        seconds=seconds,
        reliable="" if reliable is None else "yes" if reliable else "no",
        refused=refused,
    )


def _judged(
    todo: Sequence[tuple[Trial, list[str]]],
    matchers: Mapping[str, Matcher],
    seed: int,
    workers: int,
    stack: ExitStack,
) -> Iterator[list[TrialRow]]:
    """Rows of each trial, here or from a pool of processes."""
    tasks = [(trial, {name: matchers[name] for name in names}) for trial, names in todo]
    if workers == 1 or len(tasks) < 2:
        if tasks:
            _warm(matchers, tasks[0][0].source.shape[1])
        return (evaluate_trial(trial, chosen, seed=seed) for trial, chosen in tasks)
    # Forked children would share what threads of the libraries hold at that moment.
    pool = ProcessPoolExecutor(
        workers,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_warm,
        initargs=(matchers, tasks[0][0].source.shape[1]),
    )
    stack.callback(pool.shutdown, cancel_futures=True)
    return pool.map(partial(_judge_task, seed=seed), tasks)


def _warm(matchers: Mapping[str, Matcher], dimension: int) -> None:
    """Run each method once, lest compiling and loading count as time of the first trial."""
    rng = np.random.default_rng(0)
    trial = distort((scattered_texture if dimension == 2 else tactile_surface)(30, rng=rng), Distortion(), rng=rng)
    for matcher in matchers.values():
        with suppress(Exception):  # told of where it matters, in the rows
            matcher(trial.source, trial.target, rng=rng)


def _judge_task(task: tuple[Trial, dict[str, Matcher]], *, seed: int) -> list[TrialRow]:
    return evaluate_trial(*task, seed=seed)


__all__ = ["MatchOutcome", "Matcher", "evaluate_trial", "run_trials"]
