"""The rig of direct contact: its seed decides everything, its errors have the sizes that its calibration states."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.hardness.stand_ins import by_table

import tsis
from tsis.catalog.phantoms import load_sphere
from tsis.errors import InputError, MechanicsError
from tsis.hardness.reading import read_contact
from tsis.imaging.sensor import Sensor
from tsis.mechanics.finite_strain.soft_sphere import SphereResolution
from tsis.model.calibration import LightMap
from tsis.model.phantom import SoftSphere
from tsis.virtual.direct_contact import DirectContactRig, direct_contact_calibration

PROBE, SPHERE = tsis.load_probe("tsis-direct"), load_sphere("cl2003x")
SMALL = Sensor(columns=192, rows=128, mm_per_pixel=(0.13, 0.15))
EXACT = replace(
    direct_contact_calibration(SMALL, probe=PROBE),
    gain_sd=0.0,
    force_sd=0.0,
    offset_sd=0.0,
    pattern_sd=0.0,
    repeatability_sd=0.0,
    probe_young_sd=0.0,
)
IDEAL: dict[str, Any] = {"calibration": EXACT, "radius_sd_mm": 0.0, "drift_sd": 0.0, "offset_sd_mm": 0.0}


def rig_of(seed: int = 1, **options: Any) -> DirectContactRig:
    given: dict[str, Any] = {"sensor": SMALL, "solve": by_table}
    return DirectContactRig(PROBE, rng=np.random.default_rng(seed), **given | options)


def test_a_calibration_that_contradicts_the_sensor_is_refused() -> None:
    loud = replace(EXACT, read_noise_grey=4.0)
    with pytest.raises(InputError, match=r"read_noise_grey of the calibration must equal the sensor.s, 0.5; got 4"):
        rig_of(calibration=loud)
    rig = DirectContactRig(PROBE, rng=np.random.default_rng(1), calibration=loud, solve=by_table)
    assert (rig.sensor.read_noise_grey, rig.calibration) == (4.0, loud)


def test_a_seed_gives_the_same_frames_and_another_seed_others() -> None:
    first, again, other = (rig_of(seed).press(SPHERE, force_n=0.7).grey for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_frames_come_in_the_order_of_the_forces() -> None:
    frames = rig_of().press_path(SPHERE, forces_n=[1.2, 0.3, 0.7])
    assert [frame.force_n for frame in frames] == [1.2, 0.3, 0.7]
    widths = [read(frame).radius_mm for frame in frames]
    assert widths[1] < widths[2] < widths[0]


def read(frame: tsis.TactileImage, known: tsis.Calibration = EXACT) -> Any:
    return read_contact(frame, probe=PROBE, calibration=known, blur_mm=0.05)


def test_an_ideal_rig_shows_the_force_and_the_radius() -> None:
    rig = rig_of(**IDEAL)
    assert rig.stiffness == 1.0
    frame = rig.press(SPHERE, force_n=0.7)
    assert read(frame).light_force_n == pytest.approx(0.7, rel=5e-3)
    assert frame.settings["radius_mm"] == 3.0


def test_a_solved_press_shows_its_force() -> None:
    coarse = SphereResolution(order=3, cells=4, rings=2, face_cells=4)
    rig = DirectContactRig(PROBE, rng=np.random.default_rng(1), sensor=SMALL, resolution=coarse, **IDEAL)
    assert read(rig.press(SPHERE, force_n=0.5)).light_force_n == pytest.approx(0.5, rel=1e-2)


@pytest.mark.slow
def test_errors_have_their_stated_sizes() -> None:
    known = replace(EXACT, gain_sd=0.02, force_sd=0.03)
    forces, radii, written = [], [], []
    for seed in range(60):
        rig = rig_of(seed, calibration=known, drift_sd=0.0, offset_sd_mm=0.3, radius_sd_mm=0.05)
        frame = rig.press(SPHERE, force_n=0.7)
        seen = read(frame, known)
        forces.append(seen.light_force_n / 0.7 - 1)
        radii.append(np.log(seen.radius_mm))
        written.append(frame.settings["radius_mm"] - 3.0)
    assert np.std(forces) == pytest.approx(np.hypot(0.02, 0.03), rel=0.3)
    assert np.std(written) == pytest.approx(0.05, rel=0.3)
    assert 0.25 * 0.03 < np.std(radii) < 0.5 * 0.03  # the radius goes with about the third root of the force


def test_light_is_what_a_frame_shows_before_noise() -> None:
    light = rig_of(3).light(SPHERE, force_n=0.7)
    frame = rig_of(3).press(SPHERE, force_n=0.7)
    rounded_and_noisy = frame.grey - SMALL.background_grey - np.minimum(light, SMALL.full_scale - SMALL.background_grey)
    assert abs(rounded_and_noisy.mean()) < 0.05
    assert rounded_and_noisy.std() < 2.5
    assert light.max() > 30


def test_no_force_is_no_light_and_moves_no_errors() -> None:
    untouched, other = rig_of(3), rig_of(3)
    assert not untouched.light(SPHERE, force_n=0.0).any()
    np.testing.assert_array_equal(untouched.light(SPHERE, force_n=0.5), other.light(SPHERE, force_n=0.5))


@pytest.mark.parametrize("force_n", [-0.1, 5e-4, 21.0, float("nan")])
def test_light_of_an_impossible_force_is_refused(force_n: float) -> None:
    with pytest.raises(InputError, match="forces_n must"):
        rig_of().light(SPHERE, force_n=force_n)


def test_the_written_radius_belongs_to_the_sphere() -> None:
    rig = rig_of()
    first, again = (rig.press(SPHERE, force_n=force).settings["radius_mm"] for force in (0.5, 0.7))
    other = rig.press(replace(SPHERE, young_kpa=80.0), force_n=0.5).settings["radius_mm"]
    assert first == again != other


def test_a_stiffer_probe_makes_a_smaller_contact() -> None:
    doubtful = replace(EXACT, probe_young_sd=0.5)
    rigs = [rig_of(seed, **IDEAL | {"calibration": doubtful}) for seed in range(6)]
    widths = {rig.stiffness: read(rig.press(replace(SPHERE, young_kpa=900.0), force_n=1.0)).radius_mm for rig in rigs}
    assert [widths[factor] for factor in sorted(widths)] == sorted(widths.values(), reverse=True)


def test_uneven_light_is_seen() -> None:
    ends = np.linspace(-14.0, 14.0, 3)
    tilt, none = 1 + 0.04 * ends[None, :] + 0 * ends[:, None], np.zeros((3, 3))
    light = LightMap(x_mm=ends, y_mm=ends, relative=tilt, flux_x=none, flux_y=none, growth_per_mm=none, error=0.0)
    frame = rig_of(light=light, **IDEAL | {"calibration": replace(EXACT, light=light)}).press(SPHERE, force_n=0.7)
    grey = frame.grey - 8.0
    assert grey[:, 96:].sum() > 1.02 * grey[:, :96].sum()


def test_the_exposure_leaves_a_fifth_of_the_scale() -> None:
    known = direct_contact_calibration(SMALL, probe=PROBE, peak_kpa=100.0)
    full = 255.0 - SMALL.background_grey
    assert 100.0 * known.gain_grey_per_kpa == pytest.approx(0.8 * full)
    assert known.saturation_kpa == 500.0
    assert known.probe == "tsis-direct"
    soft = direct_contact_calibration(SMALL, probe=tsis.load_probe("tsis-2011"))
    assert soft.gain_grey_per_kpa > known.gain_grey_per_kpa


@pytest.mark.parametrize(
    ("sphere", "forces", "error", "words"),
    [
        (replace(SPHERE, radius_mm=8.0), [0.5], InputError, "smaller than the probe"),
        (SPHERE, [float("nan")], InputError, "finite"),
        (SPHERE, [], InputError, "must not be empty"),
        (SPHERE, [0.0], InputError, r"forces_n must lie in"),
        (PROBE, [0.5], InputError, "sphere must be a SoftSphere"),
    ],
)
def test_wrong_presses_are_refused(sphere: Any, forces: list[float], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        rig_of().press_path(sphere, forces_n=forces)


@pytest.mark.slow
def test_a_force_that_flattens_the_sphere_is_refused() -> None:
    coarse = SphereResolution(order=3, cells=4, rings=2, face_cells=4)
    rig = DirectContactRig(PROBE, rng=np.random.default_rng(1), resolution=coarse)
    with pytest.raises(MechanicsError, match="choose at most that"):
        rig.press(SoftSphere(radius_mm=2.0, young_kpa=10.0), force_n=3.0)


@pytest.mark.parametrize(
    "options", [{"radius_sd_mm": -1.0}, {"drift_sd": 2.0}, {"offset_sd_mm": -0.1}, {"light": 3}, {"resolution": 4}]
)
def test_wrong_options_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        rig_of(**options)
