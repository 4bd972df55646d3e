"""A body on a bonded gel layer: against Hertz, another code's flat punch, and the finite elements of this package."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import InputError
from tsis.mechanics.gel.contact import layer_compliance, layer_contact
from tsis.mechanics.small_strain.rigid_ball import indent
from tsis.model.probe import Layer, Probe


@pytest.mark.parametrize(("ratio", "stiffer"), [(0.2, 1.2741), (0.4, 1.6638), (1.0, 3.4840), (2.0, 8.337)])
def test_a_flat_punch_is_as_stiff_as_another_code_finds(ratio: float, stiffer: float) -> None:
    """Values of a finite-element code for nu = 0.49; here Chebyshev pressures with the kernel alone."""
    orders = np.arange(6)
    node, weight = np.polynomial.legendre.leggauss(400)
    wave, weight = 30 * ratio * (node + 1), 30 * ratio * weight
    places = np.sqrt((np.arange(30) + 0.5) / 30)
    # pressure (1 - r²)^(m - 1/2); the half-space's part is exact, the backing's an integral over wave numbers
    power = orders - 0.5
    gamma = scipy.special.gamma
    half = np.stack(
        [
            np.sqrt(np.pi) * gamma(p + 1) / gamma(p + 1.5) * scipy.special.hyp2f1(0.5, -m, 1, places**2)
            for m, p in zip(orders, power, strict=True)
        ],
        axis=1,
    )
    transform = np.stack(
        [2.0**p * gamma(p + 1) * scipy.special.jv(p + 1, wave) / wave ** (p + 1) for p in power], axis=1
    )
    layer = layer_compliance(wave, young_kpa=1.0, poisson=0.49, thickness_mm=1 / ratio)
    missing = 1 - layer.normal * wave / (2 * (1 - 0.49**2))
    taken = 2 * scipy.special.j0(places[:, None] * wave) @ (weight[:, None] * missing[:, None] * transform)
    pressure = np.linalg.lstsq(half - taken, np.ones(len(places)), rcond=None)[0]
    force = np.pi * (pressure / (power + 1)).sum()
    assert force / 2 == pytest.approx(stiffer, rel=5e-3)  # over 2 E* a


@pytest.mark.parametrize(
    ("thickness", "radius", "force_n", "poisson"), [(5.0, 5.0, 0.5, 0.49), (2.0, 8.0, 1.0, 0.48), (8.0, 4.0, 0.3, 0.45)]
)
def test_a_rigid_sphere_is_that_of_the_finite_elements(
    thickness: float, radius: float, force_n: float, poisson: float
) -> None:
    probe = Probe(radius_mm=20.0, layers=(Layer(thickness_mm=thickness, young_kpa=150.0, poisson=poisson),))
    solved = indent(probe, sphere_radius_mm=radius, force_n=force_n)
    contact = layer_contact(
        solved.contact_radius_mm,
        radius_mm=radius,
        body_compliance=0.0,
        gel_compliance=(1 - poisson**2) / 150.0,
        thickness_mm=thickness,
        poisson=poisson,
    )
    assert float(contact.force) == pytest.approx(1e3 * force_n, rel=1e-3)
    assert float(contact.dent_mm) == pytest.approx(solved.face_displacement_mm[0], rel=3e-3)


@given(st.floats(0.05, 2.0), st.floats(0.0, 0.05), st.floats(0.001, 0.05))
def test_a_thick_gel_is_hertz(contact_mm: float, soft: float, gel: float) -> None:
    def found(body: Any) -> float:
        return float(
            layer_contact(
                contact_mm,
                body=body,
                radius_mm=7.0,
                body_compliance=soft,
                gel_compliance=gel,
                thickness_mm=2e4,
                poisson=0.4,
            ).force
        )

    assert found("sphere") == pytest.approx(4 / 3 * contact_mm**3 / 7.0 / (soft + gel), rel=1e-3)
    assert found("cylinder") == pytest.approx(np.pi * contact_mm**2 / (4 * 7.0 * (soft + gel)), rel=1e-3)


@pytest.mark.parametrize("body", ["sphere", "cylinder"])
def test_a_thin_gel_is_a_foundation(body: Any) -> None:
    """Where the layer is compressible and thin, pressure follows the gap: ``p = k (a² - r²) / (2 R)``."""
    poisson, thickness, young = 0.2, 0.02, 100.0
    stiffness = young * (1 - poisson) / ((1 + poisson) * (1 - 2 * poisson)) / thickness
    found = layer_contact(
        0.19,
        body=body,
        radius_mm=5.0,
        body_compliance=0.0,
        gel_compliance=(1 - poisson**2) / young,
        thickness_mm=thickness,
        poisson=poisson,
    )
    gap = stiffness * 0.19**2 / 10.0
    expected = gap * np.pi * 0.19**2 / 2 if body == "sphere" else gap * 4 / 3 * 0.19
    assert float(found.force) == pytest.approx(expected, rel=0.15)
    assert float(found.dent_mm) == pytest.approx(0.19**2 / 10.0, rel=0.1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"contact_radius_mm": -1.0}, "contact_radius_mm must lie in"),
        ({"contact_radius_mm": np.nan}, "contact_radius_mm must"),
        ({"radius_mm": 0.0}, "radius_mm must lie in"),
        ({"body_compliance": -0.1}, "body_compliance must lie in"),
        ({"thickness_mm": 0.01}, "contact_radius_mm over thickness_mm must lie in"),
        ({"poisson": 0.5}, "poisson must lie in"),
        ({"body": "cone"}, "body"),
    ],
)
def test_wrong_values_are_named(changes: dict[str, object], message: str) -> None:
    good: dict[str, object] = {
        "contact_radius_mm": 1.0,
        "radius_mm": 5.0,
        "body_compliance": 0.0,
        "gel_compliance": 0.01,
        "thickness_mm": 3.0,
        "poisson": 0.49,
    }
    with pytest.raises(InputError, match=message):
        layer_contact(**good | changes)  # type: ignore[arg-type]
