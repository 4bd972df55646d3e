"""Probes from a TOML file or a plug-in, and a probe as such a file."""

from __future__ import annotations

import tomllib
from dataclasses import asdict, replace
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import tomli_w

from tsis.errors import PluginError
from tsis.model.probe import FOUR_LEDS, Glass, Layer, Led, Probe
from tsis.model.require import require_one_of
from tsis.plugins import find_plugins, load_plugin

if TYPE_CHECKING:
    from collections.abc import Mapping


@cache
def _shipped() -> dict[str, dict[str, Any]]:
    return tomllib.loads((files(__package__) / "probes.toml").read_text(encoding="utf-8"))


def list_probes() -> tuple[str, ...]:
    """Names for `load_probe`: those of tsis, then those of plug-ins."""
    return (*_shipped(), *sorted(set(find_plugins("probes")) - set(_shipped())))


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
    if name in _shipped():
        return parse_probe(name, _shipped()[name])
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


UNNAMED = "probe"


def probe_toml(probe: Probe) -> str:
    """The probe as a TOML table under its name, or ``probe`` without one; optional defaults are omitted.

    Examples
    --------
    >>> from tsis import Layer, Probe
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


def probe_variant(name: str, half_angle_deg: float | None, height_mm: float | None, aim_deg: float | None) -> Probe:
    """A probe of the catalog with other values of all its lamps."""
    probe = load_probe(name)
    options = {"half_angle_deg": half_angle_deg, "height_mm": height_mm, "aim_deg": aim_deg}
    changes: dict[str, Any] = {name: value for name, value in options.items() if value is not None}
    if not changes:
        return probe
    leds = tuple(replace(led, **changes) for led in probe.leds)
    return replace(probe, name=f"{name} (lamps changed)", leds=leds)
