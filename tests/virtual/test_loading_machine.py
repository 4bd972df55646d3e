from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import erf

import tsis
from tsis.errors import InputError
from tsis.imaging.sensor import LedDrift, Sensor
from tsis.model.calibration import LightMap
from tsis.virtual.loading_machine import MachineErrors, VirtualLoadingMachine
from tsis.virtual.probe import VirtualProbe

SENSOR = Sensor(columns=256, rows=216)
NO_ERRORS = MachineErrors(
    probe_young_sd=0.0,
    gain_sd=0.0,
    shading_sd=0.0,
    tip_sd=0.0,
    repeatability_sd=0.0,
    pattern_sd=0.0,
    hysteresis_sd=0.0,
    force_sd=0.0,
    position_sd_mm=0.0,
    gauge_gain_sd=0.0,
    gauge_zero_sd_n=0.0,
    gauge_noise_n=0.0,
)
STEADY = LedDrift(warm_up=0.0, wander=0.0)


def machine(
    seed: int = 1, *, errors: MachineErrors | None = None, drift: LedDrift | None = None, blur_mm: float = 0.05
) -> VirtualLoadingMachine:
    return VirtualLoadingMachine(
        tsis.load_probe("tsis-direct"),
        rng=np.random.default_rng(seed),
        sensor=SENSOR,
        errors=errors,
        drift=drift,
        blur_mm=blur_mm,
    )


@pytest.mark.parametrize(("tip_mm", "force_n"), [(2.0, 2.0), (10.0, 0.5), (14.0, 2.0)])
def test_light_adds_up_to_the_integral_of_the_saturating_pressure(tip_mm: float, force_n: float) -> None:
    bench = machine(3)
    contact, answer = bench.contact(tip_mm, force_n), bench.truth.response
    a, p0, top = contact.contact_radius_mm, contact.peak_pressure_kpa, answer.saturation_kpa

    def ring(r: float) -> float:
        pressure = p0 * np.sqrt(max(0.0, 1 - (r / a) ** 2))
        return float(2 * np.pi * r * answer.gain_grey_per_kpa * top * erf(np.sqrt(np.pi) / 2 * pressure / top))

    light = quad(ring, 0.0, a)[0] / (SENSOR.mm_per_pixel[0] * SENSOR.mm_per_pixel[1])
    assert bench.expected_grey(tip_mm, force_n) == pytest.approx(light, rel=2e-3)


def test_light_grows_with_the_dent_of_a_tip() -> None:
    """The integral of the pressure times the light at Hertz's displacement."""
    even = LightMap.uniform()
    growth, tip_mm, force_n = 0.3, 10.0, 0.5
    bench = VirtualLoadingMachine(
        tsis.load_probe("tsis-direct"),
        rng=np.random.default_rng(3),
        sensor=SENSOR,
        light=replace(even, growth_per_mm=np.full_like(even.relative, growth)),
    )
    contact, answer = bench.contact(tip_mm, force_n), bench.truth.response
    a, p0, top = contact.contact_radius_mm, contact.peak_pressure_kpa, answer.saturation_kpa

    def ring(r: float) -> float:
        pressure, sunk = p0 * np.sqrt(max(0.0, 1 - (r / a) ** 2)), (a**2 - r**2 / 2) / tip_mm
        shown = answer.gain_grey_per_kpa * top * erf(np.sqrt(np.pi) / 2 * pressure / top)
        return float(2 * np.pi * r * shown * np.exp(growth * sunk))

    light = quad(ring, 0.0, a)[0] / (SENSOR.mm_per_pixel[0] * SENSOR.mm_per_pixel[1])
    assert bench.expected_grey(tip_mm, force_n) == pytest.approx(light, rel=2e-3)


def test_the_contact_carries_the_force() -> None:
    contact = machine().contact(10.0, 0.7)
    carried = quad(lambda r: 2 * np.pi * r * float(contact.pressure_kpa(r)), 0.0, contact.contact_radius_mm)[0]
    assert carried == pytest.approx(700.0, rel=1e-4)


def test_a_machine_without_errors_shows_the_force_and_its_light() -> None:
    bench = machine(errors=NO_ERRORS, drift=STEADY)
    untouched = np.mean([bench.no_contact().grey for _ in range(20)], axis=0)
    image, shown = bench.press(10.0, 1.234)
    assert shown == pytest.approx(1.234, abs=5e-4)
    assert (image.grey - untouched).sum() == pytest.approx(bench.expected_grey(10.0, 1.234), rel=0.005)


def test_unloading_remembers_loading_as_much_as_the_truth_says() -> None:
    bench = machine(errors=MachineErrors(**{**_of(NO_ERRORS), "hysteresis_sd": 0.2}), drift=STEADY)
    untouched = np.mean([bench.no_contact().grey for _ in range(20)], axis=0)
    up = (bench.press(10.0, 1.0)[0].grey - untouched).sum()
    bench.press(10.0, 2.0)
    down = (bench.press(10.0, 1.0)[0].grey - untouched).sum()
    assert abs(bench.truth.hysteresis_fraction) > 0.02
    assert down / up - 1 == pytest.approx(bench.truth.hysteresis_fraction, abs=0.005)
    bench.no_contact()  # and forgets it untouched
    again = (bench.press(10.0, 1.0)[0].grey - untouched).sum()
    assert again == pytest.approx(up, rel=0.005)


def _of(errors: MachineErrors) -> dict[str, float]:
    return {name: getattr(errors, name) for name in MachineErrors.__dataclass_fields__}


def test_the_gauge_has_a_zero_a_gain_and_steps() -> None:
    errors = MachineErrors(
        **{**_of(NO_ERRORS), "gauge_gain_sd": 0.05, "gauge_zero_sd_n": 0.1, "gauge_resolution_n": 0.02}
    )
    bench = machine(5, errors=errors)
    zero, shown = (bench.press(10.0, force)[1] for force in (0.0, 2.0))
    assert abs(bench.truth.gauge_zero_n) > 0.02
    assert zero == pytest.approx(bench.truth.gauge_zero_n, abs=0.0101)
    assert shown == pytest.approx(bench.truth.gauge_gain * 2.0 + bench.truth.gauge_zero_n, abs=0.0101)
    assert shown / 0.02 == pytest.approx(round(shown / 0.02), abs=1e-9)


def test_the_reference_patch_shows_the_lamps() -> None:
    bench = machine(drift=LedDrift(warm_up=0.3, warm_up_s=100.0, wander=0.0), errors=NO_ERRORS)
    assert bench.patch_px is not None
    left, top, right, bottom = bench.patch_px
    seen = [bench.no_contact().grey[top:bottom, left:right].mean() - 8.0 for _ in range(3)]
    assert seen[2] / seen[0] == pytest.approx(bench.lamps[2] / bench.lamps[0], rel=2e-3)


def test_dark_frames_hold_no_light() -> None:
    bench = machine()
    dark = bench.dark().grey
    assert np.median(dark) == SENSOR.background_grey
    assert int((dark > 30).sum()) == 8  # the hot pixels


def test_the_same_seed_gives_the_same_frames_and_another_does_not() -> None:
    one, same, other = (machine(seed).press(2.0, 1.0) for seed in (7, 7, 8))
    assert np.array_equal(one[0].grey, same[0].grey)
    assert one[1] == same[1]
    assert not np.array_equal(one[0].grey, other[0].grey)


def test_a_contact_that_leaves_the_frame_is_refused() -> None:
    with pytest.raises(InputError, match="wider field"):
        machine().press(100.0, 5.0)


@pytest.mark.parametrize(("tip_mm", "force_n"), [(2.0, -1.0), (2.0, 60.0), (0.0, 1.0), (2.0, float("nan"))])
def test_tips_and_forces_out_of_range_are_refused(tip_mm: float, force_n: float) -> None:
    with pytest.raises(InputError):
        machine().press(tip_mm, force_n)


def test_the_edge_is_blurred_by_the_lens_and_the_pixels() -> None:
    sharp, soft = (machine(errors=NO_ERRORS, blur_mm=blur).edge(0.0).grey[100] for blur in (0.0, 0.3))
    assert np.abs(np.diff(sharp)).max() > 3 * np.abs(np.diff(soft)).max()


def test_the_machine_of_a_virtual_probe_sees_its_light_at_another_exposure() -> None:
    """Tissue and pad of one modulus: frames of the probe itself, drawn by other code, times the ratio of exposures."""
    domed = tsis.load_probe("tsis-domed")
    rig = VirtualProbe(domed, rng=np.random.default_rng(1), strain="small")
    machine = VirtualLoadingMachine.of(rig, rng=np.random.default_rng(2))
    image, _ = machine.press_pad(5.0, 1.0)
    pad = tsis.Phantom(young_kpa=5.0, poisson=0.49, thickness_mm=30.0)
    radius = rig.sensor.radius_mm()
    light = rig.light(pad, force_n=1.0) * machine.exposure
    for low, high in ((0.0, 3.0), (3.0, 6.0), (6.0, 9.0)):
        ring = (radius >= low) & (radius < high)
        seen = float(image.grey[ring].mean()) - rig.sensor.background_grey
        assert seen == pytest.approx(float(light[ring].mean()), rel=0.06)  # force, stray light and pad by 1 to 2 %
    assert image.grey[radius < 9.0].max() < 0.8 * rig.sensor.full_scale
