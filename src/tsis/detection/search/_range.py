"""Detection range: largest distance of a detectable inclusion from the probe's axis, by its size and depth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tsis.detection._inputs import booleans, same_length
from tsis.errors import FileInputError, InputError, import_extra
from tsis.files import as_path, parse_csv_rows, printable_path, read_bytes
from tsis.model import INCLUSION_RANGES, require_array, require_ascending, require_number

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    DetectionRange = Callable[[float, float], float]

FARTHEST_MM = 500.0
COLUMNS = ("diameter_mm", "depth_mm", "reach_mm")
LARGEST_BYTES = 2**20
RANGE_FOLDER = Path(__file__).parent / "reach"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DetectionRangeTable:
    """Detection range over a grid of sizes and depths, with linear interpolation and conservative extrapolation.

    An inclusion smaller than the smallest, or deeper than the deepest, has the range 0; a larger or shallower one has
    that of the last in the table. Raises `InputError` when shapes or values are wrong.

    Parameters
    ----------
    diameter_mm, depth_mm
        Ascending, shapes (n,) and (m,).
    reach_mm
        Largest distance from the probe's axis at which an inclusion is detected with ``probability``, shape (n, m), in
        [0, 500]; 0 where it is not detected.
    probability
        Probability of detection, in (0, 1).

    Examples
    --------
    >>> table = DetectionRangeTable(diameter_mm=[4, 8], depth_mm=[4, 12], reach_mm=[[2, 0], [6, 2]], probability=0.9)
    >>> table(6, 8), table(3, 8), table(20, 8)
    (2.5, 0.0, 4.0)
    """

    diameter_mm: NDArray[np.float64]
    depth_mm: NDArray[np.float64]
    reach_mm: NDArray[np.float64]
    probability: float

    def __post_init__(self) -> None:
        for name in ("diameter_mm", "depth_mm"):
            object.__setattr__(self, name, require_ascending(name, getattr(self, name)))
        detection_range = require_array("reach_mm", self.reach_mm, ndim=2)
        shape = (len(self.diameter_mm), len(self.depth_mm))
        if detection_range.shape != shape or detection_range.min() < 0 or detection_range.max() > FARTHEST_MM:
            raise InputError(
                f"reach_mm must have the shape {shape} of sizes and depths and lie in [0, {FARTHEST_MM:g}]; got shape "
                f"{detection_range.shape}, {detection_range.min():g} to {detection_range.max():g}"
            )
        object.__setattr__(self, "reach_mm", detection_range)
        object.__setattr__(self, "probability", require_number("probability", self.probability, 1e-6, 1 - 1e-6))

    def __call__(self, diameter_mm: float, depth_mm: float) -> float:
        """Detection range of one inclusion, mm."""
        diameter = require_number("diameter_mm", diameter_mm, *INCLUSION_RANGES["diameter_mm"])
        depth = require_number("depth_mm", depth_mm, *INCLUSION_RANGES["depth_mm"])
        if diameter < self.diameter_mm[0] or depth > self.depth_mm[-1]:
            return 0.0
        by_size = [float(np.interp(depth, self.depth_mm, row)) for row in self.reach_mm]
        return float(np.interp(diameter, self.diameter_mm, by_size))


def detection_range_of_trials(offset_mm: ArrayLike, result: ArrayLike, *, probability: float = 0.9) -> float:
    """Detection range from trials on inclusions of one kind at many distances from the axis.

    Isotonic regression fits the detection rate by a step function that does not rise with the distance; the range is
    the farthest trial with a rate of at least ``probability``. It has no interval and is uncertain with few trials.
    Raises `InputError` when the input is bad.

    Parameters
    ----------
    offset_mm
        Distances from the axis, shape (trials,), not negative.
    result
        Whether the inclusion was detected, booleans of shape (trials,).
    probability
        Requested probability of detection, in (0, 1).

    Returns
    -------
    The reach in mm, 0 where even the nearest are found less often.

    Examples
    --------
    >>> detection_range_of_trials([0, 1, 2, 3, 4, 5], [True, True, True, False, True, False], probability=0.5)
    4.0
    """
    away = require_array("offset_mm", offset_mm, ndim=1)
    observed = booleans("found", result)
    same_length("offset_mm", away, "found", observed)
    if away.min() < 0:
        raise InputError(f"offset_mm must not be negative; got {away.min():g}")
    require_number("probability", probability, 1e-6, 1 - 1e-6)
    isotonic = import_extra("sklearn.isotonic", feature="a range from trials", extra="classify")
    fitted = isotonic.IsotonicRegression(increasing=False).fit(away, observed.astype(float))
    fraction = fitted.predict(np.sort(away))
    inside = np.sort(away)[fraction >= probability - 1e-12]
    return float(inside[-1]) if len(inside) else 0.0


def read_detection_range(path: str | os.PathLike[str], *, probability: float = 0.9) -> DetectionRangeTable:
    """Read a table of detection ranges: CSV with the columns ``diameter_mm``, ``depth_mm`` and ``reach_mm``.

    Raises `FileInputError` when it is no such table.

    Parameters
    ----------
    path
        The file, at most 1 MiB; every size with every depth once.
    probability
        Probability of detection within the range, in (0, 1).
    """
    path = as_path(path)
    name, rows = printable_path(path), _numbers(path)
    sizes, depths = (np.unique([row[axis] for row in rows]) for axis in (0, 1))
    cells = {(row[0], row[1]): row[2] for row in rows}
    if len(cells) != len(rows) or len(rows) != len(sizes) * len(depths):
        raise FileInputError(
            f"{name} must hold each of its {len(sizes)} sizes with each of its {len(depths)} depths once; got "
            f"{len(rows)} rows"
        )
    extents = np.array([[cells[float(size), float(depth)] for depth in depths] for size in sizes])
    try:
        return DetectionRangeTable(diameter_mm=sizes, depth_mm=depths, reach_mm=extents, probability=probability)
    except InputError as error:
        raise FileInputError(f"{name}: {error}") from error


def measured_detection_range(probe: str) -> DetectionRangeTable | None:
    """Detection ranges of a catalog probe from a study on the virtual probe; None where there was no study.

    The detection rate is 90 % at a false positive rate of 10 %, in heterogeneous tissue
    (``benchmarks/detection_study.py``), for offsets up to 5 mm.

    Examples
    --------
    >>> table = measured_detection_range("tsis-domed")
    >>> table(10.0, 6.0) > table(3.0, 6.0) > 0
    True
    >>> measured_detection_range("tsis-2011") is None
    True
    """
    by_name = {path.stem: path for path in RANGE_FOLDER.glob("*.csv")}
    return read_detection_range(by_name[probe]) if probe in by_name else None


def _numbers(path: Path) -> list[tuple[float, ...]]:
    rows = []
    for row in parse_csv_rows(read_bytes(path, most=LARGEST_BYTES), printable_path(path), COLUMNS):
        numbers = tuple(number for name in COLUMNS if (number := row.number(name)) is not None)
        if len(numbers) != len(COLUMNS):
            raise FileInputError(f"a row must hold three numbers; got an empty cell ({row.where})")
        rows.append(numbers)
    if not rows:
        raise FileInputError(f"{printable_path(path)} must hold at least one row of numbers; got none")
    return rows
