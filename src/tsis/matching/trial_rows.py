"""Rows of a benchmark, one a trial and method, in a CSV file that is added to while the benchmark runs."""

from __future__ import annotations

import csv
import io
import math
from contextlib import contextmanager
from dataclasses import astuple, dataclass, fields
from typing import TYPE_CHECKING

from tsis.instrument.file_bytes import one_line, printable_path, read_bytes
from tsis.model.errors import FileInputError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialRow:
    """What one method made of one trial.

    Attributes
    ----------
    trial
        Name of the trial: what it belongs to, its level and its number, with slashes between.
    method
        Name of the method.
    seed
        Of the run.
    error
        Root-mean-square error in the unit of the trial's points. A method that breaks or refuses has moved nothing,
        and is judged by that.
    seconds
        Time that it took, without compiling.
    reliable
        Whether the method trusted its answer: ``"yes"``, ``"no"``, or empty where it does not say.
    refused
        Why there is no answer; empty where there is one.
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
    """Rows of a file that `run_trials` wrote; a last line that was cut off is left out.

    Raises
    ------
    FileInputError
        When the file cannot be read or holds something else.
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
    """Rows that a run with ``seed`` may go on with, none where the file does not exist yet.

    Raises
    ------
    FileInputError
        When the file exists and is not to be resumed, was begun with another seed, or holds something else.
    """
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
    """A call that adds rows to the file, made where it is missing; they are in the file when it returns.

    Raises
    ------
    FileInputError
        When the file cannot be written.
    """
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
    """The text up to its last line end: what follows was cut off when a run was killed."""
    return text[: text.rfind("\n") + 1]


__all__ = ["TrialRow", "append_rows", "read_trial_rows", "resumable_rows"]
