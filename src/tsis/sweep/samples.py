"""The phantoms of a plan, batch by batch: the same numbers on every run, and never all of them in memory."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.sweep.quantity import Range

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from tsis.sweep.plan import Plan


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SweepBatch:
    """The phantoms of one file.

    Attributes
    ----------
    shard
        Number of the file, from 0.
    first
        Number of its first phantom in the sweep.
    values
        By quantity, one value a phantom.
    """

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
            # SciPy warns of a first piece that is no power of two; whether the whole is one, the plan's author knows.
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
        places = np.unravel_index(np.arange(first, first + size), shape)  # the last quantity runs fastest
        return {name: lists[name][place] for name, place in zip(lists, places, strict=True)}

    return values
