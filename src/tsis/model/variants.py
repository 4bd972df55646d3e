"""Phantoms and probes a little different: an entry of the catalog, with values replaced one by one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from tsis.model.catalog import load_phantom, load_probe
from tsis.model.phantom import Inclusion, Phantom

if TYPE_CHECKING:
    from tsis.model.probe import Probe


def phantom_variant(name: str, diameter_mm: float | None, depth_mm: float | None, young_kpa: float | None) -> Phantom:
    """The catalog's phantom with the given values of its inclusion replaced."""
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
    # A changed phantom is no longer the catalog's, so it may not carry the catalog's name alone.
    return replace(phantom, name=f"{name} (changed)", inclusion=inclusion)


def probe_variant(name: str, half_angle_deg: float | None, height_mm: float | None, aim_deg: float | None) -> Probe:
    """The catalog's probe with the given values of all its lamps replaced."""
    probe = load_probe(name)
    changes = {"half_angle_deg": half_angle_deg, "height_mm": height_mm, "aim_deg": aim_deg}
    given: dict[str, Any] = {what: value for what, value in changes.items() if value is not None}
    if not given:
        return probe
    leds = tuple(replace(led, **given) for led in probe.leds)
    return replace(probe, name=f"{name} (lamps changed)", leds=leds)
