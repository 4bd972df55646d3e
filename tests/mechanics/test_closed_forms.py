"""Closed forms against values from independent computations, and against each other in their limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from tests.mechanics.closed_forms import (
    bonded_layer_ratio,
    hertz,
    oedometric_modulus_kpa,
    punch_pressure_kpa,
    punch_stiffness,
    sphere_in_uniaxial_stress,
)

from tsis.errors import InputError
from tsis.mechanics.closed_forms import effective_modulus_kpa, hertz_under_force
from tsis.model.probe import Layer

STACK = tuple(Layer(thickness_mm=t, young_kpa=e, poisson=0.49) for t, e in ((2.0, 140.0), (3.0, 80.0), (5.0, 34.0)))
POISSON = st.floats(0.0, 0.495)
HERTZ = {"radius_mm": 1.0, "force_mn": 1.0, "young_kpa": 5.0, "poisson": 0.3}


def test_effective_modulus_of_the_probe() -> None:
    assert effective_modulus_kpa(STACK) == pytest.approx(10 / (2 / 140 + 3 / 80 + 5 / 34), rel=1e-12)
    assert effective_modulus_kpa(STACK) == pytest.approx(50.2905, rel=1e-6)


@given(young=st.floats(1.0, 200.0), poisson=POISSON, cut=st.floats(0.1, 0.9))
def test_cutting_a_layer_in_two_does_not_change_the_modulus(young: float, poisson: float, cut: float) -> None:
    whole = [Layer(thickness_mm=10.0, young_kpa=young, poisson=poisson)]
    halves = [Layer(thickness_mm=10 * part, young_kpa=young, poisson=poisson) for part in (cut, 1 - cut)]
    assert effective_modulus_kpa(halves) == pytest.approx(effective_modulus_kpa(whole), rel=1e-12)


@given(poisson=POISSON)
def test_confined_modulus_is_bulk_plus_four_thirds_shear(poisson: float) -> None:
    bulk, shear = 5.0 / (3 * (1 - 2 * poisson)), 5.0 / (2 * (1 + poisson))
    found = oedometric_modulus_kpa(young_kpa=5.0, poisson=poisson)
    assert found == pytest.approx(bulk + 4 / 3 * shear, rel=1e-10)


@pytest.mark.parametrize(("poisson", "force", "peak"), [(0.3, 8.1907, 0.7822), (0.49, 9.8086, 0.9367)])
def test_hertz(poisson: float, force: float, peak: float) -> None:
    contact = hertz(radius_mm=10.0, indentation_mm=0.5, young_kpa=5.0, poisson=poisson)
    assert contact.force_mn == pytest.approx(force, rel=1e-4)
    assert contact.peak_pressure_kpa == pytest.approx(peak, rel=1e-4)
    assert contact.contact_radius_mm == pytest.approx(5**0.5)


@given(radius=st.floats(1.0, 100.0), depth=st.floats(0.001, 1.0), young=st.floats(0.1, 1e4), poisson=POISSON)
def test_hertz_by_the_force_is_hertz_by_the_indentation(
    radius: float, depth: float, young: float, poisson: float
) -> None:
    by_depth = hertz(radius_mm=radius, indentation_mm=depth, young_kpa=young, poisson=poisson)
    found = hertz_under_force(radius_mm=radius, force_mn=by_depth.force_mn, young_kpa=young, poisson=poisson)
    assert found.force_mn == by_depth.force_mn
    assert found.contact_radius_mm == pytest.approx(by_depth.contact_radius_mm, rel=1e-12)
    assert found.peak_pressure_kpa == pytest.approx(by_depth.peak_pressure_kpa, rel=1e-12)


def test_a_force_that_buries_the_sphere_still_has_its_paraboloid() -> None:
    contact = hertz_under_force(radius_mm=2.0, force_mn=5e4, young_kpa=50.0, poisson=0.49)
    assert contact.contact_radius_mm > 2.0
    carried, _ = quad(lambda r: 2 * np.pi * r * float(contact.pressure_kpa(r)), 0.0, contact.contact_radius_mm)
    assert carried == pytest.approx(5e4, rel=1e-6)
    for wrong in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="force_mn"):
            hertz_under_force(radius_mm=2.0, force_mn=wrong, young_kpa=50.0, poisson=0.49)


@given(radius=st.floats(1.0, 100.0), depth=st.floats(0.001, 1.0), poisson=POISSON)
def test_pressures_add_up_to_the_force(radius: float, depth: float, poisson: float) -> None:
    contact = hertz(radius_mm=radius, indentation_mm=depth, young_kpa=5.0, poisson=poisson)
    edge = contact.contact_radius_mm
    # With r = a sin(t) neither integrand is singular at the edge.
    total, _ = quad(
        lambda t: 2 * np.pi * edge**2 * np.sin(t) * np.cos(t) * contact.pressure_kpa(edge * np.sin(t)), 0, np.pi / 2
    )
    assert total == pytest.approx(contact.force_mn, rel=1e-7)
    assert contact.pressure_kpa([0.0, 1.01 * edge]).tolist() == [contact.peak_pressure_kpa, 0.0]
    share, _ = quad(
        lambda t: (
            2
            * np.pi
            * edge**2
            * np.sin(t)
            * np.cos(t)
            * punch_pressure_kpa(edge * np.sin(t), punch_radius_mm=edge, force_mn=7.0)
        ),
        0,
        np.pi / 2 - 1e-9,
    )
    assert share == pytest.approx(7.0, rel=1e-6)


def test_punch_pressure_ends_at_the_edge() -> None:
    pressure = punch_pressure_kpa([0.0, 11.999, 12.0, 13.0], punch_radius_mm=12.0, force_mn=1000.0)
    mean = 1000.0 / (np.pi * 144.0)
    assert pressure[0] == pytest.approx(mean / 2)
    assert pressure[1] > 10 * mean
    assert pressure[2:].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("share", "ratio"), [(0.01, 1.0112), (0.2, 1.2741), (0.4, 1.6638), (1.0, 3.4840), (2.0, 8.337)]
)
def test_bonded_layer(share: float, ratio: float) -> None:
    assert bonded_layer_ratio(share, poisson=0.49) == pytest.approx(ratio, rel=5e-5)


@given(poisson=POISSON)
def test_a_thick_layer_is_a_half_space(poisson: float) -> None:
    assert bonded_layer_ratio(0.0, poisson=poisson) == pytest.approx(1.0, abs=1e-12)
    assert 1.0 < bonded_layer_ratio(1e-3, poisson=poisson) < 1.002


@pytest.mark.parametrize("poisson", [0.0, 0.3])
def test_a_thin_layer_is_confined(poisson: float) -> None:
    """As a / H grows the stiffness tends to that of confined compression, M pi a**2 / H."""
    share = 20.0
    confined = np.pi * share * oedometric_modulus_kpa(young_kpa=1.0, poisson=poisson) / 2
    punch = punch_stiffness(radius_mm=1.0, young_kpa=1.0, poisson=poisson) / 2
    ratio = bonded_layer_ratio(share, poisson=poisson) * punch / confined
    halved = bonded_layer_ratio(share / 2, poisson=poisson) * punch / (confined / 2)
    # What the rim adds falls as H / a.
    assert ratio == pytest.approx(1.0, abs=0.06)
    assert 2 * ratio - halved == pytest.approx(1.0, abs=0.003)


@pytest.mark.parametrize(
    ("contrast", "poisson", "stress", "strain"),
    [(20.0, 0.49, 1.87451, 0.11453), (8.0, 0.49, 1.73126, 0.25976), (20.0, 0.3, 1.84940, None)],
)
def test_sphere_in_stress(contrast: float, poisson: float, stress: float, strain: float | None) -> None:
    stress_ratio, strain_ratio = sphere_in_uniaxial_stress(contrast=contrast, poisson=poisson)
    assert stress_ratio == pytest.approx(stress, rel=1e-5)
    if strain is not None:
        assert strain_ratio == pytest.approx(strain, rel=5e-5)


@given(poisson=POISSON)
def test_a_sphere_of_the_same_material_is_not_there_and_a_hole_carries_nothing(poisson: float) -> None:
    same = sphere_in_uniaxial_stress(contrast=1.0, poisson=poisson)
    assert same == pytest.approx((1.0, 1.0), rel=1e-9)
    stress_ratio, strain_ratio = sphere_in_uniaxial_stress(contrast=0.0, poisson=poisson)
    assert stress_ratio == 0.0
    assert strain_ratio > 1.5


def test_the_sphere_may_have_its_own_poisson_ratio() -> None:
    stress_ratio, _ = sphere_in_uniaxial_stress(contrast=1.0, poisson=0.49, sphere_poisson=0.2)
    assert stress_ratio != pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(
    ("call", "given", "phrase"),
    [
        (effective_modulus_kpa, {"layers": ()}, "layers must contain at least one Layer; got ()"),
        (effective_modulus_kpa, {"layers": [5.0]}, "layers must contain at least one Layer; got [5.0]"),
        (hertz_under_force, HERTZ | {"radius_mm": float("nan")}, "radius_mm must lie in"),
        (hertz_under_force, HERTZ | {"force_mn": -1.0}, "force_mn must lie in [1e-12, 1e+12]; got -1"),
        (hertz_under_force, HERTZ | {"young_kpa": -1.0}, "young_kpa must lie in"),
        (hertz_under_force, HERTZ | {"poisson": 0.5}, "poisson must lie in [0, 0.4999]"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(call: Any, given: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError) as refused:
        call(**given)
    assert phrase in str(refused.value)
    assert "\n" not in str(refused.value)
