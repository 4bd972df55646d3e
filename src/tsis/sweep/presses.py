"""The presses of one batch as columns of numbers; a press that the model refuses is a row that says why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from threadpoolctl import threadpool_limits

from tsis.model.errors import TsisError
from tsis.sweep.plan import PROFILES, SCALARS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from tsis.model import Phantom, PressField, Probe
    from tsis.sweep.plan import Plan
    from tsis.sweep.samples import SweepBatch

LONGEST_ERROR = 300
# Sums of matrices that cannot be solved; everything else that fails is a fault of the program and stops the sweep.
REFUSALS = (TsisError, np.linalg.LinAlgError, ArithmeticError)


class PressFunction(Protocol):
    """What computes a press: `tsis.mechanics.press`, or a stand-in."""

    def __call__(self, probe: Probe, phantom: Phantom, /, *, force_n: float, strain: str) -> PressField:
        """Press ``phantom`` with ``probe``."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rows:
    """Presses as columns, force by force within phantom by phantom.

    Attributes
    ----------
    sample
        Number of the phantom in the sweep, shape (n,).
    numbers
        By name: ``force_n`` and the plan's quantities, shape (n,); then the plan's columns, shape (n,), profiles
        (n, number of radii). NaN where the press was refused.
    error
        Why a press was refused, and empty where it was not.
    """

    sample: NDArray[np.int64]
    numbers: dict[str, NDArray[np.float64]]
    error: list[str]

    @property
    def refused(self) -> int:
        """Number of presses that were refused."""
        return sum(map(bool, self.error))


def press_all(plan: Plan, batch: SweepBatch, press: PressFunction) -> Rows:
    """Press every phantom of ``batch`` with every force of ``plan``."""
    forces, count = len(plan.forces_n), batch.samples * len(plan.forces_n)
    numbers = {"force_n": np.tile(np.array(plan.forces_n), batch.samples)}
    numbers |= {name: np.repeat(values, forces) for name, values in batch.values.items()}
    results = {
        name: np.full((count, len(plan.radii_mm)) if name in PROFILES else count, np.nan) for name in plan.columns
    }
    error = [""] * count
    with threadpool_limits(limits=1):  # results of several threads depend on their number
        for row in range(count):
            values = {name: float(column[row]) for name, column in numbers.items()}
            try:
                found = _kept(plan, values, press)
            except REFUSALS as reason:
                error[row] = f"{type(reason).__name__}: {reason}"[:LONGEST_ERROR]
                continue
            for name, value in found.items():
                results[name][row] = value
    sample = np.repeat(np.arange(batch.first, batch.first + batch.samples), forces)
    return Rows(sample=sample, numbers=numbers | results, error=error)


def _kept(plan: Plan, values: Mapping[str, float], press: PressFunction) -> dict[str, float | NDArray[np.float64]]:
    phantom, force = plan.phantom(values), values["force_n"]
    field = press(plan.probe, phantom, force_n=force, strain=plan.strain)
    found: dict[str, float | NDArray[np.float64]] = {
        name: getattr(field, name) for name in plan.columns if name in SCALARS
    }
    for name in plan.columns:
        if name == "change_by_inclusion_mm":
            plain = press(plan.probe, phantom.without_inclusion(), force_n=force, strain=plan.strain)
            profile = field.face_displacement_mm - plain.face_displacement_mm
        elif name in PROFILES:
            profile = getattr(field, name)
        else:
            continue
        found[name] = np.interp(plan.radii_mm, field.radius_mm, profile)
    return found
