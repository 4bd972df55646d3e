from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

import tsis
from tsis.errors import InputError
from tsis.model.probe import FOUR_LEDS, Glass, Led


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
