"""Rows of a benchmark, one a trial and method; a file of finished ones lets an interrupted run go on."""

from __future__ import annotations

import time
import zlib
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from benchmarks.harness import append_line, read_lines
from benchmarks.matching.distort import Distortion, distort, scattered_texture, tactile_surface
from benchmarks.matching.trials import matching_error

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from benchmarks.matching.distort import Floats, Trial


LONGEST_REASON = 120


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialRow:
    """Result of one method on one trial."""

    trial: str  # name of the trial: group, level and number, separated by slashes
    method: str  # name of the method
    seed: int  # of the run
    # root-mean-square error in the unit of the trial's points; that of the unmoved source after an exception
    error: float
    seconds: float  # processor time, without compilation
    reliable: str  # whether the method rates its result as reliable: ``"yes"``, ``"no"``, or empty without a rating
    refused: str  # reason for the missing result; empty where there is one

    @property
    def group(self) -> str:
        """The trial's name without its level and number."""
        return self.trial.rsplit("/", 2)[0]

    @property
    def level(self) -> str:
        """The trial's level."""
        return self.trial.rsplit("/", 2)[1]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MatchOutcome:
    """Result of a method."""

    transformed: Floats  # the source's points after the transform, shape (n, d)
    reliable: bool | None  # whether the method rates its result as reliable; None without a rating


class Matcher(Protocol):
    """A method that matches two point sets."""

    def __call__(self, source: Floats, target: Floats, *, rng: np.random.Generator) -> MatchOutcome:
        """Match them."""


def run_trials(
    trials: Iterable[Trial], matchers: Mapping[str, Matcher], *, seed: int = 0, file: Path | None = None
) -> list[TrialRow]:
    """Run every method on every trial, in the order of trials and methods.

    ``seed`` is that of the methods' random streams; each trial and method has its own. Rows of the same seed that
    ``file`` holds are not run again, and new ones are added to it as they come.
    """
    rows, warm = [], set[int]()
    done = read_lines(file, "key")
    for trial in trials:
        for name, matcher in matchers.items():
            key = f"{seed} {trial.name} {name}"
            if key not in done:
                dimension = trial.source.shape[1]
                if dimension not in warm:
                    _warm(matchers, dimension)
                    warm.add(dimension)
                done[key] = {"key": key, **asdict(_row(trial, name, matcher, seed))}
                append_line(file, done[key])
            rows.append(TrialRow(**{field: value for field, value in done[key].items() if field != "key"}))
    return rows


def _row(trial: Trial, name: str, matcher: Matcher, seed: int) -> TrialRow:
    rng = np.random.default_rng([seed, zlib.crc32(f"{trial.name} {name}".encode())])
    start = time.process_time()
    refused, reliable = "", None
    try:
        matched = matcher(trial.source, trial.target, rng=rng)
        seconds = time.process_time() - start
        error, reliable = matching_error(trial, matched.transformed), matched.reliable
    except Exception as broken:  # an exception on one trial must not lose hours of other trials
        seconds = time.process_time() - start
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


def _warm(matchers: Mapping[str, Matcher], dimension: int) -> None:
    """Run each method once, so that the time of the first trial excludes compilation and loading."""
    rng = np.random.default_rng(0)
    trial = distort((scattered_texture if dimension == 2 else tactile_surface)(30, rng=rng), Distortion(), rng=rng)
    for matcher in matchers.values():
        with suppress(Exception):  # it recurs in the rows
            matcher(trial.source, trial.target, rng=rng)
