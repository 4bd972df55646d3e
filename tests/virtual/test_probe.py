"""The virtual probe: its seed decides everything, its errors have the sizes that its calibration states."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import tsis
from tsis.errors import InputError
from tsis.imaging.rendering import render
from tsis.imaging.sensor import Sensor
from tsis.mechanics import press
from tsis.mechanics.finite_strain.neo_hookean_press import PressSeries
from tsis.mechanics.finite_strain.patches import FiniteResolution
from tsis.mechanics.small_strain.slab import Resolution
from tsis.model.calibration import Calibration, LightMap
from tsis.optics.face_light import irradiance
from tsis.virtual.probe import VirtualProbe, nominal_calibration

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.phantom import Phantom

PROBE = tsis.load_probe("tsis-2011")
LUMP = tsis.load_phantom("hardness-100")
COARSE = Resolution(order=3, edge=0.05, growth=2.2, largest=0.3)
SMALL = Sensor(columns=96, rows=64, mm_per_pixel=(0.25, 0.28))
IDEAL = replace(
    nominal_calibration(SMALL),
    shading_sd=0.0,
    gain_sd=0.0,
    force_sd=0.0,
    offset_sd=0.0,
    pattern_sd=0.0,
    repeatability_sd=0.0,
    probe_young_sd=0.0,
)


QUIET: dict[str, Any] = {
    "read_noise_grey": 0.0,
    "shot_noise_grey": 0.0,
}  # of sensor and calibration


def virtual(seed: int, calibration: Calibration | None = None, sensor: Sensor = SMALL) -> VirtualProbe:
    return VirtualProbe(
        PROBE,
        rng=np.random.default_rng(seed),
        sensor=sensor,
        light=LightMap.uniform(),
        calibration=calibration,
        resolution=COARSE,
        strain="small",
    )


def test_a_seed_gives_the_same_frames_and_another_seed_others() -> None:
    first, again, other = (virtual(seed).press(LUMP, force_n=1.0).grey for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_two_presses_of_one_probe_differ() -> None:
    probe = virtual(5)
    assert (probe.press(LUMP, force_n=1.0).grey != probe.press(LUMP, force_n=1.0).grey).any()


def test_without_contact_it_reads_the_background() -> None:
    frame = virtual(1).no_contact()
    assert frame.grey.mean() == pytest.approx(SMALL.background_grey, abs=5 * SMALL.read_noise_grey / np.sqrt(96 * 64))
    assert frame.force_n == 0.0
    assert frame.grey.std() == pytest.approx(np.sqrt(SMALL.read_noise_grey**2 + 1 / 12), rel=0.1)


@pytest.mark.parametrize("read_noise_grey", [0.5, 3.0])
def test_the_noise_of_frames_is_that_of_the_calibration(read_noise_grey: float) -> None:
    """Two presses without other errors differ by noise alone: read noise, photon noise and rounding."""
    stated = replace(IDEAL, read_noise_grey=read_noise_grey, shot_noise_grey=0.1)
    probe = VirtualProbe(
        PROBE,
        rng=np.random.default_rng(31),
        light=LightMap.uniform(),
        calibration=stated,
        resolution=COARSE,
        strain="small",
    )
    assert probe.calibration == stated
    dark = np.diff([probe.no_contact().grey for _ in range(2)], axis=0)
    assert dark.std() / np.sqrt(2) == pytest.approx(np.sqrt(read_noise_grey**2 + 1 / 12), rel=0.02)
    first, second = (probe.press(LUMP, force_n=1.0).grey for _ in range(2))
    light = probe.light(LUMP, force_n=1.0)
    bright = (light > 0.2 * light.max()) & (light < 200.0)  # far from black and from clipping
    noise = np.sqrt(read_noise_grey**2 + 0.1 * light[bright].mean() + 1 / 12)
    assert (first - second)[bright].std() / np.sqrt(2) == pytest.approx(noise, rel=0.02)


@pytest.mark.parametrize(
    ("name", "value"), [("read_noise_grey", 3.0), ("shot_noise_grey", 0.1), ("background_grey", 9.0)]
)
def test_a_calibration_that_contradicts_the_sensor_is_refused(name: str, value: float) -> None:
    other: dict[str, Any] = {name: value}
    with pytest.raises(InputError, match=rf"{name} of the calibration must equal the sensor.s, .*; got {value:g}"):
        virtual(1, replace(IDEAL, **other))
    assert virtual(1, replace(IDEAL, **other), replace(SMALL, **other)).no_contact().grey.shape == (64, 96)


def test_neither_sensor_nor_calibration_can_be_replaced() -> None:
    probe = virtual(1)
    for name in ("sensor", "calibration"):
        with pytest.raises(AttributeError):
            setattr(probe, name, getattr(probe, name))


def test_without_errors_it_is_the_rendered_press() -> None:
    quiet = replace(SMALL, **QUIET)
    frame = virtual(1, replace(IDEAL, **QUIET), quiet).press(LUMP, force_n=1.0)
    field = press(PROBE, LUMP, force_n=1.0, resolution=COARSE)
    expected = np.clip(np.rint(render(field, quiet, IDEAL) + quiet.background_grey), 0.0, 255.0)
    np.testing.assert_array_equal(frame.grey, expected)


def test_its_stiffness_is_that_of_all_layers() -> None:
    """Pressing in other units is the same as pressing with every layer stiffer by one factor."""
    answer, quiet = replace(with_error("probe_young_sd", 0.3), **QUIET), replace(SMALL, **QUIET)
    probe = virtual(4, answer, quiet)
    factor = probe._stiffness
    assert abs(factor - 1) > 0.1
    stiffer = replace(PROBE, layers=tuple(replace(layer, young_kpa=factor * layer.young_kpa) for layer in PROBE.layers))
    expected = render(press(stiffer, LUMP, force_n=1.0, resolution=COARSE), quiet, answer)
    np.testing.assert_allclose(probe.light(LUMP, force_n=1.0), expected, rtol=1e-8, atol=1e-8)
    nominal = render(press(PROBE, LUMP, force_n=1.0, resolution=COARSE), quiet, answer)
    assert np.abs(expected - nominal).max() > 1.0


def test_presses_at_finite_strain_are_those_of_the_finite_strain_model() -> None:
    few = FiniteResolution(order=3, rim_mm=1.0, largest=0.5, growth=3.0)
    probe = VirtualProbe(
        PROBE,
        rng=np.random.default_rng(1),
        sensor=SMALL,
        light=LightMap.uniform(),
        calibration=IDEAL,
        strain="finite",
        resolution=few,
    )
    plain = LUMP.without_inclusion()
    field = PressSeries(PROBE, few).press(plain, force_n=1.0)
    found = probe.light(plain, force_n=1.0)
    np.testing.assert_allclose(found, render(field, SMALL, IDEAL), rtol=1e-9, atol=1e-9)
    middle = (slice(24, 40), slice(36, 60))
    small = virtual(1, IDEAL).light(plain, force_n=1.0)[middle]
    apart = np.abs(found[middle] - small).max() / small.max()
    assert 0.01 < apart < 0.1, "another model, of the same press"
    with pytest.raises(InputError, match=r"inclusion must be a sphere or spheroid on .* for strain='finite'; got"):
        probe.light(off_axis(), force_n=1.0)


def off_axis() -> Phantom:
    assert LUMP.inclusion is not None
    return replace(LUMP, inclusion=replace(LUMP.inclusion, offset_mm=(3.0, 0.0)))


def test_by_default_it_presses_at_finite_strain_and_says_so() -> None:
    probe = VirtualProbe(PROBE, rng=np.random.default_rng(1), sensor=SMALL, light=LightMap.uniform())
    assert probe.frame_settings["strain"] == "finite"
    with pytest.raises(InputError, match=r"only one, for strain='finite'.*VirtualProbe\(strain='small'\) accepts"):
        probe.press(off_axis(), force_n=1.0)


def test_by_default_it_is_lit_by_its_own_lamps() -> None:
    quiet = replace(SMALL, **QUIET)
    light = irradiance(PROBE)
    answer = replace(IDEAL, **QUIET, light=light.near_undented())
    probe = VirtualProbe(
        PROBE, rng=np.random.default_rng(1), sensor=quiet, calibration=answer, resolution=COARSE, strain="small"
    )
    field = press(PROBE, LUMP, force_n=0.1, resolution=COARSE)
    falling = light.on(field, saturation_kpa=answer.saturation_kpa)
    expected = np.clip(np.rint(render(field, quiet, answer, light=falling) + quiet.background_grey), 0.0, 255.0)
    found = probe.press(LUMP, force_n=0.1).grey
    np.testing.assert_array_equal(found, expected)
    even = virtual(1, replace(IDEAL, **QUIET), quiet).press(LUMP, force_n=0.1).grey
    assert (found != even).mean() > 0.5


def test_the_nominal_gain_leaves_room_for_the_brightest_place() -> None:
    probe = VirtualProbe(PROBE, rng=np.random.default_rng(1), resolution=COARSE, strain="small")
    frame = probe.press(tsis.load_phantom("plain"), force_n=1.0)
    radius = probe.sensor.radius_mm()
    inner = frame.grey[radius < 0.8 * PROBE.radius_mm]
    assert 60.0 < inner.max() < 200.0
    known = probe.calibration.light
    assert known is not None
    assert probe.calibration.gain_grey_per_kpa * known.relative.max() == pytest.approx(60.0)


def test_the_contact_model_can_be_falsified() -> None:
    seen = {}
    for model in ("rough", "smooth", "curvature"):
        probe = VirtualProbe(
            PROBE,
            rng=np.random.default_rng(1),
            sensor=replace(SMALL, **QUIET, full_scale=4095.0),
            light=LightMap.uniform(),
            calibration=replace(IDEAL, **QUIET),
            contact_model=model,
            resolution=COARSE,
            strain="small",
        )
        seen[model] = [probe.light(LUMP, force_n=force).sum() for force in (0.25, 0.5)]
    ratio = {model: strong / weak for model, (weak, strong) in seen.items()}
    assert ratio["smooth"] == pytest.approx(1.0, rel=1e-6), "the face touches all over at either force"
    assert ratio["rough"] == pytest.approx(2.0, rel=0.05)
    assert ratio["curvature"] == pytest.approx(2.0, rel=0.05)


def with_error(name: str, sd: float) -> Calibration:
    changes: dict[str, Any] = {name: sd}
    return replace(IDEAL, **changes)


def scatter(name: str, sd: float) -> NDArray[np.float64]:
    """Light in the centre of 60 probes that have one kind of error, over that of the ideal one."""
    answer = with_error(name, sd)
    ideal = virtual(0, IDEAL).light(LUMP, force_n=1.0)
    middle = (slice(24, 40), slice(36, 60))
    ratios = [float(virtual(seed, answer).light(LUMP, force_n=1.0)[middle].mean()) for seed in range(60)]
    return np.asarray(np.array(ratios) / float(ideal[middle].mean()))


@pytest.mark.parametrize(
    "name", ["gain_sd", *[pytest.param(other, marks=pytest.mark.slow) for other in ("force_sd", "offset_sd")]]
)
def test_errors_have_their_stated_size(name: str) -> None:
    found = scatter(name, 0.01)
    assert found.mean() == pytest.approx(1.0, abs=0.005)
    assert 0.006 < found.std() < 0.014


@pytest.mark.parametrize("name", ["pattern_sd", "repeatability_sd"])
def test_patterns_vary_over_the_face(name: str) -> None:
    answer = with_error(name, 0.02)
    ideal = virtual(0, IDEAL).light(LUMP, force_n=1.0)
    lit = ideal > 5.0
    probe = virtual(3, answer)
    first, second = (probe.light(LUMP, force_n=1.0)[lit] / ideal[lit] for _ in range(2))
    assert 0.01 < first.std() < 0.03
    if name == "pattern_sd":
        np.testing.assert_allclose(first, second, rtol=1e-12)
    else:
        assert np.abs(np.corrcoef(first, second)[0, 1]) < 0.9


def test_a_frame_says_what_it_is() -> None:
    frame = virtual(1).press(LUMP, force_n=0.5)
    assert (frame.name, frame.force_n, frame.mm_per_pixel) == ("hardness-100", 0.5, SMALL.mm_per_pixel)
    assert dict(frame.settings) == {"source": "virtual", "probe": "tsis-2011", "strain": "small"}
    assert virtual(1).press(replace(LUMP, name=""), force_n=0.5).name == "phantom"


def test_half_of_the_scale_is_filled_at_one_newton() -> None:
    light = virtual(1).press(tsis.load_phantom("plain"), force_n=1.0).grey
    assert 0.2 < np.median(light) / 255.0 < 0.6
    twelve = nominal_calibration(replace(SMALL, full_scale=4095.0))
    assert twelve.gain_grey_per_kpa == pytest.approx(60.0 * 4095 / 255)


def test_more_force_more_light() -> None:
    weak, strong = (virtual(2).press(LUMP, force_n=force).grey.sum() for force in (0.5, 1.0))
    assert strong > 1.7 * weak


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"light": 3}, "light must be an Irradiance, a LightMap or None; got 3"),
        ({"sensor": 3}, "sensor must be a Sensor; got 3"),
        ({"calibration": 3}, "calibration must be a Calibration; got 3"),
        ({"contact_model": "ruff"}, "did you mean 'rough'"),
        ({"strain": "finit"}, "did you mean 'finite'"),
        ({"strain": "finite", "resolution": COARSE}, "resolution must be a FiniteResolution; got Resolution"),
        ({"resolution": FiniteResolution()}, "resolution must be a Resolution; got FiniteResolution"),
    ],
)
def test_what_a_probe_cannot_be_made_of_is_refused(given: dict[str, Any], sentence: str) -> None:
    defaults: dict[str, Any] = {"light": LightMap.uniform(), "strain": "small"}
    with pytest.raises(InputError, match=sentence):
        VirtualProbe(PROBE, rng=np.random.default_rng(1), **(defaults | given))


def test_light_of_another_probe_is_refused() -> None:
    light = replace(irradiance(PROBE), radius_mm=5.0)
    with pytest.raises(InputError, match=r"light must be for a face of radius_mm = 12; got 5 \(trace it"):
        VirtualProbe(PROBE, rng=np.random.default_rng(1), light=light, strain="small")


@pytest.mark.parametrize("force", [0.0, -1.0, 51.0, float("nan")])
def test_a_press_needs_a_force(force: float) -> None:
    with pytest.raises(InputError, match="force_n must lie in"):
        virtual(1).press(LUMP, force_n=force)
