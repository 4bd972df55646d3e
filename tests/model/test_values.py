"""Probe with its light, phantom, inclusion and calibration: what they refuse, and that they cannot be changed."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tsis
from tsis.errors import InputError
from tsis.model.calibration import Calibration
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.probe import FOUR_LEDS, Glass, Layer, Led, Probe

LUMP = Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0)
TISSUE = Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=LUMP)
LAYER = Layer(thickness_mm=10.0, young_kpa=50.0)
PROBE = Probe(radius_mm=12.0, layers=(LAYER,))
CALIBRATION = Calibration(gain_grey_per_kpa=10.0, saturation_kpa=50.0)


@pytest.mark.parametrize(
    ("value", "changes", "phrase"),
    [
        (LUMP, {"diameter_mm": 0.0}, r"diameter_mm must lie in \[0.1, 100\]; got 0"),
        (LUMP, {"depth_mm": -1.0}, "depth_mm must lie in"),
        (LUMP, {"young_kpa": 0.0}, "young_kpa must lie in"),
        (LUMP, {"poisson": 0.5}, "poisson must lie in"),
        (LUMP, {"offset_mm": (1.0,)}, r"offset_mm must hold two numbers"),
        (LUMP, {"offset_mm": (1.0, np.nan)}, "offset_mm must be finite"),
        (LUMP, {"semi_axes_mm": (1.0, 2.0)}, "semi_axes_mm must hold three positive numbers"),
        (LUMP, {"semi_axes_mm": (1.0, 2.0, -3.0)}, "semi_axes_mm must hold three positive numbers"),
        (TISSUE, {"young_kpa": np.nan}, "young_kpa must lie in"),
        (TISSUE, {"thickness_mm": 1.0}, "thickness_mm must lie in"),
        (TISSUE, {"thickness_mm": 15.0}, "depth_mm [+] diameter_mm must be less than thickness_mm = 15; got 15"),
        (TISSUE, {"inclusion": "lump"}, "inclusion must be an Inclusion or None"),
        (LAYER, {"thickness_mm": 0.0}, "thickness_mm must lie in"),
        (LAYER, {"refractive_index": 0.9}, "refractive_index must lie in"),
        (PROBE, {"radius_mm": 0.5}, "radius_mm must lie in"),
        (PROBE, {"layers": ()}, "layers must be a tuple of at least one Layer"),
        (PROBE, {"layers": (1.0,)}, "layers must be a tuple of at least one Layer"),
        (CALIBRATION, {"gain_grey_per_kpa": 0.0}, "gain_grey_per_kpa must lie in"),
        (CALIBRATION, {"force_sd": 1.5}, r"force_sd must lie in \[0, 1\]; got 1.5 \(a fraction\)"),
    ],
)
def test_what_each_value_refuses(value: Any, changes: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError, match=phrase):
        replace(value, **changes)


@pytest.mark.parametrize("value", [LUMP, TISSUE, LAYER, PROBE, CALIBRATION])
def test_values_are_frozen_and_equal_by_content(value: Any) -> None:
    with pytest.raises(FrozenInstanceError):
        setattr(value, fields(value)[0].name, 1.0)
    assert replace(value) == value
    assert hash(replace(value)) == hash(value)


@given(diameter=st.floats(0.1, 100.0), depth=st.floats(0.2, 200.0), thickness=st.floats(2.0, 500.0))
def test_an_inclusion_is_accepted_exactly_when_it_fits(diameter: float, depth: float, thickness: float) -> None:
    lump = Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=100.0)
    if depth + diameter < thickness:
        assert Phantom(young_kpa=5.0, thickness_mm=thickness, inclusion=lump).inclusion is lump
    else:
        with pytest.raises(InputError, match="must be less than thickness_mm"):
            Phantom(young_kpa=5.0, thickness_mm=thickness, inclusion=lump)


def test_what_turns_around_the_axis_is_axisymmetric() -> None:
    assert LUMP.is_axisymmetric
    assert replace(LUMP, semi_axes_mm=(5.0, 5.0, 3.0)).is_axisymmetric
    assert not replace(LUMP, offset_mm=(1.0, 0.0)).is_axisymmetric
    assert not replace(LUMP, semi_axes_mm=(5.0, 4.0, 3.0)).is_axisymmetric


def test_an_ellipsoid_reaches_as_deep_as_its_vertical_axis() -> None:
    lens = Inclusion(diameter_mm=8.0, depth_mm=5.0, young_kpa=100.0, semi_axes_mm=(6.0, 6.0, 2.0))
    assert (lens.centre_depth_mm, lens.bottom_mm) == (7.0, 9.0)
    with pytest.raises(InputError, match="must be less than thickness_mm = 9; got 9"):
        Phantom(young_kpa=5.0, thickness_mm=9.0, inclusion=lens)


def test_two_inclusions_may_not_meet() -> None:
    left = Inclusion(diameter_mm=6.0, depth_mm=5.0, young_kpa=100.0, offset_mm=(-4.0, 0.0))
    right = replace(left, offset_mm=(4.0, 0.0))
    pair = Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=left, more_inclusions=(right,))
    assert pair.inclusions == (left, right)
    assert pair.without_inclusion().inclusions == ()
    with pytest.raises(InputError, match="centres at least 6 mm apart; got 5"):
        replace(pair, more_inclusions=(replace(left, offset_mm=(1.0, 0.0)),))
    with pytest.raises(InputError, match="give the first as inclusion"):
        replace(pair, inclusion=None)


@given(radius=st.floats(1.0, 100.0), share=st.floats(1.0, 1e3), at=st.floats(0.0, 1.0))
def test_a_dome_is_a_piece_of_a_sphere(radius: float, share: float, at: float) -> None:
    layer = replace(LAYER, thickness_mm=200.0)
    probe = Probe(radius_mm=radius, layers=(layer,), face_curvature_mm=share * radius)
    height = share * radius - probe.sag_mm(at * radius)
    assert np.hypot(height, at * radius) == pytest.approx(share * radius, rel=1e-12)


def test_a_dome_leaves_something_at_the_rim() -> None:
    with pytest.raises(InputError, match="must leave 10% of the layers' 2 mm at the rim; got 20"):
        Probe(radius_mm=12.0, layers=(replace(LAYER, thickness_mm=2.0),), face_curvature_mm=20.0)
    with pytest.raises(InputError, match=r"face_curvature_mm must lie in \[12,"):
        replace(PROBE, face_curvature_mm=1.0)
    with pytest.raises(InputError, match="sides must be 'free' or 'bonded'; got 'glued'"):
        replace(PROBE, sides="glued")  # type: ignore[arg-type]


def test_the_stack_is_as_thick_as_its_layers() -> None:
    assert replace(PROBE, layers=(LAYER, LAYER)).thickness_mm == 20.0


def test_the_intensity_is_one_half_at_the_half_angle() -> None:
    assert 0.8660254037844387 ** Led(half_angle_deg=30.0).exponent == pytest.approx(0.5, rel=1e-12)
    assert Led(half_angle_deg=60.0).exponent == pytest.approx(1.0, rel=1e-12)  # Lambert's cosine


def test_lamps_stand_at_the_middle_of_the_layers_when_no_height_is_given() -> None:
    probe = replace(tsis.load_probe("tsis-2011"), leds=FOUR_LEDS)
    assert [probe.led_height_mm(led) for led in probe.leds] == [5.0] * 4
    assert probe.led_height_mm(Led(height_mm=2.0)) == 2.0


def test_the_printed_indices_are_a_preset() -> None:
    probe = tsis.load_probe("tsis-2011-printed-indices")
    assert [layer.refractive_index for layer in probe.layers] == [1.16, 1.15, 1.14]
    assert probe.glass.refractive_index == 1.13


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"leds": ()}, "at least one with power above 0"),
        ({"leds": (Led(power=0.0),)}, "at least one with power above 0"),
        ({"leds": (Led(height_mm=13.5),)}, r"height_mm of a lamp must lie in \[0, 13\]; got 13.5"),
        ({"glass": None}, "glass must be a Glass"),
    ],
)
def test_a_probe_without_usable_light_is_refused(change: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        replace(tsis.load_probe("tsis-2011"), **change)


@pytest.mark.parametrize(
    ("make", "values"),
    [
        (Glass, {"thickness_mm": 0.0}),
        (Glass, {"refractive_index": 0.9}),
        (Led, {"half_angle_deg": 0.0}),
        (Led, {"aim_deg": 90.0}),
        (Led, {"power": float("nan")}),
    ],
)
def test_values_out_of_range_are_refused(make: type, values: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(values))):
        make(**values)
