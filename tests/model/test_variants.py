"""A changed entry of the catalog differs in what was given and in its name, and in nothing else."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tsis.catalog.phantoms import list_phantoms, load_phantom, phantom_variant
from tsis.catalog.probes import load_probe, probe_variant
from tsis.errors import InputError, UnknownNameError


def test_what_is_not_changed_is_the_catalogs() -> None:
    for name in list_phantoms():
        assert phantom_variant(name, None, None, None) == load_phantom(name)
    assert probe_variant("tsis-domed", None, None, None) == load_probe("tsis-domed")


@pytest.mark.parametrize("field", ["diameter_mm", "depth_mm", "young_kpa"])
def test_one_value_of_the_inclusion_changes_alone(field: str) -> None:
    start, values = load_phantom("size-8"), {"diameter_mm": 6.5, "depth_mm": 4.5, "young_kpa": 77.0}
    changed = phantom_variant("size-8", **{name: value if name == field else None for name, value in values.items()})
    assert start.inclusion is not None
    assert changed.inclusion is not None
    for name, value in values.items():
        assert getattr(changed.inclusion, name) == (value if name == field else getattr(start.inclusion, name))
    assert changed.name == "size-8 (changed)"
    assert replace(changed, name=start.name, inclusion=start.inclusion) == start


def test_all_lamps_change_together() -> None:
    start, changed = load_probe("tsis-2011"), probe_variant("tsis-2011", 30.0, 11.5, -5.0)
    assert len(changed.leds) == len(start.leds) > 0
    assert {(led.half_angle_deg, led.height_mm, led.aim_deg) for led in changed.leds} == {(30.0, 11.5, -5.0)}
    assert changed.name == "tsis-2011 (lamps changed)"
    assert replace(changed, name=start.name, leds=start.leds) == start


def test_unknown_names_and_impossible_values_are_refused() -> None:
    with pytest.raises(UnknownNameError, match="size-9"):
        phantom_variant("size-9", None, None, None)
    with pytest.raises(InputError, match="half_angle_deg must lie in"):
        probe_variant("tsis-2011", 95.0, None, None)
