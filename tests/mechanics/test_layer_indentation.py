"""Rigid indenters on layers, against closed forms, fits of others and the contact of a paraboloid by other means."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tsis.mechanics.gel.contact import layer_contact
from tsis.mechanics.layer_indentation import indentation_curve


def force_at(depth: float, *arguments: Any, **options: Any) -> float:
    curve = indentation_curve(*arguments, **options)
    return float(np.exp(np.interp(np.log(depth), np.log(curve.depth[1:]), np.log(curve.force[1:]))))


@pytest.mark.parametrize("depth", [0.01, 0.1, 0.3, 0.5])
def test_a_ball_on_a_half_space_obeys_sneddons_solution(depth: float) -> None:
    contact = np.linspace(1e-4, 0.9, 20001)
    angle = np.log((1 + contact) / (1 - contact))
    depths = contact / 2 * angle
    forces = (contact**2 + 1) / 2 * angle - contact
    expected = np.interp(depth, depths, forces)
    assert force_at(depth, "ball", thickness=np.inf, poisson=0.3) == pytest.approx(expected, rel=1e-3)


def test_a_cone_and_a_punch_on_a_half_space_obey_sneddons_solutions() -> None:
    angle = np.radians(35.0)
    found = force_at(1e-3, "cone", thickness=1.0, poisson=0.4, half_angle_deg=35.0)
    assert found == pytest.approx(2 / np.pi * np.tan(angle) * 1e-6, rel=2e-2)
    assert force_at(0.2, "punch", thickness=np.inf, poisson=0.4) == pytest.approx(2 * 0.2, rel=1e-6)


@pytest.mark.parametrize("thickness", [2.0, 5.0, 20.0])
def test_a_small_contact_on_a_bonded_layer_is_that_of_the_pressure_series(thickness: float) -> None:
    ratio = np.geomspace(0.03, 0.2, 5)
    other = layer_contact(
        ratio, radius_mm=1.0, body_compliance=0.0, gel_compliance=1.0, thickness_mm=thickness, poisson=0.49
    )
    found = [force_at(float(d), "ball", thickness=thickness, poisson=0.49) for d in other.dent_mm]
    assert found == pytest.approx(other.force.tolist(), rel=0.01)


def test_bonded_layers_are_as_stiff_as_dimitriadis_fitted() -> None:
    thickness, depth = 2.0, 0.04
    ratio = np.sqrt(depth) / thickness
    factor = 1 + 1.133 * ratio + 1.283 * ratio**2 + 0.769 * ratio**3 + 0.0975 * ratio**4
    hertz = 4 / 3 * depth**1.5
    assert force_at(depth, "ball", thickness=thickness, poisson=0.4999) == pytest.approx(factor * hertz, rel=0.01)


@pytest.mark.parametrize("poisson", [0.1, 0.49])
def test_a_sliding_layer_under_a_small_punch_has_the_coefficient_of_lebedev_and_ufliand(poisson: float) -> None:
    stiffened = force_at(1.0, "punch", thickness=200.0, poisson=poisson, base="sliding") / 2 - 1
    assert stiffened * 200 * np.pi / 2 == pytest.approx(1.168, rel=0.005)


def test_a_thin_sliding_layer_under_a_punch_is_compressed_uniaxially_in_the_middle() -> None:
    thin = indentation_curve("punch", thickness=0.06, poisson=0.3, base="sliding")
    # Uniform compression without friction: F = E* pi a² depth / t, plus what the edge adds.
    assert 1.0 < thin.force[-1] / (np.pi * thin.depth[-1] / 0.06) < 1.05


def test_a_bonded_layer_is_stiffer_than_a_sliding_one_and_both_than_a_half_space() -> None:
    forces = [
        force_at(0.1, "ball", thickness=thickness, poisson=0.45, base=base)
        for thickness, base in ((np.inf, "bonded"), (3.0, "sliding"), (3.0, "bonded"))
    ]
    assert forces == sorted(forces)
