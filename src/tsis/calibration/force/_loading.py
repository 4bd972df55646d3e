"""One loading of the probe with a tip: camera and force gauge readings in order of time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from tsis.calibration.force._line import LARGEST_GAUGE_N
from tsis.errors import CalibrationError, InputError
from tsis.model.require import require_array, require_integer, require_number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.calibration.force._frame import LoadingFrame


TIPS_MM = (2.0, 10.0, 14.0)
LARGEST_N, STEP_N = 2.0, 0.1
UNTOUCHED_N = 0.005  # largest zero of a gauge without load
NUMBERS = ("force_n", "total_grey", "field_grey", "peak_grey", "mean_square_mm2", "clipped")  # of every press


def loading_forces(largest_n: float = LARGEST_N, step_n: float = STEP_N) -> tuple[float, ...]:
    """Forces of section 5.1 in newtons in order of time: 0 to the largest in steps, and back to 0.

    Raises `InputError` when either lies outside its range.

    Parameters
    ----------
    largest_n
        Largest force in newtons, in [0.001, 50].
    step_n
        Step in newtons, from 0.0001 to the largest.

    Examples
    --------
    >>> loading_forces(0.3)
    (0.0, 0.1, 0.2, 0.3, 0.2, 0.1, 0.0)
    """
    require_number("largest_n", largest_n, 1e-3, LARGEST_GAUGE_N, hint="newtons")
    steps = round(largest_n / require_number("step_n", step_n, 1e-4, largest_n, hint="newtons"))
    up = [round(largest_n * step / steps, 9) for step in range(steps + 1)]
    return (*up, *up[-2::-1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loading:
    """One run of a tip from no contact to the largest force and back, in order of time.

    Parameters
    ----------
    tip_radius_mm
        Radius of the rigid tip, mm, in [0.1, 1000].
    force_n
        Gauge readings in newtons, shape (n,), n >= 6; within 50 N.
    total_grey
        Sum of grey levels above no contact of the bright patch, shape (n,).
    touched
        Whether the tip touched the probe, shape (n,); without contact the gauge shows its zero.
    field_grey
        The same sum over all good pixels, shape (n,).
    peak_grey, mean_square_mm2
        Grey level in the middle of the contact and mean square distance of its light from its centroid, shape (n,);
        0 without a patch.
    clipped
        Fraction of the patch's pixels that clip, shape (n,).
    run
        Number of the repeat, from 1.
    """

    tip_radius_mm: float
    force_n: NDArray[np.float64]
    total_grey: NDArray[np.float64]
    touched: NDArray[np.bool]
    field_grey: NDArray[np.float64]
    peak_grey: NDArray[np.float64]
    mean_square_mm2: NDArray[np.float64]
    clipped: NDArray[np.float64]
    run: int = 1

    def __post_init__(self) -> None:
        require_number("tip_radius_mm", self.tip_radius_mm, 0.1, 1000.0, hint="millimetres")
        require_integer("run", self.run, 1, 10_000)
        for name in NUMBERS:
            values = require_array(name, getattr(self, name), ndim=1)
            object.__setattr__(self, name, values)
            if len(values) != len(self.force_n):
                raise InputError(f"{name} must hold one number a press, {len(self.force_n)}; got {len(values)}")
        touched = np.array(self.touched, dtype=bool)
        if touched.shape != self.force_n.shape:
            raise InputError(f"touched must hold one truth value a press, {len(self.force_n)}; got {touched.shape}")
        touched.flags.writeable = False
        object.__setattr__(self, "touched", touched)
        largest = float(np.abs(self.force_n).max())
        if largest > LARGEST_GAUGE_N:
            raise InputError(
                f"force_n must hold newtons, at most {LARGEST_GAUGE_N:g}; got {largest:g} "
                "(millinewtons? divide them by 1000)"
            )
        if int(touched.sum()) < 4:
            raise CalibrationError(
                f"a loading must hold at least 4 presses with contact; got {int(touched.sum())} (take smaller steps)"
            )

    @classmethod
    def from_frames(cls, tip_radius_mm: float, readings: Sequence[LoadingFrame], *, run: int = 1) -> Self:
        """The loading of single frames."""
        columns = {name: np.array([getattr(item, name) for item in readings]) for name in (*NUMBERS, "touched")}
        return cls(tip_radius_mm=tip_radius_mm, run=run, **columns)

    @property
    def zero_n(self) -> float:
        """Gauge reading without contact, newtons; 0 without such frames."""
        return float(self.force_n[~self.touched].mean()) if (~self.touched).any() else 0.0

    @property
    def load_n(self) -> NDArray[np.float64]:
        """Forces minus the gauge's zero, shape (n,)."""
        return np.asarray(self.force_n - self.zero_n)

    @property
    def rising(self) -> NDArray[np.bool]:
        """True up to the largest force, shape (n,)."""
        return np.arange(len(self.force_n)) <= int(np.argmax(self.force_n))
