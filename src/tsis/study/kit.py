"""The kit for a first physical validation: phantoms, moulds, tables, score.

A mould is a closed polygon (radius, height) in mm that is turned about the axis; points on the axis meet in one vertex.
The score compares readings of an unblinded study with moduli that a bench test measured.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import FileInputError, InputError, RecordsError
from tsis.files.reading import as_path, printable_path
from tsis.files.tables import read_csv_rows, table_bytes
from tsis.mechanics import indentation_modulus
from tsis.mechanics.bench_tests import compression_modulus
from tsis.model.estimate import INTERVAL_LEVEL
from tsis.model.require import require_number
from tsis.study.analysis import DeviceResults
from tsis.study.folder import read_seal, verify_study
from tsis.study.plan import QUANTITIES, first_readings
from tsis.study.proportions import Interval

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from tsis.files.tables import CsvRow
    from tsis.mechanics.bench_tests import MeasuredModulus
    from tsis.study.folder import Study
    from tsis.study.plan import DeviceReading, TargetTruth
    from tsis.study.proportions import Counts


SIDES = 180  # of the circle
ARC = 60  # segments of a quarter of a sphere
WALL_MM, FLOOR_MM = 3.0, 3.0


def sphere_mould(diameter_mm: float) -> NDArray[np.float64]:
    """One half of the mould of a sphere: a block with a hemisphere in its top, as triangles (n, 3, 3) in mm.

    Two halves are clamped face to face and filled through a needle at the seam.
    """
    radius = require_number("diameter_mm", diameter_mm, 1.0, 100.0, hint="millimetres") / 2
    angle = np.linspace(0, np.pi / 2, ARC + 1)
    top = radius + FLOOR_MM
    cavity = np.stack([radius * np.sin(angle), top - radius * np.cos(angle)], axis=1)  # from the axis to the rim
    outside = radius + WALL_MM
    return _revolved([(0.0, 0.0), *map(tuple, cavity), (outside, top), (outside, 0.0)])


def cup(diameter_mm: float, height_mm: float) -> NDArray[np.float64]:
    """A cup for tissue or a test cylinder: inner ``diameter_mm`` and ``height_mm``, as triangles (n, 3, 3) in mm."""
    radius = require_number("diameter_mm", diameter_mm, 1.0, 300.0, hint="millimetres") / 2
    top = require_number("height_mm", height_mm, 1.0, 300.0, hint="millimetres") + FLOOR_MM
    outside = radius + WALL_MM
    return _revolved([(0.0, 0.0), (0.0, FLOOR_MM), (radius, FLOOR_MM), (radius, top), (outside, top), (outside, 0.0)])


def _revolved(profile: list[tuple[float, float]]) -> NDArray[np.float64]:
    """Turn a closed profile about the axis: outward triangles, shape (n, 3, 3).

    The profile runs clockwise in (radius, height), seen with the radius to the right.
    """
    turn = 2 * np.pi * np.arange(SIDES) / SIDES
    rings = [
        np.stack([radius * np.cos(turn), radius * np.sin(turn), np.full(SIDES, height)], axis=1)
        for radius, height in profile
    ]
    faces = []
    for at, (low, high) in enumerate(zip(rings, [*rings[1:], rings[0]], strict=True)):
        touching = profile[at][0] == 0, profile[(at + 1) % len(profile)][0] == 0
        after = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
        if not touching[0]:
            faces.append(np.stack([low, high, after[0]], axis=1))
        if not touching[1]:
            faces.append(np.stack([after[0], high, after[1]], axis=1))
    return np.concatenate(faces)


def stl_bytes(triangles: NDArray[np.float64], name: str) -> bytes:
    """Binary STL file in mm; ``name`` goes into its header."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    record = np.zeros(len(triangles), dtype=np.dtype([("values", "<f4", (12,)), ("attribute", "<u2")]))
    record["values"] = np.concatenate([normal / np.maximum(length, 1e-30), triangles.reshape(-1, 9)], axis=1)
    return name.encode("ascii", "replace")[:80].ljust(80) + struct.pack("<I", len(triangles)) + record.tobytes()


TISSUE_KPA, THICKNESS_MM, WIDTH_MM = 5.0, 30.0, 90.0
BALL_MM, PAD_MM, CYLINDER_MM, TALL_MM = 5.0, 60.0, 20.0, 15.0  # radius of the ball; widths; height of pad and cylinder
MODULUS_COLUMNS = ("phantom", "specimen", "kind", "size_mm", "thickness_mm", "force_n", "displacement_mm")


@dataclass(frozen=True, slots=True, kw_only=True)
class KitPhantom:
    """A phantom of the kit as its recipe says; a blank one has no ``batch`` of stiff material and no sizes."""

    label: str
    batch: str = ""
    diameter_mm: float | None = None
    depth_mm: float | None = None
    young_kpa: float | None = None


def _stiff(label: int, diameter: float, depth: float, batch: str, young: float) -> KitPhantom:
    return KitPhantom(label=str(label), batch=batch, diameter_mm=diameter, depth_mm=depth, young_kpa=young)


# Well inside the default prior, casting errors included: an interval holds no value at the end of what is believed.
KIT = (
    *(_stiff(1 + number, diameter, 6.0, "A", 90.0) for number, diameter in enumerate((7.0, 10.0, 13.0))),
    *(_stiff(4 + number, 10.0, depth, "A", 90.0) for number, depth in enumerate((5.0, 9.0))),
    *(_stiff(6 + number, 10.0, 6.0, "B", 55.0) for number in range(2)),
    *(KitPhantom(label=str(8 + number)) for number in range(3)),
)


def kit_moulds() -> dict[str, tuple[NDArray[np.float64], str]]:
    """Mould and what to do with it, by the name of its STL file."""
    halves = {
        f"sphere-{size:g}.stl": (sphere_mould(size), f"half a mould of a sphere of {size:g} mm: print two, clamp")
        for size in sorted({item.diameter_mm for item in KIT if item.diameter_mm is not None})
    }
    return halves | {
        "tissue.stl": (cup(WIDTH_MM, THICKNESS_MM), "cup for tissue: print one a phantom"),
        "cylinder.stl": (cup(CYLINDER_MM, TALL_MM), "test cylinder: print three a batch"),
        "pad.stl": (cup(PAD_MM, TALL_MM), "test pad: print three a batch"),
    }


def kit_files() -> dict[str, bytes]:
    """Content of the kit's moulds and tables, by the name of the file.

    Examples
    --------
    >>> [name for name in kit_files() if not name.endswith(".stl")]
    ['phantoms.csv', 'modulus.csv']
    """
    columns = ("label", "diameter_mm", "depth_mm", "young_kpa")
    rows = [[*(getattr(item, name) for name in columns), TISSUE_KPA, THICKNESS_MM] for item in KIT]
    return {
        **{name: stl_bytes(body, what) for name, (body, what) in kit_moulds().items()},
        "phantoms.csv": table_bytes([[*columns, "tissue_kpa", "thickness_mm"], *rows]),
        "modulus.csv": table_bytes([MODULUS_COLUMNS]),
    }


INDENTATION, COMPRESSION = "indentation", "compression"
TISSUE = "tissue"  # in the column of phantoms: the tissue of all of them
MN_PER_N = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchModulus:
    """Modulus of a phantom's material, its standard uncertainty, and the means by kind of test; kPa.

    ``sd_kpa`` is the larger of the scatter of the specimens and that of their points, of the mean of all specimens.
    """

    young_kpa: float
    sd_kpa: float
    specimens: int
    by_kind: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantityScore:
    """A quantity: intervals that hold the truth, and the bias over phantoms with its 95 % interval (None for one).

    There is no bias where every value was withheld as not identified; the intervals count all the same.
    ``hits`` counts the first readings of a phantom by an operator whose 90 % interval holds the measured true value, of
    ``count``; ``hits_widened`` does so with intervals widened by the uncertainty of that measurement.
    """

    quantity: str
    hits: int
    hits_widened: int
    count: int
    phantoms: int
    bias: float | None
    relative_bias: float | None
    bias_interval: Interval | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidationScore:
    """Score of one device; ``of_recipe`` says that sealed sizes and depths are those of the recipe, not measured."""

    study: Study
    device: str
    moduli: Mapping[str, BenchModulus]
    nominal: Mapping[str, float]
    quantities: tuple[QuantityScore, ...]
    counts: Counts | None
    undecided: int
    unread: int
    faults: int
    of_recipe: bool


def bench_moduli(path: str | os.PathLike[str], *, poisson: float = 0.49) -> dict[str, BenchModulus]:
    """Moduli by phantom from a table with the columns `MODULUS_COLUMNS`, a row each point.

    The column phantom names one, or several of one batch between semicolons, or the tissue. ``size_mm`` is the radius
    of the ball of an indentation, or the diameter of the cylinder of a compression; forces in N, lengths in mm.

    Raises `FileInputError` when the table has no point, or a row is no point; the message gives its line; `InputError`
    when no modulus fits the points of a specimen.
    """
    file = as_path(path)
    points: dict[tuple[str, str, str], list[tuple[float, ...]]] = {}
    for row in read_csv_rows(file, MODULUS_COLUMNS):
        names = [_text(row, name) for name in MODULUS_COLUMNS[:3]]
        if names[2] not in (INDENTATION, COMPRESSION):
            raise row.refused("kind", f"{INDENTATION} or {COMPRESSION}", names[2])
        point = tuple(_number(row, name) for name in MODULUS_COLUMNS[3:])
        same = points.setdefault((names[0], names[1], names[2]), [])
        if same and same[0][:2] != point[:2]:
            raise row.refused("size_mm and thickness_mm", "the same for all points of a specimen", str(point[:2]))
        same.append(point)
    if not points:
        raise FileInputError(f"{printable_path(file)} must hold the points of the bench tests; it has headings alone")
    measured: dict[str, list[tuple[str, MeasuredModulus]]] = {}
    for (phantoms, specimen, kind), rows in points.items():
        try:
            fits = _fitted(kind, np.array(rows), poisson)
        except InputError as error:
            raise InputError(f"{error} ({phantoms}, specimen {specimen}, {kind})") from error
        for label in filter(None, (part.strip() for part in phantoms.split(";"))):
            measured.setdefault(label, []).append((kind, fits))
    return {label: _combined(fits) for label, fits in measured.items()}


def _text(row: CsvRow, name: str) -> str:
    if not row.text(name):
        raise row.refused(name, "given in every row", "")
    return row.text(name)


def _number(row: CsvRow, name: str) -> float:
    value = row.number(name)
    if value is None or value < 0 or (value == 0 and name != "displacement_mm"):
        raise row.refused(name, "a positive number in every row", row.text(name))
    return value


def _fitted(kind: str, rows: np.ndarray, poisson: float) -> MeasuredModulus:
    size, thickness, travel, force = float(rows[0, 0]), float(rows[0, 1]), rows[:, 3], MN_PER_N * rows[:, 2]
    if kind == INDENTATION:
        return indentation_modulus(travel, force, radius_mm=size, thickness_mm=thickness, poisson=poisson)
    return compression_modulus(travel, force, diameter_mm=size, height_mm=thickness, poisson=poisson)


def _combined(fits: Sequence[tuple[str, MeasuredModulus]]) -> BenchModulus:
    values = np.array([item.young_kpa for _, item in fits])
    scatter = float(np.std(values, ddof=1)) if len(values) > 1 else 0.0
    points = float(np.sqrt(np.mean([item.sd_kpa**2 for _, item in fits])))
    kinds = {kind: float(np.mean([item.young_kpa for of, item in fits if of == kind])) for kind, _ in fits}
    sd = max(scatter, points) / np.sqrt(len(values))
    return BenchModulus(young_kpa=float(values.mean()), sd_kpa=float(sd), specimens=len(values), by_kind=kinds)


def score_validation(
    study: Study,
    moduli: Mapping[str, BenchModulus],
    *,
    device: str | None = None,
    diameter_sd_mm: float = 0.0,
    depth_sd_mm: float = 0.0,
) -> ValidationScore:
    """Score a device, by default the first, with the measured ``moduli`` by label in place of the sealed ones.

    ``diameter_sd_mm`` and ``depth_sd_mm`` are the standard uncertainties, in [0, 10] mm, of the sealed sizes.

    Raises `InputError` when an uncertainty lies outside its range, a label is not of a sealed inclusion, an inclusion
    has no measured modulus, or the device read nothing; `RecordsError` when the study is blind.
    """
    sizes_sd = {
        "diameter_mm": require_number("diameter_sd_mm", diameter_sd_mm, 0.0, 10.0, hint="millimetres"),
        "depth_mm": require_number("depth_sd_mm", depth_sd_mm, 0.0, 10.0, hint="millimetres"),
    }
    if study.unblinded is None:
        raise RecordsError("a study must be unblinded before it is scored; this one is blind (tsis study analyse)")
    name = device or (study.devices[0] if study.devices else "")
    if name not in study.devices:
        raise InputError(f"device must be one that has readings, {', '.join(study.devices) or 'none'}; got {name!r}")
    sealed = read_seal(study)[0].truths
    nominal = {truth.label: truth.values["young_kpa"] for truth in sealed.values() if truth.has_inclusion}
    unknown = [label for label in moduli if label not in nominal and label != TISSUE]
    lost = [label for label in nominal if label not in moduli]
    if unknown or lost:
        raise InputError(
            "the bench tests must name each phantom with an inclusion, and no other but tissue; "
            + (f"{unknown[0]!r:.60} is none" if unknown else f"{', '.join(lost[:9])} missing")
        )
    truths = {code: _replaced(truth, moduli) for code, truth in sealed.items()}
    decisions = DeviceResults.of(name, study.threshold_of(name), study.readings, truths, study.plan.codes)
    own = [item for item in study.readings if item.device == name and truths[item.code].has_inclusion]
    known_sd = {
        code: {**sizes_sd, "young_kpa": moduli[truth.label].sd_kpa}
        for code, truth in truths.items()
        if truth.has_inclusion
    }
    scores = (_score(quantity, own, truths, known_sd) for quantity in QUANTITIES)
    return ValidationScore(
        study=study,
        device=name,
        moduli=moduli,
        nominal=nominal,
        quantities=tuple(item for item in scores if item is not None),
        counts=decisions.counts(),
        undecided=len(decisions.undecided),
        unread=len(decisions.unread),
        faults=len(verify_study(study.folder).faults),
        of_recipe=_of_recipe(sealed),
    )


def _replaced(truth: TargetTruth, moduli: Mapping[str, BenchModulus]) -> TargetTruth:
    lump = truth.phantom.inclusion
    if lump is None:
        return truth
    lump = replace(lump, young_kpa=moduli[truth.label].young_kpa)
    return replace(truth, phantom=replace(truth.phantom, inclusion=lump))


def _of_recipe(sealed: Mapping[str, TargetTruth]) -> bool:
    recipe = {item.label: (item.diameter_mm, item.depth_mm) for item in KIT}
    lumps = [truth for truth in sealed.values() if truth.has_inclusion]
    return all(recipe.get(t.label) == (t.values["diameter_mm"], t.values["depth_mm"]) for t in lumps)


def _score(
    quantity: str,
    readings: Sequence[DeviceReading],
    truths: Mapping[str, TargetTruth],
    known_sd: Mapping[str, Mapping[str, float]],
) -> QuantityScore | None:
    """The score of a quantity; None where neither a value nor an interval was read of it."""
    errors: dict[str, list[float]] = {}
    for reading in readings:
        if quantity in reading.values:
            errors.setdefault(reading.code, []).append(reading.values[quantity] - truths[reading.code].values[quantity])
    inside = list(_inside(quantity, readings, truths, known_sd))
    if not errors and not inside:
        return None
    means = np.array([np.mean(values) for values in errors.values()])
    relative = [np.mean(values) / truths[code].values[quantity] for code, values in errors.items()]
    interval: Interval | None = None
    if len(means) > 1:
        half = float(scipy.special.stdtrit(len(means) - 1, 0.975) * means.std(ddof=1) / np.sqrt(len(means)))
        interval = Interval(low=float(means.mean()) - half, high=float(means.mean()) + half, level=0.95, method="t")
    return QuantityScore(
        quantity=quantity,
        hits=sum(plain for plain, _ in inside),
        hits_widened=sum(widened for _, widened in inside),
        count=len(inside),
        phantoms=len(means),
        bias=float(means.mean()) if errors else None,
        relative_bias=float(np.mean(relative)) if errors else None,
        bias_interval=interval,
    )


def _inside(
    quantity: str,
    readings: Sequence[DeviceReading],
    truths: Mapping[str, TargetTruth],
    known_sd: Mapping[str, Mapping[str, float]],
) -> Iterator[tuple[bool, bool]]:
    """Whether each first reading's interval holds the truth, as it is and widened by the truth's uncertainty."""
    z = float(scipy.special.ndtri((1 + INTERVAL_LEVEL) / 2))
    for reading in first_readings(readings):
        if reading.score is not None and quantity in reading.interval_90:
            true, (low, high) = truths[reading.code].values[quantity], reading.interval_90[quantity]
            more = z * known_sd[reading.code][quantity]
            middle = float(np.clip(reading.values.get(quantity, (low + high) / 2), low, high))
            ends = middle - np.hypot(middle - low, more), middle + np.hypot(high - middle, more)
            yield low <= true <= high, bool(ends[0] <= true <= ends[1])
