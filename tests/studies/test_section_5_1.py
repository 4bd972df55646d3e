"""The study's lines: what its text says of each contact model, by closed forms and by frames with noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.special import ellipk
from studies.section_5_1 import (
    FORCES_N,
    PRINTED_DIFFERENCE,
    PRINTED_INTERCEPT,
    PRINTED_SLOPE,
    PROBE,
    TIPS_MM,
    Result,
    bench,
    draw,
    full_contact,
    pressed,
    report,
    run,
    saturation_kpa,
    traced_lines,
)
from tests.mechanics.closed_forms import hertz

from tsis.mechanics.closed_forms import effective_modulus_kpa
from tsis.optics.face_light import irradiance

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="module")
def result() -> Result:
    return run()


@pytest.mark.parametrize("tip_mm", TIPS_MM)
def test_rough_contact_sums_to_the_force(result: Result, tip_mm: float) -> None:
    for line in (result.line("rough", tip_mm), result.noisy_line(tip_mm)):
        assert line.exponent == pytest.approx(1.0, abs=0.03)
        assert line.r_squared >= 0.998
        assert line.slope_per_n == pytest.approx(PRINTED_SLOPE, rel=0.07)
    assert result.hysteresis(tip_mm) < 0.005, "none is seen"


def test_wide_tips_agree_under_rough_contact(result: Result) -> None:
    assert abs(result.difference("rough")) <= 0.025
    assert abs(result.difference("rough")) < PRINTED_DIFFERENCE


@pytest.mark.parametrize("tip_mm", TIPS_MM)
def test_smooth_contact_follows_the_area_of_hertz(result: Result, tip_mm: float) -> None:
    line = result.line("smooth", tip_mm)
    assert line.exponent == pytest.approx(2 / 3, abs=2e-3)
    assert line.r_squared < 0.99
    assert result.difference("smooth") == pytest.approx(1.4 ** (2 / 3) - 1, abs=2e-3)


def test_so_it_does_on_the_layered_probe(result: Result) -> None:
    assert result.layered_difference() == pytest.approx(0.285, abs=0.01)
    for area in result.layered_area_mm2.values():
        assert np.polyfit(np.log([0.2, 0.4, 0.8, 1.6]), np.log(area), 1)[0] == pytest.approx(0.743, abs=0.01)


def test_curvature_bends_the_line_and_is_dark_in_the_middle(result: Result) -> None:
    for tip in TIPS_MM:
        assert 0.8 < result.line("curvature", tip).exponent < 0.85
    assert result.difference("curvature") == pytest.approx(-0.063, abs=0.005)
    middle = np.abs(result.row_mm) < 0.05
    share = {model: row[middle].mean() / row.max() for model, row in result.rows.items()}
    assert share["curvature"] < 0.05
    assert share["rough"] == pytest.approx(1.0, abs=1e-3)
    half_way = np.abs(np.abs(result.row_mm) - 3.0) < 0.05
    assert result.rows["rough"][half_way].mean() < 0.9 * result.rows["rough"].max()
    assert result.rows["smooth"][half_way].mean() == pytest.approx(result.rows["smooth"].max(), rel=1e-6)


def test_gentle_asperities_saturate_under_the_small_tip(result: Result) -> None:
    exponents = [result.rougher[slope].exponent for slope in sorted(result.rougher)]
    assert (np.diff(exponents) > 0).all()
    assert result.rougher[0.8].exponent < 0.96
    assert result.rougher[1.0].exponent == pytest.approx(0.97, abs=1e-3)
    starts = {slope: line.intercept / line.slope_per_n for slope, line in result.rougher.items()}
    assert starts[1.0] < PRINTED_INTERCEPT / PRINTED_SLOPE < starts[0.8]


def test_saturation_bends_the_sum_as_its_series_says(result: Result) -> None:
    """``erf(x) = 2/sqrt(pi) (x - x**3 / 3 + x**5 / 10)`` over Hertz's half-ellipsoid."""
    for tip in TIPS_MM:
        peak = pressed(tip, 0.5).pressure_kpa[0] / bench().saturation_kpa
        second, fourth = np.pi / 4 * peak**2, (np.pi / 4) ** 2 * peak**4
        expected = PRINTED_SLOPE * 0.5 * (1 - second / 3 * 3 / 5 + fourth / 10 * 3 / 7)
        assert result.sums["rough"][tip][4] == pytest.approx(expected, rel=2e-3)


def test_what_the_bench_holds_and_what_other_settings_lose(result: Result) -> None:
    assert full_contact() < 255 - 8, "nothing can clip"
    assert saturation_kpa(1.25) == pytest.approx(1.5 * pressed(2.0, 2.0).pressure_kpa.max(), rel=0.05)
    for (setting, _, _), lost in result.losses.items():
        if setting == "bench":
            assert (lost.light_clipped, lost.light_outside) == (0.0, 0.0)
        elif setting == "printed scale":
            assert lost.light_clipped == 0.0
        else:
            assert lost.light_clipped > 0.2
    assert result.losses["printed scale", 14.0, 2.0].force_outside == pytest.approx(0.83, abs=0.01)
    assert result.losses["printed scale", 2.0, 0.1].force_outside < 0.001


@pytest.mark.parametrize("tip_mm", TIPS_MM)
def test_the_press_is_hertzs(tip_mm: float) -> None:
    field = pressed(tip_mm, 0.2)
    force = trapezoid(2 * np.pi * field.radius_mm * field.pressure_kpa, field.radius_mm) / 1000
    assert force == pytest.approx(0.2, rel=1e-3)
    contact = hertz(
        radius_mm=tip_mm,
        indentation_mm=field.approach_mm,
        young_kpa=effective_modulus_kpa(PROBE.layers),
        poisson=0.49,
    )
    assert contact.force_mn == pytest.approx(200.0, rel=1e-9)
    assert field.pressure_kpa[0] == pytest.approx(contact.peak_pressure_kpa, rel=1e-9)
    assert field.face_displacement_mm[0] == pytest.approx(field.approach_mm, rel=1e-9)


def test_the_face_is_dragged_as_by_the_pressure_on_a_half_space() -> None:
    """Far away and near by: Boussinesq's displacement, integrated over rings by their complete elliptic integral."""
    field = pressed(10.0, 0.8)
    edge = float(field.radius_mm[field.pressure_kpa > 0].max())
    modulus = effective_modulus_kpa(PROBE.layers) / (1 - 0.49**2)

    def boussinesq(at: float) -> float:
        r = field.radius_mm[field.radius_mm <= edge]
        rings = field.pressure_kpa[: len(r)] * r / (r + at) * ellipk(4 * r * at / (r + at) ** 2)
        return float(4 / (np.pi * modulus) * trapezoid(rings, r))

    for at in (1.05 * edge, 1.5 * edge, 2.5 * edge):
        found = np.interp(at, field.radius_mm, field.face_displacement_mm)
        assert found == pytest.approx(boussinesq(at), rel=3e-3)


def test_the_picture_and_the_table_are_written(
    result: Result, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    draw(result, tmp_path / "sums.png")
    assert (tmp_path / "sums.png").read_bytes().startswith(b"\x89PNG")
    report(result)
    printed = capsys.readouterr().out
    assert f"rough: 14 mm over 10 mm at 0.8 N {result.difference('rough'):+.2%}" in printed
    assert len(FORCES_N) == 20


@pytest.mark.slow
def test_under_the_catalogs_lamps_two_bends_of_the_line_cancel() -> None:
    """Light that gathers in the middle makes wide contacts dimmer; a deeper dent catches more of it."""
    light = irradiance(PROBE, rays=400_000, cached=False)
    lines = traced_lines(light)
    first = light.near_undented()
    middle = first.relative[len(first.y_mm) // 2, len(first.x_mm) // 2]
    for tip in (10.0, 14.0):
        assert lines["even", tip].exponent == pytest.approx(1.0, abs=0.002)
        assert lines["face", tip].exponent < 0.95
        assert lines["dent", tip].exponent > lines["face", tip].exponent + 0.04
        assert lines["dent", tip].exponent == pytest.approx(1.0, abs=0.03)
        assert lines["dent", tip].r_squared >= 0.998
        assert PRINTED_SLOPE < lines["face", tip].slope_per_n < middle * PRINTED_SLOPE
