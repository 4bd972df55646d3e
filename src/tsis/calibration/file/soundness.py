"""What the parts of a calibration must be for their numbers to mean something, whoever wrote the file."""

from __future__ import annotations

from datetime import datetime
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.calibration.measured import MeasuredValue
    from tsis.calibration.specification.sheet import Specification

LONGEST_NAME, LONGEST_NOTE = 200, 1000
YEARS = (2000, 2200)  # within which every time can be brought to another zone and a term be added
MEASURED_IN: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "reference": MappingProxyType(
            {"read_noise_grey": "grey", "shot_noise_grey": "grey", "stray_grey": "grey", "patch_grey": "grey"}
        ),
        "force_line": MappingProxyType(
            {
                "intercept_grey": "grey",
                "slope_grey_per_n": "grey/N",
                "residual_grey": "grey",
                "residual_share": "",
            }
        ),
    }
)
NEVER_NEGATIVE = ("read_noise_grey", "shot_noise_grey", "patch_grey", "residual_grey", "residual_share")


def require_name(what: str, text: object, *, longest: int = LONGEST_NAME) -> None:
    r"""Refuse what is no text that a line of a terminal or a page can show.

    Examples
    --------
    >>> require_name("name", "bench\n2")
    Traceback (most recent call last):
    ...
    tsis.model.errors.InputError: name must be printable, on one line; got 'bench\n2'
    """
    if not isinstance(text, str):
        raise InputError(f"{what} must be a str; got {text!r:.80}")
    if len(text) > longest:
        raise InputError(f"{what} must hold at most {longest} characters; got {len(text)}")
    if not text.isprintable():
        raise InputError(f"{what} must be printable, on one line; got {text!r:.80}")


def require_time(what: str, moment: object) -> None:
    """Refuse what is neither None nor a time, a time without a zone, or in a year in which nobody calibrates."""
    if moment is None:
        return
    if not isinstance(moment, datetime) or moment.tzinfo is None:
        raise InputError(f"{what} must be a time with its zone; got {moment!r:.60}")
    if not YEARS[0] <= moment.year <= YEARS[1]:
        raise InputError(f"{what} must lie in the years {YEARS[0]} to {YEARS[1]}; got {moment.isoformat()}")


def require_measured(part: str, value: Any) -> None:
    """Refuse a part whose measured numbers are in another unit, or negative where nothing can be."""
    for name, unit in MEASURED_IN.get(part, {}).items():
        number: MeasuredValue | None = getattr(value, name)
        if number is None:
            continue
        _require_unit(f"{part}.{name}", number, unit)
        if name in NEVER_NEGATIVE and number.value < 0:
            raise InputError(f"{part}.{name} must not be negative; got {number.value:g}")


def require_sheet(sheet: Specification) -> None:
    """Refuse a sheet whose lines cannot be shown, or whose numbers are in another unit than their line."""
    for number, row in enumerate(sheet.rows):
        where = f"specification.rows[{number}]"
        for name in ("quantity", "unit", "fingertip", "printed", "note"):
            require_name(f"{where}.{name}", getattr(row, name), longest=LONGEST_NOTE)
        if row.measured is not None:
            _require_unit(f"{where}.measured", row.measured, row.unit)


def _require_unit(where: str, number: MeasuredValue, unit: str) -> None:
    if number.unit != unit:
        raise InputError(f"{where} must be in {unit or 'no unit, a pure number'}; got {number.unit!r:.40}")
