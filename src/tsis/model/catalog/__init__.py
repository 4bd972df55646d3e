"""The dissertation's probes and phantoms, as TOML files that anyone can read and copy."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from tsis.model.check import require_one_of
from tsis.model.light import FOUR_LEDS, Glass, Led
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.probe import Layer, Probe
from tsis.model.sphere import SoftSphere

if TYPE_CHECKING:
    from collections.abc import Mapping


@cache
def _table(kind: str) -> dict[str, dict[str, Any]]:
    return tomllib.loads((files(__package__) / f"{kind}.toml").read_text(encoding="utf-8"))


def list_probes() -> tuple[str, ...]:
    """Names that `load_probe` knows."""
    return tuple(_table("probes"))


def list_phantoms() -> tuple[str, ...]:
    """Names that `load_phantom` knows."""
    return tuple(_table("phantoms"))


def list_spheres() -> tuple[str, ...]:
    """Names that `load_sphere` knows."""
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
    return parse_probe(name, _table("probes")[require_one_of("probe", name, list_probes())])


def parse_probe(name: str, entry: Mapping[str, Any]) -> Probe:
    """The probe that a table of a catalog holds under its name; errors as `Probe`."""
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
    """Load a phantom of the catalog: one site of it, with the inclusion under the probe's axis.

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
