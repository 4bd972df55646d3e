"""Bench tests of a modulus beside published corrections, the axisymmetric press and Gent and Lindley's cylinder."""

from __future__ import annotations

import numpy as np
import pytest

from tsis.errors import InputError
from tsis.mechanics import indentation_modulus
from tsis.mechanics.bench_tests import bonded_factor, compression_modulus
from tsis.mechanics.small_strain.rigid_ball import indent
from tsis.model.probe import Layer, Probe

DEPTH = np.linspace(0.05, 0.5, 12)


def test_a_thin_pad_follows_the_published_correction() -> None:
    """Of Dimitriadis and others (2002): their polynomial for a bonded incompressible layer."""
    radius, thickness, young = 3.0, 5.0, 8.0
    chi = np.sqrt(radius * DEPTH) / thickness
    correction = 1 + 1.133 * chi + 1.283 * chi**2 + 0.769 * chi**3 + 0.0975 * chi**4
    force = 16 / 9 * young * np.sqrt(radius) * DEPTH**1.5 * correction
    found = indentation_modulus(DEPTH + 0.3, force, radius_mm=radius, thickness_mm=thickness, poisson=0.4999)
    assert found.young_kpa == pytest.approx(young, rel=0.03)  # Hertz's would be 1.3 times as large
    assert found.contact_mm == pytest.approx(0.3, abs=0.01)


@pytest.mark.slow
def test_a_pad_of_finite_elements_gives_its_modulus_back() -> None:
    pad = Probe(radius_mm=30.0, layers=(Layer(thickness_mm=8.0, young_kpa=15.0, poisson=0.48),))
    presses = [indent(pad, sphere_radius_mm=5.0, force_n=force) for force in np.linspace(0.01, 0.08, 7)]
    travel = np.array([press.depth_mm for press in presses])
    force = np.linspace(10.0, 80.0, 7)
    found = indentation_modulus(travel, force, radius_mm=5.0, thickness_mm=8.0, poisson=0.48)
    assert found.young_kpa == pytest.approx(15.0, rel=0.02)


@pytest.mark.parametrize(("diameter", "height"), [(40.0, 4.0), (20.0, 10.0)])
def test_a_flat_held_cylinder_is_near_gent_and_lindley(diameter: float, height: float) -> None:
    shape = diameter / (4 * height)
    assert bonded_factor(diameter, height, 0.4999) == pytest.approx(1 + 2 * shape**2, rel=0.04)


def test_a_held_cylinder_has_the_right_limits() -> None:
    assert bonded_factor(10.0, 8.0, 0.0) == pytest.approx(1.0, rel=1e-9)
    assert bonded_factor(10.0, 150.0, 0.45) == pytest.approx(1.0, abs=0.02)
    wide = (1 - 0.3) / ((1 + 0.3) * (1 - 0.6))  # no strain sideways
    assert bonded_factor(200.0, 4.0, 0.3) == pytest.approx(wide, rel=0.02)


def test_compression_gives_its_modulus_back_with_an_honest_error() -> None:
    rng, errors, sds = np.random.default_rng(5), [], []
    shortening = np.linspace(0.1, 1.0, 15)
    force = 20.0 * bonded_factor(20.0, 15.0, 0.49) * np.pi * 100 / 15.0 * shortening
    for _ in range(200):
        noisy = force + 4.0 * rng.standard_normal(15)
        found = compression_modulus(shortening + 0.4, noisy, diameter_mm=20.0, height_mm=15.0)
        errors.append(found.young_kpa - 20.0)
        sds.append(found.sd_kpa)
    assert abs(np.mean(errors)) < 4 * np.std(errors) / np.sqrt(200)
    assert np.std(errors) == pytest.approx(np.sqrt(np.mean(np.square(sds))), rel=0.15)


def test_bad_points_are_refused() -> None:
    with pytest.raises(InputError, match="must be of one length, at least 5; got 3 and 3"):
        compression_modulus([0.1, 0.2, 0.3], [1.0, 2.0, 3.0], diameter_mm=20.0, height_mm=10.0)
    with pytest.raises(InputError, match="force_mn must be positive"):
        indentation_modulus(DEPTH, DEPTH - 0.1, radius_mm=5.0, thickness_mm=10.0)
    with pytest.raises(InputError, match="shortening_mm over height_mm must lie in"):
        compression_modulus(10 * DEPTH, DEPTH, diameter_mm=20.0, height_mm=10.0)
