"""Repeatability, reproducibility, agreement and linearity of what a study's devices read of inclusions."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from tsis.detection import bland_altman, linearity, repeatability, reproducibility
from tsis.errors import InputError, RecordsError
from tsis.study._folder import read_seal
from tsis.study._values import QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from tsis.detection import BlandAltman, Linearity, Repeatability, Reproducibility
    from tsis.study._folder import Study
    from tsis.study._values import DeviceReading


LEAST_COMPLETE = 3  # targets, below which nothing is computed
OPERATORS, PROBES = "operators", "probes"


@dataclass(frozen=True, slots=True, kw_only=True)
class Precision:
    """Precision of one quantity, in its unit, on the inclusions that were read completely.

    A reading is complete where the device measured the quantity; a target, where every operator has all repeats of it.

    Attributes
    ----------
    quantity
        Diameter, depth or modulus by its name.
    device
        Whose readings; both names where two devices are compared.
    over
        What differs between conditions: `OPERATORS`, or `PROBES` with one operator.
    conditions
        Names of the operators, or of the devices.
    complete, incomplete
        Codes of the targets used, and of those that lack a reading of this quantity.
    repeats
        Readings of each target in each condition.
    within
        Repeatability, pooled over targets and conditions.
    between
        Reproducibility over the conditions; None with a single one.
    limits
        Limits of agreement of the first readings, by pairs of conditions, first minus second.
    errors
        Target means less the true values; their bias is that of the readings.
    line
        Line of the target means over the true values; None where these are too few or too equal.
    """

    quantity: str
    device: str
    over: str
    conditions: tuple[str, ...]
    complete: tuple[str, ...]
    incomplete: tuple[str, ...]
    repeats: int
    within: Repeatability
    between: Reproducibility | None
    limits: Mapping[tuple[str, str], BlandAltman]
    errors: BlandAltman
    line: Linearity | None

    @property
    def relative_bias(self) -> float:
        """Mean of the error over the true value."""
        true = self.errors.means - self.errors.differences / 2
        return float((self.errors.differences / true).mean())


@dataclass(frozen=True, slots=True, kw_only=True)
class PrecisionAnalysis:
    """Precision of all quantities of a study; ``missing`` says by device and quantity why one is not there."""

    study: Study
    results: tuple[Precision, ...]
    missing: Mapping[tuple[str, str], str]


def analyse_precision(study: Study) -> PrecisionAnalysis:
    """Analyse the repeats, operators and devices of an unblinded study on its inclusions.

    Every device is a probe. Devices are compared on the readings of the operator who read most with all of them.

    Raises
    ------
    RecordsError
        When the study is blind, or asks for one reading of each target.
    """
    if study.unblinded is None:
        raise RecordsError("a study must be unblinded before its repeatability is analysed; run tsis study analyse")
    if study.plan.repeats < 2:
        raise RecordsError(
            "a study of repeatability must ask for at least 2 repeats; this one asks for 1: make one with "
            "tsis study new --repeats 3"
        )
    truths = read_seal(study)[0].truths
    true = {code: truth.values for code, truth in truths.items() if truth.has_inclusion}
    results, missing = list[Precision](), dict[tuple[str, str], str]()
    for quantity in QUANTITIES:
        expected = {code: values[quantity] for code, values in true.items()}
        tables = {device: _table(study.readings, device, quantity) for device in study.devices}
        for device, table in tables.items():
            _add(results, missing, study.plan.repeats, quantity, device, OPERATORS, table, expected)
        if len(tables) > 1 and (operator := _shared_operator(tables, expected)):
            probes = {device: table[operator] for device, table in tables.items()}
            name = f"{' and '.join(tables)}, operator {operator}"
            _add(results, missing, study.plan.repeats, quantity, name, PROBES, probes, expected)
    return PrecisionAnalysis(study=study, results=tuple(results), missing=missing)


Values = dict[str, list[float]]  # of each code, in the order of the repeats


def _table(readings: Sequence[DeviceReading], device: str, quantity: str) -> dict[str, Values]:
    """Values of a device by operator and code."""
    table: dict[str, Values] = {}
    for reading in readings:
        if reading.device == device:
            row = table.setdefault(reading.operator, {}).setdefault(reading.code, [])
            if reading.score is not None and quantity in reading.values:
                row.append(reading.values[quantity])
    return table


def _shared_operator(tables: Mapping[str, Mapping[str, Values]], expected: Mapping[str, float]) -> str | None:
    """The operator with most readings of inclusions among those who used every device."""
    names = set.intersection(*(set(table) for table in tables.values()))
    counts = {name: sum(len(t[name].get(code, ())) for t in tables.values() for code in expected) for name in names}
    return max(sorted(counts), key=counts.__getitem__, default=None)


def _add(
    results: list[Precision],
    missing: dict[tuple[str, str], str],
    repeats: int,
    quantity: str,
    device: str,
    over: str,
    table: Mapping[str, Values],
    expected: Mapping[str, float],
) -> None:
    complete = [code for code in expected if all(len(rows.get(code, ())) >= repeats for rows in table.values())]
    if len(complete) < LEAST_COMPLETE:
        missing[device, quantity] = (
            f"{len(complete)} of {len(expected)} inclusions were read completely; at least {LEAST_COMPLETE} are needed"
        )
        return
    cube = np.array([[rows[code][:repeats] for rows in table.values()] for code in complete])
    means, true = cube.mean(axis=(1, 2)), [expected[code] for code in complete]
    try:
        line = linearity(means, true)
    except InputError:
        line = None
    results.append(
        Precision(
            quantity=quantity,
            device=device,
            over=over,
            conditions=tuple(table),
            complete=tuple(complete),
            incomplete=tuple(code for code in expected if code not in complete),
            repeats=repeats,
            within=repeatability(list(cube.reshape(-1, repeats))),
            between=reproducibility(cube) if len(table) > 1 else None,
            limits=_limits(cube, tuple(table)),
            errors=bland_altman(means, true),
            line=line,
        )
    )


def _limits(cube: NDArray[np.float64], conditions: tuple[str, ...]) -> dict[tuple[str, str], BlandAltman]:
    """Limits of agreement of the first readings of each pair of conditions."""
    return {
        (conditions[first], conditions[second]): bland_altman(cube[:, first, 0], cube[:, second, 0])
        for first, second in combinations(range(len(conditions)), 2)
    }
