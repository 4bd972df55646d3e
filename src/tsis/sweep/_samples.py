"""The phantoms of a plan in batches, the same on every run and without all of them in memory; their presses as rows."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
import scipy
from threadpoolctl import threadpool_limits

from tsis.errors import TsisError
from tsis.sweep._plan import PROFILES, Range

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from numpy.typing import NDArray

    from tsis.model import Phantom, PressField, Probe
    from tsis.sweep._plan import Plan


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SweepBatch:
    """The phantoms of a file, numbered from 0: the number of the first, and by quantity one value per phantom."""

    shard: int
    first: int
    values: dict[str, NDArray[np.float64]]

    @property
    def samples(self) -> int:
        """Number of phantoms."""
        return len(next(iter(self.values.values())))


def sweep_batches(plan: Plan) -> Iterator[SweepBatch]:
    """Every batch of ``plan`` in the order of its files."""
    values = _grid(plan) if plan.sample == "grid" else _sampled(plan)
    for shard in range(plan.shards):
        first = shard * plan.batch
        size = min(plan.batch, plan.samples - first)
        yield SweepBatch(shard=shard, first=first, values=values(first, size))


def _sampled(plan: Plan) -> Callable[[int, int], dict[str, NDArray[np.float64]]]:
    names = plan.sampled
    draw = _unit_points(plan.sample, len(names), plan.samples, plan.seed or 0)

    def values(_: int, size: int) -> dict[str, NDArray[np.float64]]:
        unit = dict(zip(names, draw(size).T, strict=True))
        return {
            name: value.at(unit[name]) if isinstance(value, Range) else np.full(size, value, dtype=float)
            for name, value in plan.quantities.items()
        }

    return values


def _unit_points(sample: str, dimensions: int, count: int, seed: int) -> Callable[[int], NDArray[np.float64]]:
    """Draws the next points of the unit cube, shape (size, dimensions); ``count`` in all."""
    if sample == "random":
        rng = np.random.default_rng(seed)
        return lambda size: rng.random((size, dimensions))
    if sample == "latin-hypercube":
        left = iter(scipy.stats.qmc.LatinHypercube(dimensions, rng=seed).random(count))
        return lambda size: np.array([next(left) for _ in range(size)])
    sequence = scipy.stats.qmc.Sobol(dimensions, rng=seed)

    def draw(size: int) -> NDArray[np.float64]:
        with warnings.catch_warnings():
            # SciPy warns of a first piece that is no power of two; only the whole count matters.
            warnings.filterwarnings("ignore", message="The balance properties", category=UserWarning)
            return sequence.random(size)

    return draw


def _grid(plan: Plan) -> Callable[[int, int], dict[str, NDArray[np.float64]]]:
    lists = {
        name: np.array(value if isinstance(value, tuple) else (value,), dtype=float)
        for name, value in plan.quantities.items()
        if not isinstance(value, Range)
    }
    shape = tuple(len(values) for values in lists.values())

    def values(first: int, size: int) -> dict[str, NDArray[np.float64]]:
        positions = np.unravel_index(np.arange(first, first + size), shape)  # the last quantity runs fastest
        return {name: lists[name][position] for name, position in zip(lists, positions, strict=True)}

    return values


LONGEST_ERROR = 300
# Singular matrices; any other failure is a fault of the program and stops the sweep.
REFUSALS = (TsisError, np.linalg.LinAlgError, ArithmeticError)


class PressFunction(Protocol):
    """Function for a press: `tsis.mechanics.press`, or a stand-in."""

    def __call__(self, probe: Probe, phantom: Phantom, /, *, force_n: float, strain: str) -> PressField:
        """Press ``phantom`` with ``probe``."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rows:
    """Presses as columns, ordered by phantom, then by force.

    Attributes
    ----------
    sample
        Number of the phantom in the sweep, shape (n,).
    numbers
        By name: ``force_n`` and the plan's quantities, shape (n,); then the plan's columns, shape (n,), profiles
        (n, number of radii). NaN where the press was refused.
    error
        Reason where a press was refused, empty elsewhere.
    """

    sample: NDArray[np.int64]
    numbers: dict[str, NDArray[np.float64]]
    error: list[str]

    @property
    def refused(self) -> int:
        """Number of refused presses."""
        return sum(map(bool, self.error))


def press_all(plan: Plan, batch: SweepBatch, press: PressFunction) -> Rows:
    """Press every phantom of ``batch`` with every force of ``plan``."""
    forces, count = len(plan.forces_n), batch.samples * len(plan.forces_n)
    numbers = {"force_n": np.tile(np.array(plan.forces_n), batch.samples)}
    numbers |= {name: np.repeat(values, forces) for name, values in batch.values.items()}
    outputs = {
        name: np.full((count, len(plan.radii_mm)) if name in PROFILES else count, np.nan) for name in plan.columns
    }
    error = [""] * count
    with threadpool_limits(limits=1):  # results of several threads depend on their number
        for row in range(count):
            values = {name: float(column[row]) for name, column in numbers.items()}
            try:
                document = _output_values(plan, values, press)
            except REFUSALS as reason:
                error[row] = f"{type(reason).__name__}: {reason}"[:LONGEST_ERROR]
                continue
            for name, value in document.items():
                outputs[name][row] = value
    sample = np.repeat(np.arange(batch.first, batch.first + batch.samples), forces)
    return Rows(sample=sample, numbers=numbers | outputs, error=error)


def _output_values(
    plan: Plan, values: Mapping[str, float], press: PressFunction
) -> dict[str, float | NDArray[np.float64]]:
    phantom, force = plan.phantom(values), values["force_n"]
    field = press(plan.probe, phantom, force_n=force, strain=plan.strain)
    document: dict[str, float | NDArray[np.float64]] = {}
    for name in plan.columns:
        if name == "change_by_inclusion_mm":
            reference = press(plan.probe, phantom.without_inclusion(), force_n=force, strain=plan.strain)
            value = field.face_displacement_mm - reference.face_displacement_mm
        else:
            value = getattr(field, name)
        document[name] = np.interp(plan.radii_mm, field.radius_mm, value) if name in PROFILES else value
    return document
