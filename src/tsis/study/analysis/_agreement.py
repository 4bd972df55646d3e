"""Agreement of repeated readings, within and between operators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from tsis.detection import intraclass_correlation, repeatability, reproducibility
from tsis.errors import InputError
from tsis.study._values import QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.detection import Interval
    from tsis.study._values import DeviceReading
    from tsis.study.analysis._precision import DeviceResults


SCORE = "score"
LEAST_TARGETS = 3  # below, an agreement says nothing
WITHIN, BETWEEN = "within an operator", "between operators"


@dataclass(frozen=True, slots=True, kw_only=True)
class AgreementValue:
    """A number with its interval, or a remark why one is missing."""

    value: float | None
    interval: Interval | None
    remark: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """Agreement of repeated readings of one quantity, ``"score"`` or one of an inclusion.

    ``between`` is `WITHIN` an operator or `BETWEEN` operators. ``targets`` counts those that all operators read
    ``repeats`` times with a result. ``form`` of the intraclass correlation is ``"ICC(1,1)"`` of repeats, ``"ICC(2,1)"``
    of operators. ``coefficient`` is the difference that two readings of a target stay below with a probability of 95 %,
    in the quantity's unit.
    """

    quantity: str
    between: str
    targets: int
    operators: int
    repeats: int
    form: str
    correlation: AgreementValue
    coefficient: AgreementValue


def agreements(device_results: DeviceResults, readings: Sequence[DeviceReading]) -> tuple[Agreement, ...]:
    """Agreement of repeats, by the operator with most readings, and of operators, if any.

    Sizes, depths and moduli are compared on inclusions alone.
    """
    own = [reading for reading in readings if reading.device == device_results.device]
    inside = {target.code for target in device_results.targets if target.truth.has_inclusion}
    results = []
    for quantity in (SCORE, *QUANTITIES):
        table = _table(own, quantity, None if quantity == SCORE else inside)
        results += [item for item in (_within(quantity, table), _between(quantity, table)) if item is not None]
    return tuple(results)


Table = dict[str, dict[str, list[float]]]  # values by operator and code


def _table(readings: Sequence[DeviceReading], quantity: str, codes: set[str] | None) -> Table:
    table: Table = {}
    for reading in readings:
        value = reading.score if quantity == SCORE else reading.values.get(quantity)
        if value is not None and reading.score is not None and (codes is None or reading.code in codes):
            table.setdefault(reading.operator, {}).setdefault(reading.code, []).append(value)
    return table


def _within(quantity: str, table: Table) -> Agreement | None:
    repeated = {name: [row for row in rows.values() if len(row) > 1] for name, rows in table.items()}
    rows = max(repeated.values(), key=len, default=[])
    if len(rows) < LEAST_TARGETS:
        return None
    repeats = min(map(len, rows))
    whole = [row[:repeats] for row in rows]
    size = {"targets": len(rows), "operators": 1, "repeats": repeats}
    return _agreement(quantity, WITHIN, size, "ICC(1,1)", whole, lambda: repeatability(rows))


def _between(quantity: str, table: Table) -> Agreement | None:
    if len(table) < 2:
        return None
    common = [code for code in next(iter(table.values())) if all(code in rows for rows in table.values())]
    if len(common) < LEAST_TARGETS:
        return None
    repeats = min(len(rows[code]) for rows in table.values() for code in common)
    cube = [[rows[code][:repeats] for rows in table.values()] for code in common]
    first = [[repeats_of[0] for repeats_of in target] for target in cube]
    size = {"targets": len(common), "operators": len(table), "repeats": repeats}
    return _agreement(quantity, BETWEEN, size, "ICC(2,1)", first, lambda: reproducibility(cube))


def _agreement(
    quantity: str,
    between: str,
    size: dict[str, int],
    form: Literal["ICC(1,1)", "ICC(2,1)"],
    rows: list[list[float]],
    coefficient: Callable[[], Any],
) -> Agreement:
    return Agreement(
        quantity=quantity,
        between=between,
        form=form,
        correlation=_number(lambda: intraclass_correlation(rows, form), "value"),
        coefficient=_number(coefficient, "coefficient"),
        **size,
    )


def _number(of: Callable[[], Any], name: str) -> AgreementValue:
    value, interval, remark = None, None, ""
    try:
        result = of()
        value = getattr(result, name)
        interval = result.interval()
    except InputError as error:
        remark = str(error)
    return AgreementValue(value=value, interval=interval, remark=remark)
