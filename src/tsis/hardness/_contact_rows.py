"""Rows of contacts from a CSV file, a table of pandas, or objects with such attributes."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tsis.errors import FileInputError, InputError
from tsis.files.reading import as_path, printable_path, read_bytes
from tsis.model.require import require_number

MOST_BYTES = 10_000_000
LEAST_OWN = 0.05  # of a standard deviation: what rounding may take off
COLUMNS = (
    *("force_n", "force_sd_n", "radius_mm", "radius_sd_mm", "area_mm2", "area_sd_mm2"),
    *("depth_mm", "depth_sd_mm", "scale_sd", "object_radius_mm", "time_s"),
)


def contact_rows(contacts: Any) -> list[Any]:
    """Each contact as it was given: of a path, a table of pandas, a sequence, or a single one."""
    if isinstance(contacts, (str, Path)):
        return list(_csv_rows(as_path(contacts)))
    if hasattr(contacts, "to_dict") and hasattr(contacts, "columns"):  # a table of pandas
        return list(contacts.to_dict("records"))
    if isinstance(contacts, Mapping) or not isinstance(contacts, Sequence):
        return [contacts] if contacts is not None else []
    return list(contacts)


def _csv_rows(path: Path) -> Sequence[Mapping[str, Any]]:
    try:
        text = read_bytes(path, most=MOST_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileInputError(f"{printable_path(path)} must be CSV text in UTF-8; got other bytes") from error
    reader = csv.DictReader(io.StringIO(text))
    head = [name.strip() for name in reader.fieldnames or ()]
    if not set(head) & {"radius_mm", "area_mm2", "depth_mm"}:
        raise FileInputError(
            f"{printable_path(path)} must have a header with radius_mm, area_mm2 or depth_mm, beside force_n; "
            f"got {', '.join(head)!r:.120}"
        )
    rows = []
    for number, line in enumerate(reader, start=2):
        row: dict[str, Any] = {"name": f"line {number}"}
        for name, cell in line.items():
            if name is None or cell is None:
                raise FileInputError(f"{printable_path(path)}: line {number} must have {len(head)} columns")
            row[name.strip()] = cell.strip()
        rows.append(row)
    return rows


def contact_value(row: Any, name: str) -> Any:
    """A value of a row by its column; None where it is missing, empty or NaN."""
    value = row.get(name) if isinstance(row, Mapping) else getattr(row, name, None)
    return None if value is None or value == "" or (isinstance(value, float) and math.isnan(value)) else value


def is_good(row: Any) -> bool:
    """Whether the row is not marked as bad."""
    good = contact_value(row, "good")
    return good is None or str(good).strip().lower() not in ("false", "0", "no")


def forces_of_contacts(force: float | Sequence[float] | None, count: int) -> Sequence[float | None]:
    """The force of each contact; None where it is not given."""
    if force is None:
        return [None] * count
    forces = [float(force)] * count if isinstance(force, (int, float)) else [float(item) for item in force]
    if len(forces) != count:
        raise InputError(f"force must be one number, or one for each of the {count} contacts; got {len(forces)}")
    return forces


def own_sd(total: float, value: float, scale_sd: float, name: str) -> float:
    """What is left of a standard deviation without the scale's part, which the sensor states for all contacts."""
    require_number(f"scale_sd of {name}", scale_sd, 0.0, 0.5, hint="a fraction")
    return math.sqrt(max(total**2 - (scale_sd * value) ** 2, (LEAST_OWN * total) ** 2))
