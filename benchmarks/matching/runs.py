"""Rows of a benchmark, one a trial and method, in a CSV file that is added to while the benchmark runs."""

from __future__ import annotations

import csv
import io
import math
import multiprocessing
import time
import zlib
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import astuple, dataclass, fields
from functools import partial
from typing import TYPE_CHECKING, Protocol

import numpy as np
from benchmarks.matching.distort import Distortion, distort, scattered_texture, tactile_surface
from benchmarks.matching.trials import matching_error

from tsis.errors import FileInputError
from tsis.files import one_line, printable_path, read_bytes
from tsis.model import require_integer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from benchmarks.matching.distort import Trial

    from tsis.matching._fit import Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialRow:
    """Result of one method on one trial.

    Attributes
    ----------
    trial
        Name of the trial: group, level and number, separated by slashes.
    method
        Name of the method.
    seed
        Of the run.
    error
        Root-mean-square error in the unit of the trial's points; that of the unmoved source after an exception.
    seconds
        Processor time, without compilation.
    reliable
        Whether the method rates its result as reliable: ``"yes"``, ``"no"``, or empty without a rating.
    refused
        Reason for the missing result; empty where there is one.
    """

    trial: str
    method: str
    seed: int
    error: float
    seconds: float
    reliable: str
    refused: str

    @property
    def group(self) -> str:
        """The trial's name without its level and number."""
        return self.trial.rsplit("/", 2)[0]

    @property
    def level(self) -> str:
        """The trial's level."""
        return self.trial.rsplit("/", 2)[1]


LARGEST_BYTES, MOST_LINES = 64 * 2**20, 300_000
TRIAL_ROW_HEAD = tuple(field.name for field in fields(TrialRow))


def read_trial_rows(file: Path) -> list[TrialRow]:
    """Rows of a file that `run_trials` wrote, without an incomplete last line.

    Raises
    ------
    FileInputError
        When the file cannot be read or has another content.
    """
    try:
        content = read_bytes(file, most=LARGEST_BYTES)
        if content.count(b"\n") + content.count(b"\r") > MOST_LINES:
            raise FileInputError(f"{printable_path(file)} must have at most {MOST_LINES} lines; it has more")
        text = content.decode("utf-8")
        lines = list(csv.reader(io.StringIO(_whole(text), newline="")))
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileInputError(f"{printable_path(file)} must be a file of trials; got: {one_line(error, 80)}") from error
    if not lines or tuple(lines[0]) != TRIAL_ROW_HEAD:
        raise FileInputError(f"{str(file)!r:.160} must be a file of trials; its first line is another")
    try:
        return [_read(cells) for cells in lines[1:]]
    except ValueError as error:
        raise FileInputError(f"{str(file)!r:.160} must hold one row a trial; got: {one_line(error, 80)}") from error


def _read(cells: list[str]) -> TrialRow:
    trial, method, seed, error, seconds, reliable, refused = cells
    row = TrialRow(
        trial=trial,
        method=method,
        seed=int(seed),
        error=float(error),
        seconds=float(seconds),
        reliable=reliable,
        refused=refused,
    )
    if trial.count("/") < 2 or not math.isfinite(row.error + row.seconds):
        raise ValueError(",".join(cells))
    return row


def resumable_rows(file: Path, *, seed: int, resume: bool) -> list[TrialRow]:
    """Rows that a run with ``seed`` continues, none where the file does not exist yet; others are refused."""
    if not file.exists():
        return []
    if not resume:
        raise FileInputError(f"{str(file)!r:.160} must be new; it exists (choose another folder, or resume it)")
    rows = read_trial_rows(file)
    other = next((row.seed for row in rows if row.seed != seed), seed)
    if other != seed:
        raise FileInputError(f"{str(file)!r:.160} must have been begun with the seed {seed}; got {other}")
    return rows


@contextmanager
def append_rows(file: Path) -> Iterator[Callable[[Sequence[TrialRow]], None]]:
    """A function that adds rows to the file, created where it is missing; they are in the file when it returns."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        before = _whole(file.read_text(encoding="utf-8")) if file.exists() else ",".join(TRIAL_ROW_HEAD) + "\n"
        file.write_text(before, encoding="utf-8")
        stream = file.open("a", encoding="utf-8", newline="")
    except OSError as error:
        raise FileInputError(f"{str(file)!r:.160} must be writable; got: {error.strerror}") from error
    with stream:

        def add(rows: Sequence[TrialRow]) -> None:
            csv.writer(stream, lineterminator="\n").writerows(map(astuple, rows))
            stream.flush()

        yield add


def _whole(text: str) -> str:
    """The text up to its last line end, without the rest of a killed run."""
    return text[: text.rfind("\n") + 1]


MOST_WORKERS = 256
LONGEST_REASON = 120


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MatchOutcome:
    """Result of a method."""

    transformed: Floats  # the source's points after the transform, shape (n, d)
    reliable: bool | None  # whether the method rates its result as reliable; None without a rating


class Matcher(Protocol):
    """A method that matches two point sets; picklable for runs in several processes."""

    def __call__(self, source: Floats, target: Floats, *, rng: np.random.Generator) -> MatchOutcome:
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
        Of the methods' random streams, in [0, 2**32); each trial and method has its own.
    file
        CSV file that rows are added to during the run; None saves no file.
    resume
        Continue with the rows of ``file``; otherwise the file must not exist.
    workers
        Processes, in [1, 256]; times are comparable only with one.
    progress
        Called with (trials done, all trials).

    Returns
    -------
    list of TrialRow
        In the order of trials and methods, with those of the file.

    Raises
    ------
    FileInputError
        When the file exists without ``resume``, was begun with another seed, or has another content.
    InputError
        When a value is out of range.
    """
    require_integer("seed", seed, 0, 2**32 - 1)
    require_integer("workers", workers, 1, MOST_WORKERS)
    requested = list(trials)
    selected = [] if file is None else resumable_rows(file, seed=seed, resume=resume)
    results = {(row.trial, row.method): row for row in selected}
    left = [(trial, [name for name in matchers if (trial.name, name) not in results]) for trial in requested]
    todo = [(trial, names) for trial, names in left if names]
    done = len(requested) - len(todo)
    with ExitStack() as stack:
        add = None if file is None else stack.enter_context(append_rows(file))
        for rows in _trial_row(todo, matchers, seed, workers, stack):
            results.update({(row.trial, row.method): row for row in rows})
            if add is not None:
                add(rows)
            done += 1
            if progress is not None:
                progress(done, len(requested))
    return [results[trial.name, name] for trial in requested for name in matchers]


def evaluate_trial(trial: Trial, matchers: Mapping[str, Matcher], *, seed: int) -> list[TrialRow]:
    """Run the methods on one trial."""
    return [_row(trial, name, matcher, seed) for name, matcher in matchers.items()]


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


def _trial_row(
    todo: Sequence[tuple[Trial, list[str]]], matchers: Mapping[str, Matcher], seed: int, workers: int, stack: ExitStack
) -> Iterator[list[TrialRow]]:
    """Rows of each trial, here or from a pool of processes."""
    tasks = [(trial, {name: matchers[name] for name in names}) for trial, names in todo]
    if workers == 1 or len(tasks) < 2:
        if tasks:
            _warm(matchers, tasks[0][0].source.shape[1])
        return (evaluate_trial(trial, chosen, seed=seed) for trial, chosen in tasks)
    # Forked children would share the locks of the libraries' threads.
    pool = ProcessPoolExecutor(
        workers,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_warm,
        initargs=(matchers, tasks[0][0].source.shape[1]),
    )
    stack.callback(pool.shutdown, cancel_futures=True)
    return pool.map(partial(_run_task, seed=seed), tasks)


def _warm(matchers: Mapping[str, Matcher], dimension: int) -> None:
    """Run each method once, so that the time of the first trial excludes compilation and loading."""
    rng = np.random.default_rng(0)
    trial = distort((scattered_texture if dimension == 2 else tactile_surface)(30, rng=rng), Distortion(), rng=rng)
    for matcher in matchers.values():
        with suppress(Exception):  # it recurs in the rows
            matcher(trial.source, trial.target, rng=rng)


def _run_task(task: tuple[Trial, dict[str, Matcher]], *, seed: int) -> list[TrialRow]:
    return evaluate_trial(*task, seed=seed)
