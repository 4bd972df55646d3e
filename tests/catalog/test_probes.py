"""Probes of the dissertation; written as entries of a catalog they are read back as they were."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.catalog.probes import list_probes, load_probe, parse_probe, probe_toml, probe_variant
from tsis.model.probe import Glass, Layer, Led, Probe

number = st.floats(min_value=1.0, max_value=4.0)
layers = st.builds(Layer, thickness_mm=number, young_kpa=number, poisson=st.floats(0, 0.495), refractive_index=number)
leds = st.builds(
    Led,
    azimuth_deg=st.floats(-360, 360),
    height_mm=st.none() | st.floats(0, 1),
    aim_deg=st.floats(-80, 80),
    half_angle_deg=st.floats(1, 85),
    power=st.floats(0.1, 10),
)
probes = st.builds(
    Probe,
    radius_mm=number,
    layers=st.lists(layers, min_size=1, max_size=5).map(tuple),
    face_curvature_mm=st.none() | st.floats(50, 1e6),
    sides=st.sampled_from(["free", "bonded"]),
    glass=st.builds(Glass, thickness_mm=number, refractive_index=number),
    leds=st.lists(leds, min_size=1, max_size=6).map(tuple),
    name=st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=20),
    assumed=st.lists(st.sampled_from(["radius_mm", "leds"]), max_size=2).map(tuple),
)


def read(text: str) -> Probe:
    ((name, entry),) = tomllib.loads(text).items()
    return parse_probe(name, entry)


@given(probes)
def test_a_written_probe_is_the_probe(probe: Probe) -> None:
    assert read(probe_toml(probe)) == probe


@pytest.mark.parametrize("name", list_probes())
def test_the_catalog_reads_its_own_probes_back(name: str) -> None:
    assert read(probe_toml(load_probe(name))) == load_probe(name)


def test_a_probe_without_a_name_gets_one() -> None:
    assert read(probe_toml(replace(load_probe("tsis-2011"), name=""))).name == "probe"


def test_all_lamps_change_together() -> None:
    start, changed = load_probe("tsis-2011"), probe_variant("tsis-2011", 30.0, 11.5, -5.0)
    assert len(changed.leds) == len(start.leds) > 0
    assert {(led.half_angle_deg, led.height_mm, led.aim_deg) for led in changed.leds} == {(30.0, 11.5, -5.0)}
    assert changed.name == "tsis-2011 (lamps changed)"
    assert replace(changed, name=start.name, leds=start.leds) == start


def test_the_probe_has_the_three_layers_of_section_4_1() -> None:
    probe = load_probe()
    assert probe.name == "tsis-2011"
    assert [layer.thickness_mm for layer in probe.layers] == [2.0, 3.0, 5.0]
    stiffness = [layer.young_kpa for layer in probe.layers]
    assert stiffness == sorted(stiffness, reverse=True), "the hardest layer faces the tissue"
    assert {"radius_mm", "layers.young_kpa"} <= set(probe.assumed)
