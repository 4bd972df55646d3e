"""Where to press next: plans that search an area in strips.

The detection range is the largest distance of a detectable inclusion from the probe's axis, by its size and depth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import FileInputError, InputError, import_extra
from tsis.files.reading import as_path, printable_path, read_bytes
from tsis.files.tables import parse_csv_rows
from tsis.model.phantom import INCLUSION_RANGES
from tsis.model.press import require_ascending
from tsis.model.require import require_array, require_integer, require_number, require_type
from tsis.study.proportions import booleans, same_length

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

    Examples
    --------
    >>> table = DetectionRangeTable(diameter_mm=[4, 8], depth_mm=[4, 12], reach_mm=[[2, 0], [6, 2]], probability=0.9)
    >>> table(6, 8), table(3, 8), table(20, 8)
    (2.5, 0.0, 4.0)
    """

    #: diameter_mm, depth_mm: ascending, shapes (n,) and (m,)
    diameter_mm: NDArray[np.float64]
    depth_mm: NDArray[np.float64]
    #: largest distance from the probe's axis at which an inclusion is detected with ``probability``, shape (n, m), in
    #: [0, 500]; 0 where it is not detected
    reach_mm: NDArray[np.float64]
    probability: float  #: probability of detection, in (0, 1)

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


def detection_range_of_trials(offset_mm: ArrayLike, found: ArrayLike, *, probability: float = 0.9) -> float:
    """Detection range from trials on inclusions of one kind at many distances from the axis, shape (trials,), mm.

    Isotonic regression fits the detection rate by a step function that does not rise with the distance; the range is
    the farthest trial with a rate of at least ``probability``, in (0, 1), and 0 where even the nearest are found less
    often. It has no interval and is uncertain with few trials. Raises `InputError` when the input is bad.

    Examples
    --------
    >>> detection_range_of_trials([0, 1, 2, 3, 4, 5], [True, True, True, False, True, False], probability=0.5)
    4.0
    """
    away = require_array("offset_mm", offset_mm, ndim=1)
    observed = booleans("found", found)
    same_length("offset_mm", away, "found", observed)
    if away.min() < 0:
        raise InputError(f"offset_mm must not be negative; got {away.min():g}")
    require_number("probability", probability, 1e-6, 1 - 1e-6)
    isotonic = import_extra("sklearn.isotonic", feature="a range from trials", extra="study")
    fitted = isotonic.IsotonicRegression(increasing=False).fit(away, observed.astype(float))
    fraction = fitted.predict(np.sort(away))
    inside = np.sort(away)[fraction >= probability - 1e-12]
    return float(inside[-1]) if len(inside) else 0.0


def read_detection_range(path: str | os.PathLike[str], *, probability: float = 0.9) -> DetectionRangeTable:
    """Read a table of detection ranges: CSV with the columns ``diameter_mm``, ``depth_mm`` and ``reach_mm``.

    The file has at most 1 MiB, and every size with every depth once; ``probability`` is that of a detection within the
    range, in (0, 1). Raises `FileInputError` when it is no such table.
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


AREA_MM = (1.0, 5000.0)
RADIUS_MM = (0.5, 500.0)
MOST_PRESSES = 100_000
ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanPlan:
    """Presses over a rectangle, in strips along its height, alternately up and down.

    The area is divided into equal cells, pressed at their centres: no point is farther from a press than half a cell's
    diagonal. Presses at the edge overhang the area by ``overhang_mm``. Raises `InputError` when a value lies outside
    its range.

    Examples
    --------
    >>> plan = ScanPlan(width_mm=80, height_mm=60, strips=4, presses_a_strip=4, radius_mm=12)
    >>> plan.presses, plan.strip_spacing_mm, plan.press_spacing_mm, plan.worst_distance_mm
    (16, 20.0, 15.0, 12.5)
    >>> plan.positions_mm[:5].tolist()  # up the first strip, then down the second
    [[10.0, 7.5], [10.0, 22.5], [10.0, 37.5], [10.0, 52.5], [30.0, 52.5]]
    """

    #: width_mm, height_mm: the area, in [1, 5000] mm
    width_mm: float
    height_mm: float
    #: strips, presses_a_strip: cells across and along, 1 or more, at most 100,000 in all
    strips: int
    presses_a_strip: int
    radius_mm: float  #: of the probe's face, in [0.5, 500]

    def __post_init__(self) -> None:
        for name in ("width_mm", "height_mm"):
            object.__setattr__(self, name, require_number(name, getattr(self, name), *AREA_MM, hint="millimetres"))
        object.__setattr__(self, "radius_mm", require_number("radius_mm", self.radius_mm, *RADIUS_MM))
        for name in ("strips", "presses_a_strip"):
            object.__setattr__(self, name, require_integer(name, getattr(self, name), 1, MOST_PRESSES))
        if self.presses > MOST_PRESSES:
            raise InputError(
                f"a plan must have at most {MOST_PRESSES} presses; got {self.presses}: choose wider spacing"
            )

    @property
    def presses(self) -> int:
        """Number of presses."""
        return self.strips * self.presses_a_strip

    @property
    def strip_spacing_mm(self) -> float:
        """Distance of neighbouring strips."""
        return self.width_mm / self.strips

    @property
    def press_spacing_mm(self) -> float:
        """Distance of neighbouring presses along a strip."""
        return self.height_mm / self.presses_a_strip

    @property
    def positions_mm(self) -> NDArray[np.float64]:
        """Positions (x, y) of the presses in their order, from a corner of the area, shape (presses, 2)."""
        span = (np.arange(self.strips) + 0.5) * self.strip_spacing_mm
        along = (np.arange(self.presses_a_strip) + 0.5) * self.press_spacing_mm
        both = [along if index % 2 == 0 else along[::-1] for index in range(self.strips)]
        return np.column_stack([np.repeat(span, self.presses_a_strip), np.concatenate(both)])

    @property
    def travel_mm(self) -> float:
        """Length of the path from the first press to the last."""
        along = self.strips * (self.presses_a_strip - 1) * self.press_spacing_mm
        return along + (self.strips - 1) * self.strip_spacing_mm

    @property
    def worst_distance_mm(self) -> float:
        """Largest distance of a point from the nearest press: half a cell's diagonal."""
        return math.hypot(self.strip_spacing_mm, self.press_spacing_mm) / 2

    @property
    def overlap(self) -> tuple[float, float]:
        """Overlap of neighbours across and along strips, of the face's diameter; negative is a gap."""
        return 1 - self.strip_spacing_mm / (2 * self.radius_mm), 1 - self.press_spacing_mm / (2 * self.radius_mm)

    @property
    def overhang_mm(self) -> tuple[float, float]:
        """Overhang of the face over the area's edges, across and along; negative inside."""
        return self.radius_mm - self.strip_spacing_mm / 2, self.radius_mm - self.press_spacing_mm / 2

    def duration_s(self, *, press_s: float, speed_mm_s: float) -> float:
        """Time of all presses and of the path between them; `InputError` when a value lies outside its range.

        A press takes ``press_s``, in [0, 3600], settling and lifting included. Between presses the probe moves at
        ``speed_mm_s``, in [0.01, 1000].
        """
        require_number("press_s", press_s, 0.0, 3600.0, hint="seconds")
        return self.presses * press_s + self.travel_mm / require_number("speed_mm_s", speed_mm_s, 0.01, 1000.0)


def scan_plan(
    width_mm: float,
    height_mm: float,
    *,
    radius_mm: float,
    spacing_mm: float | None = None,
    overlap: float | None = None,
) -> ScanPlan:
    """Plan presses of a face of ``radius_mm`` over an area, no farther apart than a spacing.

    Either ``spacing_mm``, in [0.1, 1000], is the largest distance of neighbours, or ``overlap``, in [0, 0.95], the
    least fraction of the face's diameter by which they overlap. Raises `InputError` when a value lies outside its range
    (see `ScanPlan`), or not exactly one of both is given.

    Examples
    --------
    >>> scan_plan(80, 60, radius_mm=12, overlap=0.25).press_spacing_mm  # at most 18 mm
    15.0
    """
    if (spacing_mm is None) == (overlap is None):
        raise InputError(f"either spacing_mm or overlap must be given; got {spacing_mm!r:.40} and {overlap!r:.40}")
    _check_area(width_mm, height_mm, radius_mm)
    if overlap is not None:
        spacing_mm = 2 * radius_mm * (1 - require_number("overlap", overlap, 0.0, 0.95))
    widest = require_number("spacing_mm", spacing_mm, 0.1, 1000.0, hint="millimetres")
    return ScanPlan(
        width_mm=width_mm,
        height_mm=height_mm,
        strips=_cells(width_mm, widest),
        presses_a_strip=_cells(height_mm, widest),
        radius_mm=radius_mm,
    )


def widest_plan(width_mm: float, height_mm: float, *, radius_mm: float, extent_mm: float) -> ScanPlan:
    """The plan of fewest presses in which no point is farther from a press than ``extent_mm``, in [0.05, 500].

    That is the detection range of the inclusion beside the axis. All numbers of strips that may be best are tried;
    among equals the plan of the least worst distance is chosen. Raises `InputError` when a value lies outside its range
    (see `ScanPlan`), or it would take more than 100,000 presses.

    Examples
    --------
    >>> plan = widest_plan(80, 60, radius_mm=12, extent_mm=3)
    >>> plan.strips, plan.presses_a_strip, round(plan.worst_distance_mm, 3)
    (18, 15, 2.99)
    """
    _check_area(width_mm, height_mm, radius_mm)
    widest = 2 * require_number("extent_mm", extent_mm, 0.05, FARTHEST_MM, hint="millimetres")
    fewest_along = _cells(height_mm, widest)
    best: tuple[int, float, int, int] | None = None
    strips = max(1, math.ceil(width_mm / widest * (1 - ROUNDING)))
    while best is None or strips * fewest_along <= best[0]:
        along = math.sqrt(max(widest**2 - (width_mm / strips) ** 2, 0.0))
        if along > 1e-6 * widest:
            presses_a_strip = _cells(height_mm, along)
            worst = math.hypot(width_mm / strips, height_mm / presses_a_strip)
            plan = (strips * presses_a_strip, worst, strips, presses_a_strip)
            best = plan if best is None else min(best, plan)
        strips += 1
    if best[0] > MOST_PRESSES:
        raise InputError(
            f"extent_mm must be larger for this area: {extent_mm:g} would take {best[0]} presses of {MOST_PRESSES}"
        )
    return ScanPlan(
        width_mm=width_mm, height_mm=height_mm, strips=best[2], presses_a_strip=best[3], radius_mm=radius_mm
    )


def _check_area(width_mm: float, height_mm: float, radius_mm: float) -> None:
    require_number("width_mm", width_mm, *AREA_MM, hint="millimetres")
    require_number("height_mm", height_mm, *AREA_MM, hint="millimetres")
    require_number("radius_mm", radius_mm, *RADIUS_MM)


def _cells(length_mm: float, widest_mm: float) -> int:
    return max(1, math.ceil(length_mm / widest_mm * (1 - ROUNDING)))


SIZES_MM = (0.5, 15.0)  # range of the search for the smallest inclusion
STEPS = 200


def smallest_found_mm(plan: ScanPlan, detection_range: DetectionRange, depth_mm: float) -> float | None:
    """Least diameter of an inclusion that a plan cannot miss at any position between presses; None if it may miss all.

    "Cannot miss" means: with at least the probability of ``detection_range``, by the nearest press. That function
    gives, for a diameter and the ``depth_mm`` of its top, the largest distance from the axis at which an inclusion is
    detected, all in mm. Of `SIZES_MM` 200 diameters are tried, then the change between two of them is located by
    bisection. Raises `InputError` when a value is out of range, or the detection range is no number of 0 mm or more.
    """
    require_type("plan", plan, ScanPlan)
    low, high = SIZES_MM
    enough = plan.worst_distance_mm * (1 - ROUNDING)

    def detected(size: float) -> bool:
        extent = detection_range(size, depth_mm)
        return require_number("the detection range", extent, 0.0, FARTHEST_MM, hint="millimetres") >= enough

    missed: list[float] = [size for size in np.linspace(low, high, STEPS).tolist() if not detected(size)]
    if not missed:
        return low
    if missed[-1] == high:
        return None
    below, above = missed[-1], missed[-1] + (high - low) / (STEPS - 1)
    while above - below > 1e-9 * above:
        middle = (below + above) / 2
        below, above = (below, middle) if detected(middle) else (middle, above)
    return above
