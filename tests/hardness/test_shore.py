"""Shore readings: published pairs, inverses and the ends of the scales."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import InputError
from tsis.hardness.shore import shore, young_of_shore_00, young_of_shore_a


@pytest.mark.parametrize(("reading", "megapascals"), [(30.0, 1.15), (50.0, 2.46), (70.0, 5.54)])
def test_shore_a_follows_gent(reading: float, megapascals: float) -> None:
    # Values of Gent's relation as they are tabulated for rubber.
    assert young_of_shore_a(reading) / 1e3 == pytest.approx(megapascals, rel=0.02)


@given(st.floats(11.0, 89.0))
def test_readings_come_back(reading: float) -> None:
    assert shore(young_of_shore_00(reading)).shore_00 == pytest.approx(reading, abs=1e-6)
    assert shore(young_of_shore_a(reading)).shore_a == pytest.approx(reading, abs=1e-6)


def test_the_00_relation_is_hertz_with_the_durometers_spring() -> None:
    reading, young = 60.0, young_of_shore_00(60.0)
    depth = 2.5 * 0.4
    force = 4 / 3 * young * 1e-3 / 0.75 * 1.19**0.5 * depth**1.5
    assert force == pytest.approx(0.203 + 0.00908 * reading, rel=1e-9)


def test_outside_the_scales_nothing_is_said() -> None:
    assert shore(10.0).shore_00 is None
    assert shore(1e5).shore_00 is None
    assert shore(103.0).shore_a is None
    assert "Gent" in shore(103.0).source


def test_a_modulus_must_be_positive() -> None:
    with pytest.raises(InputError, match="young_kpa must lie in"):
        shore(0.0)
