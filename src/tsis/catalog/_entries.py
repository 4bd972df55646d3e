"""Probes, phantoms and spheres of the dissertation, and gel sensors, from TOML files; sensor files of the user's."""

from __future__ import annotations

import tomllib
from dataclasses import MISSING, asdict, fields, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w

from tsis.errors import FileInputError, InputError, PluginError, UnknownNameError
from tsis.files import as_path, parse_toml, printable_path, read_parsed
from tsis.model import (
    FOUR_LEDS,
    BoundedValue,
    GelSensor,
    Glass,
    Inclusion,
    Layer,
    Led,
    Phantom,
    Probe,
    SoftSphere,
    gel_sensor_of_probe,
    require_one_of,
)
from tsis.plugins import find_plugins, load_plugin

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping


@cache
def _table(kind: str) -> dict[str, dict[str, Any]]:
    return tomllib.loads((files(__package__) / f"{kind}.toml").read_text(encoding="utf-8"))


def list_probes() -> tuple[str, ...]:
    """Names for `load_probe`: those of tsis, then those of plug-ins."""
    return (*_table("probes"), *sorted(set(find_plugins("probes")) - set(_table("probes"))))


def list_phantoms() -> tuple[str, ...]:
    """Names for `load_phantom`."""
    return tuple(_table("phantoms"))


def list_spheres() -> tuple[str, ...]:
    """Names for `load_sphere`."""
    return tuple(_table("spheres"))


def load_probe(name: str = "tsis-2011") -> Probe:
    """Load a probe of the catalog.

    Raises
    ------
    UnknownNameError
        When the catalog has no such probe; the nearest name is suggested.

    Examples
    --------
    >>> load_probe("tsis-2011").thickness_mm
    10.0
    """
    if name in _table("probes"):
        return parse_probe(name, _table("probes")[name])
    return _probe_of_plugin(require_one_of("probe", name, list_probes()))


def _probe_of_plugin(name: str) -> Probe:
    probe = load_plugin("probes", name)()
    if not isinstance(probe, Probe):
        package = find_plugins("probes")[name].package
        raise PluginError(f"the plug-in {name} of {package} must return a tsis.Probe; got {type(probe).__name__}")
    return replace(probe, name=name)


def parse_probe(name: str, entry: Mapping[str, Any]) -> Probe:
    """The probe of an entry of a catalog; errors as `Probe`."""
    return Probe(
        name=name,
        radius_mm=entry["radius_mm"],
        layers=tuple(Layer(**layer) for layer in entry["layers"]),
        face_curvature_mm=entry.get("face_curvature_mm"),
        sides=entry.get("sides", "free"),
        glass=Glass(**entry.get("glass", {})),
        leds=tuple(Led(**led) for led in entry["leds"]) if "leds" in entry else FOUR_LEDS,
        assumed=tuple(entry.get("assumed", ())),
    )


def load_phantom(name: str) -> Phantom:
    """Load a phantom of the catalog, with the inclusion on the probe's axis.

    Raises
    ------
    UnknownNameError
        When the catalog has no such phantom; the nearest name is suggested.

    Examples
    --------
    >>> load_phantom("hardness-70").inclusion.young_kpa
    70.0
    """
    entry = _table("phantoms")[require_one_of("phantom", name, list_phantoms())]
    inclusion = entry.get("inclusion")
    return Phantom(
        name=name,
        young_kpa=entry["young_kpa"],
        thickness_mm=entry["thickness_mm"],
        poisson=entry["poisson"],
        inclusion=None if inclusion is None else Inclusion(**inclusion),
        assumed=tuple(entry.get("assumed", ())),
    )


def load_sphere(name: str) -> SoftSphere:
    """Load a soft sphere of the catalog.

    Raises
    ------
    UnknownNameError
        When the catalog has no such sphere; the nearest name is suggested.

    Examples
    --------
    >>> load_sphere("cl2003x").young_kpa
    62.0
    """
    return SoftSphere(name=name, **_table("spheres")[require_one_of("sphere", name, list_spheres())])


UNNAMED = "probe"


def probe_toml(probe: Probe) -> str:
    """The probe as a TOML table under its name, or ``probe`` without one; optional defaults are omitted.

    Examples
    --------
    >>> from tsis.model import Layer, Probe
    >>> layer = Layer(thickness_mm=10.0, young_kpa=50.0)
    >>> print(probe_toml(Probe(radius_mm=12.0, layers=(layer,), name="soft")), end="")
    [soft]
    radius_mm = 12.0
    layers = [
        { thickness_mm = 10.0, young_kpa = 50.0, poisson = 0.49, refractive_index = 1.41 },
    ]
    leds = [
        { azimuth_deg = 0.0 },
        { azimuth_deg = 90.0 },
        { azimuth_deg = 180.0 },
        { azimuth_deg = 270.0 },
    ]
    """
    table: dict[str, Any] = {"radius_mm": float(probe.radius_mm)}
    if probe.face_curvature_mm is not None:
        table["face_curvature_mm"] = float(probe.face_curvature_mm)
    if probe.sides != "free":
        table["sides"] = probe.sides
    table["layers"] = [_numbers(asdict(layer)) for layer in probe.layers]
    if probe.glass != Glass():
        table["glass"] = _numbers(asdict(probe.glass))
    table["leds"] = [_numbers(_changed(led)) for led in probe.leds]
    if probe.assumed:
        table["assumed"] = list(probe.assumed)
    return tomli_w.dumps({probe.name or UNNAMED: table})


def _changed(led: Led) -> dict[str, float]:
    """The azimuth, and the other fields that differ from their defaults."""
    default = asdict(Led())
    return {name: value for name, value in asdict(led).items() if name == "azimuth_deg" or value != default[name]}


def _numbers(values: Mapping[str, float]) -> dict[str, float]:
    return {name: float(value) for name, value in values.items()}


def phantom_variant(name: str, diameter_mm: float | None, depth_mm: float | None, young_kpa: float | None) -> Phantom:
    """A phantom of the catalog with other values of its inclusion."""
    phantom = load_phantom(name)
    if diameter_mm is None and depth_mm is None and young_kpa is None:
        return phantom
    start = phantom.inclusion or Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0)
    inclusion = replace(
        start,
        diameter_mm=start.diameter_mm if diameter_mm is None else diameter_mm,
        depth_mm=start.depth_mm if depth_mm is None else depth_mm,
        young_kpa=start.young_kpa if young_kpa is None else young_kpa,
    )
    # A changed phantom must not have the plain name of the catalog.
    return replace(phantom, name=f"{name} (changed)", inclusion=inclusion)


def probe_variant(name: str, half_angle_deg: float | None, height_mm: float | None, aim_deg: float | None) -> Probe:
    """A probe of the catalog with other values of all its lamps."""
    probe = load_probe(name)
    options = {"half_angle_deg": half_angle_deg, "height_mm": height_mm, "aim_deg": aim_deg}
    changes: dict[str, Any] = {name: value for name, value in options.items() if value is not None}
    if not changes:
        return probe
    leds = tuple(replace(led, **changes) for led in probe.leds)
    return replace(probe, name=f"{name} (lamps changed)", leds=leds)


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
    for key in ("image_px", "mm_per_pixel", "distortion", "lamp_azimuth_deg", "limits"):
        if key in values:
            values[key] = tuple(_list(key, values[key]))
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
        table[item.name] = list(value) if isinstance(value, tuple) else value
    return tomli_w.dumps({sensor.name: table})
