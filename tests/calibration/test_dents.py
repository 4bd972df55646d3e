"""Light on dents from presses on soft pads, made here by a finer mesh and a law that is known."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import tsis
from tsis.calibration.dents import STEEPNESS, PadPresses, _response, _rows_of_tips, fit_dent_light, ring_edges_mm
from tsis.calibration.file import ProbeCalibration, calibration_bytes, calibration_sha256, parse_calibration
from tsis.calibration.force_line import Loading
from tsis.errors import CalibrationError, InputError
from tsis.imaging.rendering import rough_contact
from tsis.mechanics import press
from tsis.mechanics.small_strain.slab import Resolution
from tsis.model.calibration import LIGHT_RINGS, LIGHT_TERMS, Calibration, LightMap, LightTerms

PROBE = tsis.load_probe("tsis-domed")
RESPONSE = Calibration(gain_grey_per_kpa=20.0, saturation_kpa=100.0, probe=PROBE.name)
FORCES_N = (0.4, 0.6, 0.8, 1.0, 1.2)
FINE = Resolution(order=6, largest=0.2)


def pads(growth: float, flux: float, gain: float, *, softer: float = 1.0, seed: int = 0) -> list[PadPresses]:
    """Presses under a light that grows and flows evenly, with pads softer than stated and 0.1 % of noise."""
    rng, edges = np.random.default_rng(seed), ring_edges_mm(PROBE)
    middle = (edges[:-1] + edges[1:]) / 2
    found = []
    for young in (5.0, 10.0):
        rows = []
        for force in FORCES_N:
            pad = tsis.Phantom(young_kpa=young * softer, poisson=0.49, thickness_mm=30.0)
            field = press(PROBE, pad, force_n=force, resolution=FINE)
            slope = np.gradient(field.face_displacement_mm, field.radius_mm)
            pressure, sunk, tilt = (
                np.interp(middle, field.radius_mm, part)
                for part in (field.pressure_kpa, field.face_displacement_mm, slope)
            )
            light = np.exp(growth * sunk) * (1 + flux * middle / PROBE.radius_mm * tilt)
            rows.append(gain / 20.0 * rough_contact(pressure, RESPONSE) * light * (1 + 1e-3 * rng.standard_normal(20)))
        grey = np.array(rows)
        found.append(PadPresses(young_kpa=young, force_n=np.array(FORCES_N), grey=grey, variance=(1e-3 * grey) ** 2))
    return found


@pytest.mark.parametrize(("growth", "flux"), [(0.0, 0.0), (0.25, 0.5), (-0.3, 1.0)])
def test_gain_and_light_are_found_together_where_the_tips_are_wrong_by_a_factor(growth: float, flux: float) -> None:
    found = fit_dent_light(
        pads(growth, flux, 70.0, softer=1.06), [], probe=PROBE, response=RESPONSE, pixel_mm2=1e-3, strain="small"
    )
    assert abs(np.log(found.gain_ratio / 3.5)) < 3 * found.gain_sd
    assert found.gain_sd < 0.08
    light = found.response.light
    assert light is not None
    # The growth of a ring, within its own uncertainty
    sd = np.linalg.norm(LightTerms.of(light.factor).growth_per_mm, axis=1)
    middle = (ring_edges_mm(PROBE)[:-1] + ring_edges_mm(PROBE)[1:]) / 2
    growths = light.undented(middle, [0.0])[3][0]
    assert np.all(np.abs(growths - growth) < 4 * sd)
    assert found.misfit < 1.5


def test_each_press_of_a_tip_that_is_seen_states_the_gain() -> None:
    """Light is 7 grey/kPa; one press is dark, one clips, one is deeper than second order describes."""
    force = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    square = np.array([0.0, 4.0, 4.0, 4.0, 4.0, 9.0])  # of the contact's radius, mm^2
    light = np.array([0.0, 0.0, 1.0, 1.0, 1.0, 1.0])
    loading = Loading(
        tip_radius_mm=10.0,
        force_n=force,
        total_grey=7e6 * force * light,  # pixels of 0.001 mm^2, forces in mN
        touched=force > 0,
        field_grey=force,
        peak_grey=force,
        mean_square_mm2=square / 2.5,
        clipped=np.array([0.0, 0.0, 0.0, 0.1, 0.0, 0.0]),
    )
    rows = _rows_of_tips([loading], PROBE, RESPONSE, 1e-3, LIGHT_TERMS + 1)
    assert len(rows) == 2
    for row in rows:
        assert row.residual == pytest.approx(np.log(7.0 / RESPONSE.gain_grey_per_kpa))


def test_growth_of_the_light_under_a_tip_counts_by_the_mean_dent_of_hertz() -> None:
    """Of a dent (a^2 - r^2 / 2) / R, whose mean under Hertz's pressure is 0.8 a^2 / R."""
    square, tip = np.array([0.0, 16.0, 25.0, 36.0, 64.0]), 100.0
    force = square**1.5 / 100.0
    loading = Loading(
        tip_radius_mm=tip,
        force_n=force,
        total_grey=force,
        touched=force > 0,
        field_grey=force,
        peak_grey=force,
        mean_square_mm2=square / 2.5,
        clipped=np.zeros(5),
    )
    rows = _rows_of_tips([loading], PROBE, RESPONSE, 1e-3, LIGHT_TERMS)
    np.testing.assert_allclose([row.terms[0, 0] for row in rows], 0.8 * square[1:] / tip, rtol=0.02)


def test_terms_of_nothing_leave_gain_and_saturation() -> None:
    count = LIGHT_TERMS
    made = _response(np.zeros(count), np.zeros((count, count)), np.zeros(LIGHT_RINGS), PROBE, RESPONSE)
    assert made.saturation_kpa == pytest.approx(RESPONSE.saturation_kpa)
    assert made.gain_grey_per_kpa == RESPONSE.gain_grey_per_kpa
    # Contact that bends as 1 - s p^2 with a larger s saturates earlier, by the law of rough contact.
    bent = np.zeros(count)
    bent[-2] = 3 * STEEPNESS / RESPONSE.saturation_kpa**2
    assert _response(
        bent, np.zeros((count, count)), np.zeros(LIGHT_RINGS), PROBE, RESPONSE
    ).saturation_kpa == pytest.approx(50.0)


def test_the_product_is_known_better_than_its_factors() -> None:
    found = fit_dent_light(pads(0.25, 0.5, 70.0), [], probe=PROBE, response=RESPONSE, pixel_mm2=1e-3, strain="small")
    light = found.response.light
    assert light is not None
    growth = found.displacement_mm * np.linalg.norm(LightTerms.of(light.factor).growth_per_mm, axis=1).mean()
    assert found.product_sd < 0.3 * np.hypot(growth, found.gain_sd)
    assert found.gain_sd == pytest.approx(np.linalg.norm(light.factor[-1])), "the last term of the joint covariance"
    assert 0.005 < found.product_sd < 0.03  # the pads' own light is uncertain by 1 %


def test_more_uncertain_pads_give_a_wider_gain() -> None:
    presses = pads(0.25, 0.5, 70.0)
    sure, unsure = (
        fit_dent_light(
            presses, [], probe=PROBE, response=RESPONSE, pixel_mm2=1e-3, strain="small", pad_sd=sd
        ).product_sd
        for sd in (0.01, 0.3)
    )
    assert sure < unsure


def test_a_light_that_no_term_describes_widens_the_errors() -> None:
    presses = pads(0.25, 0.5, 70.0)
    wavy = 1 + 0.03 * np.cos(np.pi * np.arange(20))
    odd = [replace(pad, grey=pad.grey * wavy) for pad in presses]
    straight, bent = (
        fit_dent_light(part, [], probe=PROBE, response=RESPONSE, pixel_mm2=1e-3, strain="small")
        for part in (presses, odd)
    )
    assert bent.misfit > 2
    assert bent.product_sd > straight.product_sd


def test_what_all_presses_have_in_common_becomes_part_of_the_light() -> None:
    """Waves of 1 % along the radius, six rings long, which no term of the light describes."""
    waves = 1 + 0.01 * np.cos(2 * np.pi * np.arange(LIGHT_RINGS) / 6)
    plain, wavy = (
        fit_dent_light(
            [replace(pad, grey=pad.grey * factor) for pad in pads(0.25, 0.5, 70.0)],
            [],
            probe=PROBE,
            response=RESPONSE,
            pixel_mm2=1e-3,
            strain="small",
        ).response.light
        for factor in (1.0, waves)
    )
    assert plain is not None
    assert wavy is not None
    middle = (ring_edges_mm(PROBE)[:-1] + ring_edges_mm(PROBE)[1:]) / 2
    dent_mm = 0.2

    def light(of: LightMap) -> np.ndarray:
        relative, _, _, growth, bend = (part[0] for part in of.undented(middle, [0.0]))
        return np.asarray(np.log(relative) + growth * dent_mm + bend * dent_mm**2)

    left = light(wavy) - light(plain) - np.log(waves)
    assert np.std(left) < 0.003  # 0.006 by the terms alone


def test_too_few_presses_are_refused() -> None:
    light = replace(pads(0.0, 0.0, 20.0)[0], force_n=np.array([0.0, 0.01, 0.02, 0.05, 0.4]))
    with pytest.raises(CalibrationError, match=r"at least 3 presses on pads from 0\.15 N on; got 1 \(press a soft pad"):
        fit_dent_light([light], [], probe=PROBE, response=RESPONSE, pixel_mm2=1e-3, strain="small")


def test_terms_are_legendre_polynomials_over_the_rings() -> None:
    coefficients = np.random.default_rng(1).standard_normal(LIGHT_TERMS)
    terms = LightTerms.of(coefficients, 9)
    x = np.linspace(-1, 1, 9)
    np.testing.assert_allclose(terms.growth_per_mm, np.polynomial.Legendre(coefficients[:8])(x), rtol=1e-12)
    np.testing.assert_allclose(terms.bend_per_mm2, np.polynomial.Legendre(coefficients[8:11])(x), rtol=1e-12)
    distance = (np.arange(9) + 0.5) / 8.5
    np.testing.assert_allclose(terms.flux, distance * np.polynomial.Legendre(coefficients[11:16])(x), rtol=1e-12)
    assert (terms.loss_per_n, terms.square_per_kpa2, terms.log_gain) == tuple(coefficients[16:])


def test_a_calibration_with_light_on_dents_is_stored_and_one_without_too() -> None:
    found = fit_dent_light(pads(0.25, 0.5, 70.0), [], probe=PROBE, response=RESPONSE, pixel_mm2=1e-3, strain="small")
    old = ProbeCalibration(name="bench", probe=PROBE.name, response=replace(RESPONSE, light=LightMap.uniform()))
    new = replace(old, tissue=found.response)
    again = parse_calibration(calibration_bytes(new), "new")
    assert again.tissue == found.response
    assert again.cited_response("x", on_tissue=True).light == found.response.light
    assert again.cited_response("x").light == LightMap.uniform()
    document = json.loads(calibration_bytes(old))
    assert document["calibration"]["tissue"] is None
    assert calibration_sha256(parse_calibration(calibration_bytes(old), "old")) == document["sha256"]


def test_a_factor_of_another_shape_is_refused() -> None:
    with pytest.raises(InputError, match=rf"factor must have {LIGHT_TERMS} rows"):
        replace(LightMap.uniform(), factor=np.eye(3))
