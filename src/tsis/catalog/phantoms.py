"""Phantoms and soft spheres of the dissertation from TOML files."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from functools import cache
from importlib.resources import files
from typing import Any

from tsis.model.phantom import Inclusion, Phantom, SoftSphere
from tsis.model.require import require_one_of


@cache
def _table(kind: str) -> dict[str, dict[str, Any]]:
    return tomllib.loads((files(__package__) / f"{kind}.toml").read_text(encoding="utf-8"))


def list_phantoms() -> tuple[str, ...]:
    """Names for `load_phantom`."""
    return tuple(_table("phantoms"))


def list_spheres() -> tuple[str, ...]:
    """Names for `load_sphere`."""
    return tuple(_table("spheres"))


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
