"""The phantoms against the dissertation: values typed from its text, sections 4.1, 6.2 and 6.3 and table 6.2."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tsis.catalog.phantoms import list_phantoms, load_phantom, phantom_variant
from tsis.catalog.probes import list_probes, load_probe, probe_variant
from tsis.errors import InputError, UnknownNameError

# name: (diameter d in mm, depth h in mm, Young's modulus E in kPa)
TABLE_6_2 = {
    "calibration-1": (2, 5, 120),
    "calibration-2": (8, 5, 120),
    "calibration-3": (13, 5, 120),
    "calibration-4": (7, 4, 100),
    "calibration-5": (7, 8, 100),
    "calibration-6": (7, 12, 100),
    "calibration-7": (10, 5, 40),
    "calibration-8": (10, 5, 70),
    "calibration-9": (10, 5, 100),
}
SECTION_6_2 = {
    "size-2": (2, 5, 120),
    "size-8": (8, 5, 120),
    "size-14": (14, 5, 120),
    "depth-4": (7, 4, 100),
    "depth-8": (7, 8, 100),
    "depth-12": (7, 12, 100),
    "hardness-40": (10, 5, 40),
    "hardness-70": (10, 5, 70),
    "hardness-100": (10, 5, 100),
}


@pytest.mark.parametrize(("name", "printed"), [*TABLE_6_2.items(), *SECTION_6_2.items()])
def test_inclusions_are_those_printed(name: str, printed: tuple[float, float, float]) -> None:
    phantom = load_phantom(name)
    assert phantom.inclusion is not None
    found = (phantom.inclusion.diameter_mm, phantom.inclusion.depth_mm, phantom.inclusion.young_kpa)
    assert found == printed
    assert phantom.inclusion.is_axisymmetric
    assert (phantom.young_kpa, phantom.poisson) == (5.0, 0.49)
    assert phantom.assumed == ("thickness_mm",)


def test_the_sensitivity_study_has_eight_inclusions_and_a_blank() -> None:
    sites = [load_phantom(f"detection-{number}") for number in range(1, 9)]
    assert all(site.inclusion is not None and "inclusion" in site.assumed for site in sites)
    assert len({site.inclusion for site in sites}) == 8
    assert load_phantom("detection-blank").inclusion is None


def test_the_realistic_phantom_of_section_4_has_its_printed_diameter_and_admits_the_rest() -> None:
    phantom = load_phantom("mammacare-2")
    assert phantom.inclusion is not None
    assert phantom.inclusion.diameter_mm == 2.0
    assert {"inclusion.depth_mm", "inclusion.young_kpa", "young_kpa"} <= set(phantom.assumed)


def test_every_name_loads_under_its_own_name() -> None:
    for name in list_probes():
        assert load_probe(name).name == name
    for name in list_phantoms():
        assert load_phantom(name).name == name


def test_plain_tissue_is_a_phantom_without_inclusion() -> None:
    assert load_phantom("size-8").without_inclusion().inclusion is None
    assert load_phantom("plain").inclusion is None


def test_a_wrong_name_suggests_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="no phantom is called 'hardness-41'; did you mean 'hardness-40'"):
        load_phantom("hardness-41")
    with pytest.raises(UnknownNameError, match="no probe is called 'tsis-2012'; did you mean 'tsis-2011'"):
        load_probe("tsis-2012")


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


def test_unknown_names_and_impossible_values_are_refused() -> None:
    with pytest.raises(UnknownNameError, match="size-9"):
        phantom_variant("size-9", None, None, None)
    with pytest.raises(InputError, match="half_angle_deg must lie in"):
        probe_variant("tsis-2011", 95.0, None, None)
