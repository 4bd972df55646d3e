"""Rows of the tables: headings with their units, then the values."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

from tsis.model.estimate import INTERVAL_LEVEL
from tsis.model.quantities import NO_UNIT, label_of, unit_of
from tsis.records.plain_free import free_to_plain

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from tsis.model import Estimate
    from tsis.records.dossier import TargetRecord
    from tsis.records.values import StoredEstimate, Target

PRESS_HEADINGS = (
    "press",
    "role",
    "taken",
    "force (N)",
    "pixel size x (mm)",
    "pixel size y (mm)",
    "axis x (px)",
    "axis y (px)",
    "rows (px)",
    "columns (px)",
    "full scale (grey level)",
    "probe",
    "flags",
    "name",
    "note",
    "frame file",
    "frame (SHA-256)",
    "calibration (SHA-256)",
    "settings (JSON)",
    "id",
    "version",
)
ESTIMATE_HEADINGS = (
    "estimate",
    "in force",
    "kind",
    "made",
    "parameter",
    "unit",
    "mean (in unit)",
    "sd (in unit)",
    f"{INTERVAL_LEVEL:.0%} interval from (in unit)",
    f"{INTERVAL_LEVEL:.0%} interval to (in unit)",
    "prior sd (in unit)",
    "Cramer-Rao sd (in unit)",
    "narrowing (posterior sd / prior sd)",
    "identified",
    "trusted",
    "presence (probability)",
    "flags",
    "notes",
    "probe",
    "presses",
    "calibration (SHA-256)",
    "supersedes",
    "id",
)


def target_rows(target: Target) -> list[list[Any]]:
    """Headings and the one row of the target."""
    row: dict[str, Any] = {
        "target": target.number,
        "kind": target.kind,
        "name": target.name,
        "note": target.note,
        "made": target.made.isoformat(),
        "id": target.id,
        "version": target.version,
    }
    for name, value in target.truth.items():
        unit = unit_of(name)
        row[f"true {label_of(name)}" + ("" if unit == NO_UNIT else f" ({unit})")] = value
    return [list(row), list(row.values())]


def press_rows(dossier: TargetRecord, frame_files: Sequence[str]) -> list[Sequence[Any]]:
    """Headings and one row a press."""
    rows: list[Sequence[Any]] = [PRESS_HEADINGS]
    for number, (press, file) in enumerate(zip(dossier.presses, frame_files, strict=True), start=1):
        pixel = (None, None) if press.mm_per_pixel is None else press.mm_per_pixel
        known = [number, press.role, press.taken.isoformat(), _float(press.force_n), *map(_float, pixel)]
        known += [*map(_float, press.axis_px), press.rows, press.columns, _float(press.full_scale)]
        said = [press.probe, " ".join(press.flags), press.name, press.note, file, press.frame, press.calibration]
        settings = json.dumps(free_to_plain(press.settings, "settings"), sort_keys=True, allow_nan=False)
        rows.append([*known, *said, settings, press.id, press.version])
    return rows


def estimate_rows(dossier: TargetRecord) -> list[Sequence[Any]]:
    """Headings and one row an estimate and parameter."""
    rows: list[Sequence[Any]] = [ESTIMATE_HEADINGS]
    for number, stored in enumerate(dossier.estimates, start=1):
        rows += _parameter_rows(number, stored, in_force=stored in dossier.in_force)
    return rows


def _parameter_rows(number: int, stored: StoredEstimate, *, in_force: bool) -> Iterator[list[Any]]:
    found = stored.estimate
    numbers = _numbers(found)
    for name in found.samples:
        yield [
            number,
            in_force,
            stored.kind,
            stored.made.isoformat(),
            name,
            unit_of(name),
            *numbers[name],
            found.identified(name),
            found.trusted,
            _float(found.presence) if found.trusted else None,
            " ".join(found.flags),
            " ".join(found.notes),
            stored.probe,
            " ".join(stored.presses),
            stored.calibration,
            stored.supersedes,
            stored.id,
        ]


def _numbers(found: Estimate) -> dict[str, list[Any]]:
    """Mean, sd, interval, prior sd, Cramer-Rao sd and narrowing of each parameter; the prior alone if not trusted."""
    if not found.trusted:
        return {name: [None] * 4 + [_float(prior), None, None] for name, prior in found.prior_sd.items()}
    mean, sd, narrowing, interval = found.mean, found.sd, found.narrowing, found.interval(INTERVAL_LEVEL)
    rows: dict[str, list[Any]] = {}
    for name, prior in found.prior_sd.items():
        bound = found.cramer_rao_sd.get(name)
        least = "infinite" if bound == math.inf else _float(bound)
        rows[name] = [mean[name], sd[name], *interval[name], _float(prior), least, narrowing[name]]
    return rows


def _float(value: float | None) -> float | None:
    """A number of Python, which prints without its type."""
    return None if value is None else float(value)
