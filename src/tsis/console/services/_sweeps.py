"""Sweeps of a console: plans in its workspace, computed as jobs that can be cancelled and resumed, and their rows."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import ControlError, FileInputError, InputError, TsisError
from tsis.files.atomic import write_durably
from tsis.files.frame_names import require_file_stem
from tsis.sweep.data_set import read_data_set
from tsis.sweep.plan import Plan, load_plan, parse_plan_text
from tsis.sweep.run import run_sweep, seconds_per_press

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.console.services._jobs import Job, Jobs


WORKERS = 1  # processes of a sweep: the camera and the pages need the others
MOST_POINTS = 5000  # of a plot


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepState:
    """A sweep of the workspace; ``trouble`` says why its plan cannot be read."""

    name: str
    presses: int = 0
    shards: int = 0
    finished: int = 0
    trouble: str = ""

    @property
    def complete(self) -> bool:
        """Whether nothing is left to compute."""
        return 0 < self.shards == self.finished


def sweep_title(name: str) -> str:
    """Title of a sweep's job."""
    return f"sweep {name}"


def varying_columns(rows: Mapping[str, NDArray[np.float64]]) -> list[str]:
    """The columns whose numbers differ; refused presses, which are no numbers, do not count."""
    return [column for column, values in rows.items() if len({value for value in values if value == value}) > 1]


class Sweeps:
    """The sweeps below a folder: each a plan ``NAME.toml`` and a data set ``NAME``; safe for several threads."""

    def __init__(self, folder: Path, jobs: Jobs) -> None:
        self._folder, self._jobs, self._lock = folder, jobs, threading.Lock()

    def listed(self) -> tuple[SweepState, ...]:
        """All sweeps, by name."""
        return tuple(self._state(file.stem) for file in sorted(self._folder.glob("*.toml")))

    def _state(self, name: str) -> SweepState:
        try:
            plan = self._plan(name)
        except TsisError as error:
            return SweepState(name=name, trouble=str(error))
        finished = sum(1 for _ in (self._folder / name).glob("part-*.parquet"))
        return SweepState(name=name, presses=plan.presses, shards=plan.shards, finished=finished)

    def cost(self, text: str) -> tuple[Plan, float]:
        """The plan in a text, and about how long it takes here, s; errors as of `seconds_per_press`."""
        plan = parse_plan_text(text)
        return plan, seconds_per_press(plan) * plan.presses / WORKERS

    def begin(self, name: str, text: str) -> Job:
        """Begin a new sweep; `InputError` for a bad plan or name, or where there is one of this name."""
        plan = parse_plan_text(text)
        file = self._folder / f"{require_file_stem(name)}.toml"
        if file.exists() or (self._folder / name).exists():
            raise InputError(f"name must be a new one; there is a sweep {name} already (resume it, or choose another)")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileInputError(f"the folder of sweeps must be writable; got: {error.strerror or error}") from error
        write_durably(file, text.encode())
        return self._run(name, plan)

    def resume(self, name: str) -> Job:
        """Compute what is left of a sweep."""
        return self._run(name, self._plan(name))

    def rows(self, name: str) -> Mapping[str, NDArray[np.float64]]:
        """The numbers of the finished files, a row for each press; of a profile the value at its first radius."""
        self._plan(name)
        data = read_data_set(self._folder / name, partial=True)
        radius = float(data.pop("radius_mm")[0])
        rows = {
            column if values.ndim == 1 else f"{column} at r = {radius:g} mm": values
            if values.ndim == 1
            else values[:, 0]
            for column, values in data.items()
            if values.dtype.kind in "fiu"
        }
        every = max(1, -(-max((len(values) for values in rows.values()), default=0) // MOST_POINTS))
        return {column: np.asarray(values[::every], dtype=float) for column, values in rows.items()}

    def _plan(self, name: str) -> Plan:
        return load_plan(self._folder / f"{require_file_stem(name)}.toml")

    def _run(self, name: str, plan: Plan) -> Job:
        title = sweep_title(name)

        def work(job: Job) -> None:
            done = run_sweep(plan, self._folder / name, workers=WORKERS, progress=job.advance)
            refused = f", {done.refused} of them rejected by the model" if done.refused else ""
            job.say(f"{done.presses} presses in {done.folder}{refused}")

        with self._lock:
            if any(state.running and state.title == title for state in self._jobs.states()):
                raise ControlError(f"the sweep {name} is already running (cancel it, or wait)")
            return self._jobs.begin(title, work)
