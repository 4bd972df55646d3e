"""Gel sensors from TOML files, and probes as gel sensors."""

from __future__ import annotations

import tomllib
from dataclasses import MISSING, fields, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w

from tsis.catalog.probes import list_probes, load_probe
from tsis.errors import FileInputError, InputError, UnknownNameError
from tsis.files.reading import as_path, parse_toml, printable_path, read_parsed
from tsis.model.gel_sensor import BoundedValue, GelSensor, gel_sensor_of_probe
from tsis.model.probe import Layer
from tsis.model.require import require_one_of

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping


BOUNDED = ("thickness_mm", "young_kpa", "poisson")


LARGEST_SENSOR_BYTES = 64 * 2**10


ENDING = ".toml"


@cache
def _shipped() -> dict[str, dict[str, Any]]:
    return tomllib.loads((files(__package__) / "sensors.toml").read_text(encoding="utf-8"))


def list_sensors() -> tuple[str, ...]:
    """Names for `load_sensor`: the gel sensors, then the probes."""
    return (*_shipped(), *list_probes())


def load_sensor(name: str | os.PathLike[str]) -> GelSensor:
    """Load a gel sensor of the catalog, a probe of the catalog as one, or the sensor of a TOML file.

    A name that ends in ``.toml``, and a path, is a file; its `reference_file` is then relative to the file's folder.

    Raises
    ------
    UnknownNameError
        When the catalog has no such sensor; the nearest name is suggested.
    FileInputError
        When the file is missing, is no TOML, does not hold one sensor, or holds a value that a sensor cannot have.

    Examples
    --------
    >>> load_sensor("9dtact").pressed
    'darker'
    >>> load_sensor("tsis-2011").layers[0].thickness_mm
    2.0
    """
    if isinstance(name, str) and not name.lower().endswith(ENDING):
        try:
            known = require_one_of("sensor", name, list_sensors())
        except UnknownNameError as error:
            raise UnknownNameError(f"{error}, or a file in {ENDING}, which tsis sensor new makes") from None
        if known in list_probes():
            return gel_sensor_of_probe(load_probe(known))
        return parse_sensor(known, _shipped()[known])
    path = as_path(name)
    if not path.exists():
        raise FileInputError(
            f"{printable_path(path)} must be the file of the sensor; it does not exist: make one with tsis sensor new, "
            f"or name one of {', '.join(_shipped())}"
        )
    sensor = read_parsed(path, _parsed, most=LARGEST_SENSOR_BYTES)
    if sensor.reference_file is None:
        return sensor
    return replace(sensor, reference_file=str(path.parent / Path(sensor.reference_file)))


def _parsed(text: str) -> GelSensor:
    document = parse_toml(text, what="a sensor")
    if len(document) != 1 or not all(isinstance(value, dict) for value in document.values()):
        got = f"{', '.join(document):.80}" if document else "nothing"
        raise InputError(f"it must hold one sensor, a table under its name as [my-sensor]; got {got}")
    ((name, entry),) = document.items()
    if name in list_sensors():
        raise InputError(f"the name {name!r} is that of a sensor of the catalog; choose another, as [my-{name}]")
    return parse_sensor(name, entry)


def parse_sensor(name: str, entry: Mapping[str, Any]) -> GelSensor:
    """The sensor of an entry of a sensor file.

    A value with limits is written as one number, as ``[low, high]``, or as ``{ value, low, high }``.

    Raises
    ------
    InputError
        When a key is unknown or missing, or as `GelSensor`.
    """
    known = [item.name for item in fields(GelSensor) if item.name != "name"]
    for key in entry:
        require_one_of("value of a sensor", key, known)
    missing = [
        item.name
        for item in fields(GelSensor)
        if item.default is MISSING and item.default_factory is MISSING and item.name not in ("name", *entry)
    ]
    if missing:
        raise InputError(f"a sensor must give {', '.join(missing)}; got none")
    values = dict(entry)
    for key in BOUNDED:
        values[key] = _bounded(key, values[key])
    if "layers" in values:
        values["layers"] = tuple(_layer(layer) for layer in _list("layers", values["layers"]))
    for key in ("image_px", "raw_px", "mm_per_pixel", "distortion", "lamp_azimuth_deg", "limits"):
        if key in values:
            values[key] = tuple(_list(key, values[key]))
    if "corners_px" in values:
        values["corners_px"] = tuple(
            tuple(_list("a corner", corner)) for corner in _list("corners_px", values["corners_px"])
        )
    return GelSensor(name=name, **values)


def _list(key: str, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise InputError(f"{key} must be a list; got {value!r:.80}")
    return value


def _layer(entry: Any) -> Layer:
    if not isinstance(entry, dict):
        raise InputError(f"layers must be tables, as {{ thickness_mm = 2.0, young_kpa = 50.0 }}; got {entry!r:.80}")
    for key in entry:
        require_one_of("value of a layer", key, [item.name for item in fields(Layer)])
    if not {"thickness_mm", "young_kpa"} <= set(entry):
        raise InputError(f"a layer must give thickness_mm and young_kpa; got {', '.join(entry) or 'nothing'}")
    return Layer(**entry)


def _bounded(key: str, value: Any) -> BoundedValue:
    if isinstance(value, list) and len(value) == 2:
        return BoundedValue(low=value[0], high=value[1])
    if isinstance(value, dict):
        for part in value:
            require_one_of(f"part of {key}", part, ("value", "low", "high"))
        return BoundedValue(**value)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return BoundedValue(value=value)
    raise InputError(f"{key} must be a number, limits as [100, 200], or {{ value, low, high }}; got {value!r:.80}")


def sensor_toml(sensor: GelSensor) -> str:
    """The sensor as a file that `load_sensor` reads; values that have their defaults are left out.

    Examples
    --------
    >>> parse_sensor("mine", tomllib.loads(sensor_toml(load_sensor("9dtact")))["9dtact"]).light
    'white'
    """
    table: dict[str, Any] = {}
    for item in fields(GelSensor):
        value = getattr(sensor, item.name)
        if item.name == "name" or value is None or value == item.default or (value in ((), {}) and not value):
            continue
        if isinstance(value, BoundedValue):
            value = (
                value.best if value.exact else {"value": value.best, "low": value.limits[0], "high": value.limits[1]}
            )
        elif item.name == "layers":
            value = [{part.name: float(getattr(layer, part.name)) for part in fields(Layer)} for layer in value]
        elif item.name == "sources":
            value = dict(value)
        elif item.name == "corners_px":
            value = [list(corner) for corner in value]
        table[item.name] = list(value) if isinstance(value, tuple) else value
    return tomli_w.dumps({sensor.name: table})
