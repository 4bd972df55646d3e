"""Score of a validation: readings of an unblinded study against moduli that a bench test measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.detection import Interval
from tsis.errors import FileInputError, InputError, RecordsError
from tsis.files import as_path, printable_path, read_csv_rows
from tsis.mechanics import compression_modulus, indentation_modulus
from tsis.model import INTERVAL_LEVEL, require_number
from tsis.study._folder import read_seal
from tsis.study._kit import KIT, MODULUS_COLUMNS
from tsis.study._values import QUANTITIES
from tsis.study._verification import verify_study
from tsis.study.analysis._precision import device_results

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Mapping, Sequence

    from tsis.detection import Counts
    from tsis.files import CsvRow
    from tsis.mechanics import MeasuredModulus
    from tsis.study._folder import Study
    from tsis.study._values import DeviceReading, TargetTruth

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

    Raises
    ------
    FileInputError
        When the table has no point, or a row is no point; the message gives its line.
    InputError
        When no modulus fits the points of a specimen.
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

    Raises
    ------
    InputError
        When an uncertainty lies outside its range, a label is not of a sealed inclusion, an inclusion has no measured
        modulus, or the device read nothing.
    RecordsError
        When the study is blind.
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
    decisions = device_results(name, study.threshold_of(name), study.readings, truths, study.plan.codes)
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
    for reading in readings:
        if reading.repeat == 1 and reading.score is not None and quantity in reading.interval_90:
            true, (low, high) = truths[reading.code].values[quantity], reading.interval_90[quantity]
            more = z * known_sd[reading.code][quantity]
            middle = float(np.clip(reading.values.get(quantity, (low + high) / 2), low, high))
            ends = middle - np.hypot(middle - low, more), middle + np.hypot(high - middle, more)
            yield low <= true <= high, bool(ends[0] <= true <= ends[1])
