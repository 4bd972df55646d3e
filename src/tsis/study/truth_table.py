"""Targets of one's own as a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.instrument.file_bytes import as_path, printable_path
from tsis.model import Inclusion, Phantom, load_phantom
from tsis.model.errors import FileInputError, InputError
from tsis.study.csv_rows import read_csv_rows
from tsis.study.truth import TargetTruth

if TYPE_CHECKING:
    import os

    from tsis.study.csv_rows import CsvRow

COLUMNS = ("label", "diameter_mm", "depth_mm", "young_kpa")
MORE_COLUMNS = ("offset_mm", "tissue_kpa", "thickness_mm", "poisson")


def read_truth_table(path: str | os.PathLike[str]) -> tuple[TargetTruth, ...]:
    """Targets from a file with the columns `COLUMNS`, and `MORE_COLUMNS` where they are known.

    Parameters
    ----------
    path
        Comma-separated values in UTF-8. A row whose diameter, depth and modulus are empty is a target without an
        inclusion; other empty cells are as in the phantom ``detection-blank`` of the catalog.

    Raises
    ------
    FileInputError
        When a row is no target, in one sentence with its line.
    """
    place = as_path(path)
    found: dict[str, TargetTruth] = {}
    for row in read_csv_rows(place, COLUMNS, MORE_COLUMNS):
        target = _target(row)
        if target.label in found:
            raise row.refused("label", "different in every row", target.label)
        found[target.label] = target
    if not found:
        raise FileInputError(f"{printable_path(place)} must hold at least one target; it has headings alone")
    return tuple(found.values())


def _target(row: CsvRow) -> TargetTruth:
    usual = load_phantom("detection-blank")
    numbers = {name: row.number(name) for name in (*COLUMNS[1:], *MORE_COLUMNS)}
    given = [name for name in COLUMNS[1:] if numbers[name] is not None]
    if given and len(given) < len(COLUMNS) - 1:
        lost = next(name for name in COLUMNS[1:] if name not in given)
        raise row.refused(lost, f"given where {given[0]} is, or all three empty", "")
    try:
        poisson = _or(numbers["poisson"], usual.poisson)
        lump = None
        if given:
            lump = Inclusion(
                diameter_mm=_or(numbers["diameter_mm"], 0.0),
                depth_mm=_or(numbers["depth_mm"], 0.0),
                young_kpa=_or(numbers["young_kpa"], 0.0),
                poisson=poisson,
                offset_mm=(_or(numbers["offset_mm"], 0.0), 0.0),
            )
        phantom = Phantom(
            young_kpa=_or(numbers["tissue_kpa"], usual.young_kpa),
            thickness_mm=_or(numbers["thickness_mm"], usual.thickness_mm),
            poisson=poisson,
            inclusion=lump,
        )
        return TargetTruth(label=row.text("label"), phantom=phantom)
    except InputError as error:
        raise FileInputError(f"{error} ({row.where})") from error


def _or(value: float | None, usual: float) -> float:
    return usual if value is None else value


__all__ = ["COLUMNS", "MORE_COLUMNS", "read_truth_table"]
