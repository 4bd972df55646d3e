"""Rays at interfaces: conservation of power, continuous fields, angles of acceptance, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.catalog.probes import load_probe
from tsis.errors import InputError
from tsis.model.probe import Layer, Led, Probe
from tsis.optics import angles as inputs
from tsis.optics.angles import acceptance, critical_angle_deg, fresnel, layer_facing_lamp, refraction_deg

INDEX, ANGLE = st.floats(1.0, 2.5), st.floats(0.0, 89.9)
PRINTED = [1.16, 1.15, 1.14, 1.13]


@given(angle=ANGLE, one=INDEX, other=INDEX)
def test_what_is_not_reflected_passes(angle: float, one: float, other: float) -> None:
    found = fresnel(angle, index_from=one, index_to=other)
    assert float(found.reflected_s + found.transmitted_s) == pytest.approx(1, abs=1e-12)
    assert float(found.reflected_p + found.transmitted_p) == pytest.approx(1, abs=1e-12)


@given(angle=ANGLE, one=INDEX, other=INDEX)
def test_the_field_along_the_interface_is_continuous(angle: float, one: float, other: float) -> None:
    found = fresnel(angle, index_from=one, index_to=other)
    before = np.cos(np.radians(angle))
    behind = np.sqrt(1 - (one / other * np.sin(np.radians(angle))) ** 2 + 0j)
    assert complex(1 + found.r_s) == pytest.approx(complex(found.t_s), abs=1e-9)
    assert complex((1 - found.r_p) * before) == pytest.approx(complex(found.t_p * behind), abs=1e-6)
    assert complex((1 + found.r_p) * one) == pytest.approx(complex(found.t_p * other), abs=1e-9)


@given(angle=st.floats(0.0, 80.0), one=INDEX, other=INDEX)
def test_stokes_a_ray_run_backwards(angle: float, one: float, other: float) -> None:
    behind = float(refraction_deg(angle, index_from=one, index_to=other))
    if not behind < 89.0:
        return
    there, back = fresnel(angle, index_from=one, index_to=other), fresnel(behind, index_from=other, index_to=one)
    for r, t, r_back, t_back in (
        (there.r_s, there.t_s, back.r_s, back.t_s),
        (there.r_p, there.t_p, back.r_p, back.t_p),
    ):
        assert complex(r_back) == pytest.approx(-complex(r), abs=1e-9)
        assert complex(t * t_back) == pytest.approx(1 - complex(r) ** 2, abs=1e-9)


def test_brewster_and_normal_incidence() -> None:
    brewster = np.degrees(np.arctan(1.515 / 1.41))
    assert float(fresnel(brewster, index_from=1.41, index_to=1.515).reflected_p) < 1e-30
    normal = fresnel(0.0, index_from=1.0, index_to=1.41)
    assert float(normal.reflected_s) == pytest.approx((0.41 / 2.41) ** 2, rel=1e-14)
    assert complex(normal.r_p) == pytest.approx(-complex(normal.r_s))


@pytest.mark.parametrize("index", [1.13, 1.41, 1.515])
def test_total_reflection_begins_at_the_critical_angle(index: float) -> None:
    critical = critical_angle_deg(index_from=index, index_to=1.0)
    assert critical == pytest.approx(np.degrees(np.arcsin(1 / index)), abs=1e-12)
    beyond = fresnel(np.linspace(critical + 1e-6, 89.99, 50), index_from=index, index_to=1.0)
    for r, share, through in (
        (beyond.r_s, beyond.reflected_s, beyond.transmitted_s),
        (beyond.r_p, beyond.reflected_p, beyond.transmitted_p),
    ):
        np.testing.assert_allclose(np.abs(r), 1.0, atol=1e-12)
        np.testing.assert_allclose(share, 1.0, atol=1e-12)
        np.testing.assert_array_equal(through, 0.0)
    assert np.isnan(refraction_deg(critical + 1e-6, index_from=index, index_to=1.0))
    assert float(refraction_deg(critical - 1e-6, index_from=index, index_to=1.0)) > 89.9
    assert critical_angle_deg(index_from=1.0, index_to=index) == 90.0


def test_the_phase_of_total_reflection() -> None:
    angle = np.radians(60.0)
    gamma = np.sqrt((1.5 * np.sin(angle)) ** 2 - 1)
    found = fresnel(60.0, index_from=1.5, index_to=1.0)
    assert abs(np.angle(found.r_s)) == pytest.approx(2 * np.arctan(gamma / (1.5 * np.cos(angle))), rel=1e-12)


def test_acceptance_of_the_printed_indices() -> None:
    found = acceptance(PRINTED)
    np.testing.assert_allclose(found.acceptance_deg, [36.01, 34.60, 33.19, 31.75], atol=0.005)
    assert not found.unlimited.any()
    assert found.blind_deg.tolist() == pytest.approx([0, 0, 0, 0]), "the index falls away from the face"


@given(index=st.floats(1.0, 1.4142))
def test_the_edge_of_acceptance_is_the_critical_ray(index: float) -> None:
    found = acceptance([index])
    inside = refraction_deg(found.acceptance_deg[0], index_from=1.0, index_to=index)
    assert 90 - float(inside) == pytest.approx(found.critical_deg[0], abs=2e-5)


def test_acceptance_of_real_silicone_and_glass_has_no_limit_to_speak_of() -> None:
    found = acceptance([1.397, 1.43, 1.515])
    assert found.acceptance_deg[0] == pytest.approx(77.3, abs=0.1)
    assert found.acceptance_deg[1:].tolist() == [90.0, 90.0]
    assert found.unlimited.tolist() == [False, True, True]


def test_light_in_the_glass_that_never_reaches_the_face() -> None:
    found = acceptance([1.41, 1.515])
    inside = refraction_deg(found.blind_deg[1], index_from=1.0, index_to=1.515)
    assert 90 - float(inside) == pytest.approx(critical_angle_deg(index_from=1.515, index_to=1.41), abs=1e-9)
    stays = 90 - critical_angle_deg(index_from=1.515, index_to=1.0)
    assert found.blind_fraction[1] == pytest.approx(float(inside) / stays)
    assert found.blind_deg[0] == found.blind_fraction[0] == 0.0
    one_thin_layer_bars_all_behind_it = acceptance([1.5, 1.3, 1.4])
    assert (one_thin_layer_bars_all_behind_it.blind_deg > 0).tolist() == [False, False, True]


def test_the_layer_that_a_lamp_faces() -> None:
    probe = load_probe("tsis-2011")
    assert [layer_facing_lamp(probe, Led(height_mm=height)) for height in (0.5, 3.0, 7.0, 11.0)] == [0, 1, 2, 3]
    single = Probe(radius_mm=12.0, layers=(Layer(thickness_mm=10.0, young_kpa=50.0),))
    assert layer_facing_lamp(single, Led()) == 0


@pytest.mark.parametrize("angle", [-1.0, 90.5, np.nan, [10.0, 95.0]])
def test_angles_out_of_range(angle: float) -> None:
    with pytest.raises(InputError, match="angle_deg"):
        fresnel(angle, index_from=1.0, index_to=1.5)


def test_bad_indices() -> None:
    with pytest.raises(InputError, match="index_to"):
        refraction_deg(10.0, index_from=1.0, index_to=0.5)
    with pytest.raises(InputError, match=r"index\[1\]"):
        acceptance([1.4, -1.4])
    with pytest.raises(InputError, match="index"):
        acceptance([1.4 + 0.1j])


@pytest.mark.parametrize(
    ("value", "cure"),
    [
        (550.0, "looks like nanometres; give 0.55"),
        (5.5e-7, "looks like metres; give 0.55"),
        (5.5e-4, "looks like millimetres; give 0.55"),
        (-0.55, "green light is 0.55"),
        (0.0, "green light is 0.55"),
    ],
)
def test_a_wavelength_in_another_unit_is_named(value: float, cure: str) -> None:
    with pytest.raises(InputError, match=cure):
        inputs.require_wavelength(value)


def test_a_wavelength_in_micrometres_passes() -> None:
    assert inputs.require_wavelength(0.55) == 0.55


@pytest.mark.parametrize(
    ("index", "thickness", "sentence"),
    [
        ([1.41 + 0.1j], [1.0], "index must be real"),
        ([-1.41], [1.0], r"index\[0\] must lie in \[1, 5\]; got -1.41"),
        ([1.41, 1.515], [1.0], "of one length; got 2 and 1"),
        ([1.41], [0.0], r"thickness_um\[0\] must lie in"),
        ([], [], "must not be empty"),
        ([float("nan")], [1.0], "must be finite"),
    ],
)
def test_a_stack_that_is_none_is_refused(index: list[complex], thickness: list[float], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        inputs.require_stack(index, thickness)
