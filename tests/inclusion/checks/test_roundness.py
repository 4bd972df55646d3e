"""Round or not, square or not: closed forms of shifted bumps, noise of known size, lamps of unequal power."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.stats import kstest

import tsis
from tsis.imaging.rendering import render
from tsis.imaging.sensor import Sensor, expose
from tsis.inclusion.checks.roundness import (
    harmonic_variance,
    roundness,
    roundness_findings,
    tilt_evidence,
    tilt_findings,
)
from tsis.inclusion.checks.sectors import RINGS, SECTORS, harmonic, sector_means, unevenness
from tsis.model.calibration import Calibration, LightMap
from tsis.model.image import TactileImage
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.press import PressMap
from tsis.virtual.probe import VirtualProbe, nominal_calibration

if TYPE_CHECKING:
    from tsis.inclusion.checks.sectors import Sectors

PROBE = tsis.load_probe("tsis-2011")
PLAIN = tsis.load_phantom("plain")
REACH = 0.8 * PROBE.radius_mm
SENSOR = Sensor(columns=384, rows=246, mm_per_pixel=(0.0672, 0.0784))
ANSWER = nominal_calibration(SENSOR)
SIDE = np.linspace(-13.0, 13.0, 105)
WIDTH_MM, BASE_KPA, BUMP_KPA = 3.0, 2.2, 0.8


def bumps(*places: tuple[float, float], lean: float = 0.0) -> PressMap:
    """Even pressure that leans by a share at the rim, and one bump at each place."""
    x, y = SIDE, SIDE[:, None]
    pressure = BASE_KPA * (1 + lean * x / PROBE.radius_mm) + 0 * y
    for east, south in places:
        pressure = pressure + BUMP_KPA * np.exp(-((x - east) ** 2 + (y - south) ** 2) / (2 * WIDTH_MM**2))
    inside = np.hypot(x, y) < 12.5
    return PressMap(
        x_mm=SIDE,
        y_mm=SIDE,
        face_displacement_mm=np.where(inside, 0.3, 0.0),
        pressure_kpa=pressure,
        approach_mm=1.0,
        force_n=1.0,
    )


def seen(press: PressMap, *, seed: int = 1, light: LightMap | None = None) -> Sectors:
    answer = replace(ANSWER, light=light)
    # A map's growth is done by the rendering, where the estimates know it only as a possibility.
    grey = expose(render(press, SENSOR, answer, light=light), SENSOR, np.random.default_rng(seed))
    frame = TactileImage(grey=grey, mm_per_pixel=SENSOR.mm_per_pixel, force_n=1.0)
    return sector_means(frame, probe=PROBE, calibration=answer)


def flags(target: Sectors, reference: Sectors | None) -> list[str]:
    return [flag for flag, _ in roundness_findings([target], [reference], ANSWER)]


def opposite_lamps() -> LightMap:
    """Two opposite lamps stronger than the others: the light grows differently along x and y."""
    x, y = SIDE, SIDE[:, None]
    none = np.zeros((len(SIDE), len(SIDE)))
    return LightMap(
        x_mm=SIDE,
        y_mm=SIDE,
        relative=1 + 0.2 * (x**2 - y**2) / 144,
        flux_x=none,
        flux_y=none,
        growth_per_mm=0.3 * (x**2 - y**2) / 144,
        error=0.0,
    )


@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_harmonic_is_found_with_its_size_and_direction(order: int) -> None:
    angle = (np.arange(SECTORS * 100) + 0.5) * (2 * np.pi / SECTORS / 100)
    fine = 5 + 2 * np.cos(order * (angle - 0.4))
    found = harmonic(np.broadcast_to(fine.reshape(SECTORS, 100).mean(axis=1), (RINGS, SECTORS)), order)
    np.testing.assert_allclose(found, 2 * np.exp(1j * order * 0.4), rtol=1e-3)


@pytest.mark.parametrize("order", [1, 2])
def test_noise_of_the_stated_size_has_even_chances(order: int) -> None:
    """Pixel noise, and patterns and repeatability that are alike all around: Kolmogorov and Smirnov find no fault."""
    rng, found = np.random.default_rng(4), []
    answer = replace(ANSWER, pattern_sd=0.004, repeatability_sd=0.003)
    shape = (SENSOR.rows, SENSOR.columns)
    empty = TactileImage(grey=np.zeros(shape), mm_per_pixel=SENSOR.mm_per_pixel, force_n=1.0)
    place = sector_means(empty, probe=PROBE, calibration=answer).grid.sector

    def pattern(sd: float) -> np.ndarray:
        # A ring's mean then errs by sd.
        cells = np.append(1 + sd * np.sqrt(SECTORS) * rng.standard_normal(RINGS * SECTORS), 1.0)
        return np.asarray(cells[place].reshape(shape))

    for _ in range(200):
        fixed, frames = pattern(0.004), []
        for level in (120.0, 70.0):
            grey = expose(level * fixed * pattern(0.003), SENSOR, rng)
            frame = TactileImage(grey=grey, mm_per_pixel=SENSOR.mm_per_pixel, force_n=1.0)
            frames.append(sector_means(frame, probe=PROBE, calibration=answer))
        change = frames[0].grey - frames[1].grey
        variance = harmonic_variance(change, frames, answer, order=order)[:, 1:]
        radius = frames[0].grid.ring_radius_mm[1:]
        found.append(unevenness(harmonic(change, order)[1:], variance, radius, given=[]).chance)
    assert kstest(found, "uniform").pvalue > 0.001
    assert np.mean(found) == pytest.approx(0.5, abs=0.08)


@pytest.mark.parametrize("apart", [8.0, 10.0])
@pytest.mark.parametrize("turn", [0.0, 0.7, np.pi / 2])
@pytest.mark.parametrize("with_reference", [True, False])
def test_two_bumps_are_not_one(apart: float, turn: float, with_reference: bool) -> None:
    east, south = apart / 2 * np.cos(turn), apart / 2 * np.sin(turn)
    target, reference = seen(bumps((east, south), (-east, -south))), seen(bumps(), seed=2)
    finding = roundness(target, reference if with_reference else None, ANSWER)
    assert finding is not None
    assert finding.chance < 1e-30
    # The harmonic by quadrature along the ring that was named.
    angle = np.linspace(0.0, 2 * np.pi, 720, endpoint=False)
    x, y = finding.radius_mm * np.cos(angle), finding.radius_mm * np.sin(angle)
    far = [(x - sign * east) ** 2 + (y - sign * south) ** 2 for sign in (1, -1)]
    pressure = BASE_KPA + BUMP_KPA * sum(np.exp(-squared / (2 * WIDTH_MM**2)) for squared in far)
    saturation = ANSWER.saturation_kpa
    ring = ANSWER.gain_grey_per_kpa * pressure * (1 - np.pi / 12 * (pressure / saturation) ** 2)  # erf to third order
    assert finding.size_grey == pytest.approx(2 * abs(np.mean(ring * np.exp(2j * angle))), rel=0.05)
    assert flags(target, reference if with_reference else None) == ["not_one_round_inclusion"]


@pytest.mark.parametrize("place", [(0.0, 0.0), (1.0, 0.0), (0.5, -1.2), (1.5, 1.5)])
@pytest.mark.parametrize("with_reference", [True, False])
def test_one_bump_is_round_on_the_axis_and_near_it(place: tuple[float, float], with_reference: bool) -> None:
    for seed in range(3):
        reference = seen(bumps(), seed=50 + seed) if with_reference else None
        assert flags(seen(bumps(place), seed=seed), reference) == []


def test_an_offset_would_be_taken_for_a_finding_if_its_second_harmonic_were_not_known() -> None:
    target, reference = seen(bumps((1.0, 0.0))), seen(bumps(), seed=2)
    change = target.grey - reference.grey
    variance = harmonic_variance(change, [target, reference], ANSWER, order=2)[:, 1:]
    radius = target.grid.ring_radius_mm[1:]
    assert unevenness(harmonic(change, 2)[1:], variance, radius, given=[]).chance < 1e-6


def test_lamps_of_unequal_power_do_not_make_a_round_press_uneven() -> None:
    light = opposite_lamps()
    target, reference = seen(bumps((0.0, 0.0)), light=light), seen(bumps(), light=light, seed=2)
    variance = harmonic_variance(target.grey, [target], ANSWER, order=2)[:, 1:]
    alone = unevenness(harmonic(target.grey, 2)[1:], variance, target.grid.ring_radius_mm[1:], given=[])
    assert alone.chance < 1e-6  # the dent does show in the light
    assert flags(target, reference) == []
    assert flags(target, None) == []
    two = seen(bumps((4.0, 0.0), (-4.0, 0.0)), light=light)
    assert flags(two, reference) == ["not_one_round_inclusion"]


def test_a_cut_picture_says_that_it_cannot_tell() -> None:
    frame = TactileImage(grey=np.full((60, 60), 50.0), mm_per_pixel=(0.06, 0.06), force_n=1.0)
    small = sector_means(frame, probe=PROBE, calibration=ANSWER)
    assert flags(small, None) == ["roundness_not_checked"]
    assert tilt_findings([small], ANSWER) == []


@pytest.mark.parametrize("probe", ["tsis-2011", pytest.param("tsis-domed", marks=pytest.mark.slow)])
def test_ordinary_presses_under_traced_light_are_round_and_square(probe: str) -> None:
    pressing = tsis.load_probe(probe)
    known = VirtualProbe(pressing, rng=np.random.default_rng(0), strain="small").calibration
    known = replace(known, probe_young_sd=0.0)  # one stiffness is pressed once
    for seed in range(4):
        virtual = VirtualProbe(pressing, rng=np.random.default_rng(seed), calibration=known, strain="small")
        target, plain = (
            sector_means(virtual.press(tsis.load_phantom(name), force_n=1.0), probe=pressing, calibration=known)
            for name in ("hardness-100", "plain")
        )
        assert roundness_findings([target, target], [plain, None], known) == []
        assert tilt_findings([plain], known) == []


@pytest.mark.parametrize("share", [0.05, -0.1])
def test_a_probe_that_leans_is_named_with_the_size_of_it(share: float) -> None:
    plain = seen(bumps(lean=share))
    finding = tilt_evidence(plain, ANSWER)
    assert finding is not None
    at_rim = abs(share) * BASE_KPA * ANSWER.gain_grey_per_kpa
    assert finding.size_grey == pytest.approx(at_rim * finding.radius_mm / PROBE.radius_mm, rel=0.05)
    ((flag, sentence),) = tilt_findings([seen(bumps(), seed=3), plain], ANSWER)
    assert flag == "tilted"
    assert "hold the probe square" in sentence


def test_an_axis_some_pixels_off_is_no_tilt() -> None:
    """The rim of a real press is bright, so that a picture moved by a little is brighter on one side."""
    virtual = VirtualProbe(PROBE, rng=np.random.default_rng(8), strain="small")
    frame = virtual.press(PLAIN, force_n=1.0)
    x, y = frame.axis()
    moved = replace(frame, axis_px=(x + 3.0, y - 2.0))
    shown = sector_means(moved, probe=PROBE, calibration=virtual.calibration)
    assert tilt_findings([shown], virtual.calibration) == []


LUMP = Inclusion(diameter_mm=6.0, depth_mm=5.0, young_kpa=100.0)
SLAB = Phantom(young_kpa=5.0, thickness_mm=30.0)


def pair(apart: float) -> Phantom:
    one, other = (replace(LUMP, offset_mm=(side * apart / 2, 0.0)) for side in (1, -1))
    return replace(SLAB, inclusion=one, more_inclusions=(other,))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("phantom", "expected"),
    [
        (pair(8.0), ["not_one_round_inclusion"]),
        (pair(10.0), ["not_one_round_inclusion"]),
        (replace(SLAB, inclusion=replace(LUMP, semi_axes_mm=(8.0, 4.0, 4.0))), ["not_one_round_inclusion"]),
        (replace(SLAB, inclusion=replace(LUMP, diameter_mm=8.0, offset_mm=(1.0, 0.0))), []),
        (replace(SLAB, inclusion=replace(LUMP, diameter_mm=14.0, offset_mm=(0.7, 0.7))), []),
    ],
    ids=["two 8 mm apart", "two 10 mm apart", "ellipsoid", "1 mm off the axis", "large and 1 mm off"],
)
def test_presses_in_three_dimensions(phantom: Phantom, expected: list[str]) -> None:
    pytest.importorskip("ngsolve", reason="the extra fem3d is not installed")
    answer: Calibration = replace(
        VirtualProbe(PROBE, rng=np.random.default_rng(0), strain="small").calibration, probe_young_sd=0.0
    )
    for seed in range(3):
        virtual = VirtualProbe(PROBE, rng=np.random.default_rng(seed), calibration=answer, strain="small")
        target, plain = (
            sector_means(virtual.press(one, force_n=1.0), probe=PROBE, calibration=answer) for one in (phantom, PLAIN)
        )
        for reference in (plain, None):
            found = roundness_findings([target], [reference], answer)
            assert [flag for flag, _ in found] == expected
