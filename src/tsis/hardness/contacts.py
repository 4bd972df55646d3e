"""Contacts of a gel sensor read by any program.

A contact has a force, a radius or area, and the depth of the dent, each with its standard deviation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tsis.errors import InputError
from tsis.files.reading import as_path, printable_path, read_bytes
from tsis.files.tables import parse_csv_rows
from tsis.hardness.posterior import RadiusPrior
from tsis.model.require import require_number, require_one_of, require_type

MOST_BYTES = 10_000_000
LEAST_OWN = 0.05  # of a standard deviation: what rounding may take off
COLUMNS = (
    *("force_n", "force_sd_n", "radius_mm", "radius_sd_mm", "area_mm2", "area_sd_mm2"),
    *("depth_mm", "depth_sd_mm", "scale_sd", "object_radius_mm", "time_s", "force_rate_n_s", "press"),
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
    content, text = read_bytes(path, most=MOST_BYTES), ("name", "good")
    table = parse_csv_rows(
        content,
        printable_path(path),
        (),
        (*COLUMNS, *text),
        one_of=("radius_mm", "area_mm2", "depth_mm"),
        ignore_others=True,
    )
    return [
        {column: row.number(column) for column in COLUMNS if column in row}
        | {"name": row.text("name") or row.where.rpartition(", ")[2]}
        | {"good": row.text("good")}
        for row in table
    ]


def contact_value(row: Any, name: str) -> Any:
    """A value of a row by its column; None where it is missing, empty or NaN."""
    value = row.get(name) if isinstance(row, Mapping) else getattr(row, name, None)
    return None if value is None or value == "" or (isinstance(value, float) and math.isnan(value)) else value


GOOD = ("", "nan", "none", "true", "t", "1", "1.0", "yes", "y", "good", "ok")  # a row without a word is good
BAD = ("false", "f", "0", "0.0", "no", "n", "bad")
LARGEST_DIFFERENCE = 0.2  # of the area of a contact from that of its radius


def is_good(row: Any) -> bool:
    """Whether the row is not marked as bad; `InputError` for a word that says neither."""
    good = contact_value(row, "good")
    word = "" if good is None else str(good).strip().lower()
    if word in BAD:
        return False
    if word not in GOOD:
        raise InputError(f"good must be true or false, 1 or 0, yes or no; got {good!r:.40}")
    return True


def forces_of_contacts(force: float | Sequence[float] | None, count: int) -> Sequence[float | None]:
    """The force of each contact; None where it is not given."""
    if force is None:
        return [None] * count
    forces = [float(force)] * count if isinstance(force, (int, float)) else [float(value) for value in force]
    if len(forces) != count:
        raise InputError(f"force must be one number, or one for each of the {count} contacts; got {len(forces)}")
    return forces


def own_sd(total: float, value: float, scale_sd: float, name: str) -> float:
    """What is left of a standard deviation without the scale's part, which the sensor states for all contacts."""
    require_number(f"scale_sd of {name}", scale_sd, 0.0, 0.5, hint="a fraction")
    return math.sqrt(max(total**2 - (scale_sd * value) ** 2, (LEAST_OWN * total) ** 2))


FORCE_SD, RADIUS_SD, DEPTH_SD = 0.02, 0.02, 0.03  # relative standard deviations where none is given
LEAST_FORCE_SD_N = 0.005


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchReading:
    """One contact of a gel sensor with an object.

    Parameters
    ----------
    force_n, force_sd_n
        Normal force in N, and its standard deviation; 2 % and at least 0.005 N by default. None where not measured.
    radius_mm, radius_sd_mm
        Radius of the contact in mm (half the width for a cylinder), and its standard deviation; 2 % by default.
    depth_mm, depth_sd_mm
        How deep the gel's face is dented at the middle of the contact, mm, and its standard deviation; 3 % by default.
    press
        Number of the press to which the contact belongs, with others of the same number; None for a press of its own.
    time_s, force_rate_n_s
        Time of the frame in s, and how fast the force grew then, N/s: by it an error of time is one of force. The rate
        of a press of several times is found.
    name
        Name in reports.

    Raises
    ------
    InputError
        When a number is not positive, not finite or out of range, or neither radius nor depth is given.

    Examples
    --------
    >>> round(TouchReading(force_n=1.0, radius_mm=2.0).radius_sd_mm, 3)
    0.04
    """

    force_n: float | None = None
    force_sd_n: float | None = None
    radius_mm: float | None = None
    radius_sd_mm: float | None = None
    depth_mm: float | None = None
    depth_sd_mm: float | None = None
    press: float | None = None
    time_s: float | None = None
    force_rate_n_s: float | None = None
    name: str = ""

    def __post_init__(self) -> None:
        label = f" of {self.name}" if self.name else ""
        for name, low, high, unit in (
            ("force_n", 1e-4, 1000.0, "newtons"),
            ("radius_mm", 0.01, 100.0, "millimetres"),
            ("depth_mm", 1e-3, 50.0, "millimetres"),
        ):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, require_number(name + label, getattr(self, name), low, high, hint=unit))
        for name, largest in (("press", 1e9), ("time_s", 1e12), ("force_rate_n_s", 1e4)):
            if getattr(self, name) is not None:
                require_number(name + label, getattr(self, name), -largest, largest)
        if self.radius_mm is None and self.depth_mm is None:
            raise InputError(f"a contact{label} must have radius_mm, area_mm2 or depth_mm; got none of them")
        for value, name, fraction, least in (
            (self.force_n, "force_sd_n", FORCE_SD, LEAST_FORCE_SD_N),
            (self.radius_mm, "radius_sd_mm", RADIUS_SD, 0.0),
            (self.depth_mm, "depth_sd_mm", DEPTH_SD, 0.0),
        ):
            sd = getattr(self, name)
            if sd is not None and value is not None:
                require_number(name + label, sd, 1e-6 * value, value, hint="in the unit of its value, up to the value")
            elif value is not None:
                object.__setattr__(self, name, max(fraction * value, least))
            else:
                object.__setattr__(self, name, None)


def as_touch_readings(
    contacts: Any, *, force: float | Sequence[float] | None = None
) -> tuple[tuple[TouchReading, ...], tuple[str, ...], float | None]:
    """The readings in contacts of any form, the names of those that are not good, and the object's radius if stated.

    Parameters
    ----------
    contacts
        One or several of: `TouchReading`; mappings with the keys of `COLUMNS`; objects with such attributes, such as
        results of `tsis.imaging.gel_contact.contacts`; a table of pandas; or the path of a CSV file with such a header.
    force
        Force in N of all contacts, or of each; None where the contacts state theirs.

    Raises
    ------
    InputError
        When there is no contact, a number is invalid, or forces and contacts differ in number.
    FileInputError
        When the file is missing or not such a table.
    """
    rows = contact_rows(contacts)
    if not rows:
        raise InputError("contacts must hold at least one contact; got none")
    forces = forces_of_contacts(force, len(rows))
    good = [(row, own_force) for row, own_force in zip(rows, forces, strict=True) if is_good(row)]
    refused = tuple(_name(row, index) for index, row in enumerate(rows) if not is_good(row))
    if not good:
        raise InputError(f"contacts must hold a good contact; all {len(rows)} are marked as not good: press again")
    readings = tuple(_reading(row, _name(row, index), own_force) for index, (row, own_force) in enumerate(good))
    radii = {float(radius) for row, _ in good if (radius := contact_value(row, "object_radius_mm")) is not None}
    if len(radii) > 1:
        raise InputError(f"object_radius_mm must be one number for all contacts; got {sorted(radii)}")
    return readings, refused, radii.pop() if radii else None


MUCH_LESS = 0.8  # of the largest force or size: contacts of a held press differ by less


def loading_part(readings: Sequence[TouchReading]) -> tuple[TouchReading, ...]:
    """The contacts of a press from its first to its largest, in the order of time: what follows is unloading."""
    sizes = [reading.force_n or reading.radius_mm or reading.depth_mm or 0.0 for reading in readings]
    largest = max(sizes)
    if sizes[0] == largest and sizes[-1] < MUCH_LESS * largest and any(reading.time_s is None for reading in readings):
        raise InputError(
            "contacts of one press must be in the order of time, from the first touch on; "
            f"{readings[0].name or 'the first'} has the largest force or size of its press: list them the other way "
            "round, or state time_s"
        )
    return tuple(readings[: sizes.index(largest) + 1])


def grouped_presses(readings: Sequence[TouchReading], *, sequence: bool) -> tuple[TouchReading, ...]:
    """The contacts with a number of their press each, and the rate of their force where a press has times.

    Contacts of one number, or with ``sequence`` all, are one press in the order of time; its loading part stays.
    """
    groups: dict[float, list[TouchReading]] = {}
    numbers = [reading.press for reading in readings if reading.press is not None]
    free = max(numbers, default=0.0) + 1.0
    for index, reading in enumerate(readings):
        own = free + index if reading.press is None else reading.press
        groups.setdefault(free if sequence and not numbers else own, []).append(reading)
    grouped: list[TouchReading] = []
    for number, members in groups.items():
        together = sequence or members[0].press is not None
        timed = _with_rates(members) if together else members
        grouped += [replace(part, press=number) for part in (loading_part(timed) if together else timed)]
    return tuple(grouped)


def _with_rates(readings: Sequence[TouchReading]) -> list[TouchReading]:
    """The readings of one press with the rate of their force by their neighbours in time."""
    times = [reading.time_s for reading in readings]
    forces = [reading.force_n for reading in readings]
    known = [(time, force) for time, force in zip(times, forces, strict=True) if time is not None and force is not None]
    if len(known) < max(len(readings), 2):
        return list(readings)
    time, force = (np.array(part, dtype=float) for part in zip(*known, strict=True))
    if not np.all(np.diff(time) > 0.0):
        raise InputError("time_s of the contacts of one press must ascend; sort them by time")
    rates = np.gradient(force, time)
    return [
        replace(reading, force_rate_n_s=float(rate)) if reading.force_rate_n_s is None else reading
        for reading, rate in zip(readings, rates, strict=True)
    ]


def _name(row: Any, index: int) -> str:
    return str(contact_value(row, "name") or f"contact {index + 1}")


def _reading(row: Any, name: str, force: float | None) -> TouchReading:
    if isinstance(row, TouchReading):
        return row if force is None else replace(row, force_n=force, force_sd_n=None)
    if not isinstance(row, Mapping) and not any(hasattr(row, column) for column in COLUMNS):
        raise InputError(f"contacts must have radius_mm, area_mm2 or depth_mm; got {type(row).__name__}")
    numbers: dict[str, float] = {}
    for column in COLUMNS:
        if column == "object_radius_mm":
            continue
        value = force if column == "force_n" and force is not None else contact_value(row, column)
        if value is not None:
            try:
                numbers[column] = float(value)
            except (TypeError, ValueError) as error:
                raise InputError(f"{column} of {name} must be a number; got {value!r:.40}") from error
    area = numbers.pop("area_mm2", None)
    radius = numbers.get("radius_mm")
    round_mm2 = None if radius is None else math.pi * radius**2
    if area is not None and round_mm2 is not None and abs(area - round_mm2) > LARGEST_DIFFERENCE * round_mm2:
        raise InputError(
            f"radius_mm and area_mm2 of {name} must be of one contact; {radius:g} mm has {round_mm2:.3g} mm2, and "
            f"{area:g} mm2 is stated: leave one column out (a diameter is no radius)"
        )
    area_sd = numbers.pop("area_sd_mm2", None)
    if area is not None and "radius_mm" not in numbers:
        require_number(f"area_mm2 of {name}", area, 1e-4, 1e5, hint="square millimetres")
        numbers["radius_mm"] = math.sqrt(area / math.pi)
        if area_sd is not None:
            numbers["radius_sd_mm"] = numbers["radius_mm"] * area_sd / (2.0 * area)
    scale_sd = numbers.pop("scale_sd", 0.0)
    if scale_sd and "radius_sd_mm" in numbers:
        numbers["radius_sd_mm"] = own_sd(numbers["radius_sd_mm"], numbers["radius_mm"], scale_sd, name)
    return TouchReading(**numbers, name=name)


SHAPES = ("sphere", "cylinder", "flat")
LARGEST_RADIUS_MM = 60.0  # of objects
SAME_RADIUS = 0.05  # relative difference up to which two statements are of one radius
STATED_RADIUS_SD = 0.01  # relative, of an object's radius that is given without one


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectGeometry:
    """Shape of the touched part of an object.

    Parameters
    ----------
    shape
        ``"sphere"``; ``"cylinder"``, lying on the face; or ``"flat"``, wider than the contact.
    radius_mm, radius_sd_mm
        Radius in [0.5, 60] mm and its standard deviation, 1 % by default; None for an unknown radius.
    length_mm
        Length of the cylinder's contact, over which its force acts.

    Raises
    ------
    InputError
        When a value is out of range, or the length of a cylinder is missing.
    """

    shape: Literal["sphere", "cylinder", "flat"] = "sphere"
    radius_mm: float | None = None
    radius_sd_mm: float | None = None
    length_mm: float | None = None

    def __post_init__(self) -> None:
        require_one_of("shape of the object", self.shape, SHAPES)
        if self.radius_mm is not None:
            require_number("radius_mm of the object", self.radius_mm, 0.5, LARGEST_RADIUS_MM, hint="millimetres")
            if self.radius_sd_mm is not None:
                require_number("radius_sd_mm of the object", self.radius_sd_mm, 0.0, self.radius_mm / 3)
        if self.shape == "cylinder":
            require_number("length_mm of a cylinder", self.length_mm, 0.5, 500.0, hint="millimetres of contact")

    def radius_prior(self) -> RadiusPrior:
        """The radius, or all radii from 1 to 60 mm."""
        if self.radius_mm is None:
            return RadiusPrior(radius_mm=None, sd_mm=0.0, largest_mm=LARGEST_RADIUS_MM)
        sd = STATED_RADIUS_SD * self.radius_mm if self.radius_sd_mm is None else self.radius_sd_mm
        return RadiusPrior(radius_mm=self.radius_mm, sd_mm=sd, largest_mm=LARGEST_RADIUS_MM)


def as_geometry(geometry: Any, stated_mm: float | None) -> ObjectGeometry:
    """The geometry of a shape, a radius in mm or fields; with the radius that the contacts state where it has none."""
    if isinstance(geometry, Mapping):
        for name in geometry:
            require_one_of("field of geometry", name, ObjectGeometry.__slots__)
        shape = ObjectGeometry(**geometry)
    elif isinstance(geometry, str):
        shape = ObjectGeometry(shape=geometry)  # type: ignore[arg-type]  # checked there
    elif isinstance(geometry, (int, float)):
        shape = ObjectGeometry(radius_mm=float(geometry))
    else:
        require_type("geometry", geometry, ObjectGeometry)
        shape = geometry
    if shape.radius_mm is None and stated_mm is None and shape.radius_sd_mm is not None:
        raise InputError("radius_mm of the object must be given with radius_sd_mm, its standard deviation; got None")
    if shape.radius_mm is None or stated_mm is None:
        return replace(shape, radius_mm=stated_mm) if shape.radius_mm is None else shape
    if abs(shape.radius_mm - stated_mm) > SAME_RADIUS * stated_mm:
        raise InputError(
            f"radius_mm of the object must be the contacts' object_radius_mm, {stated_mm:g} mm, where both are given; "
            f"got {shape.radius_mm:g} mm: leave one of them out"
        )
    return shape
