"""Outputs of a press: closed forms, conservation of force, what remains of them as printed; lines beside SciPy's."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.stats import linregress

import tsis
from tsis.errors import ImageMismatchError, InputError, UnknownNameError
from tsis.inclusion.network import (
    change_reading,
    fit_mapping,
    frame_outputs,
    leave_one_out_mapping,
    printed_frame_outputs,
    printed_reading,
    simulated_outputs,
)
from tsis.inclusion.network_training import train_network
from tsis.mechanics import press
from tsis.model.calibration import Calibration, LightMap
from tsis.model.image import TactileImage
from tsis.model.phantom import Inclusion, Phantom

if TYPE_CHECKING:
    from tsis.mechanics.surrogate.polynomial import PressSurrogate


PROBE = tsis.load_probe("tsis-2011")
FLAT = Calibration(name="flat light", gain_grey_per_kpa=60.0, saturation_kpa=20.0, background_grey=8.0)


@given(height=st.floats(0.5, 5.0), width=st.floats(1.5, 4.0), level=st.floats(0.1, 0.4))
def test_a_bell_has_the_outputs_of_its_closed_form(height: float, width: float, level: float) -> None:
    reading = change_reading(extent_mm=10.0, threshold_fraction=level)
    inner, outer = reading.edges_mm[:-1], reading.edges_mm[1:]
    ends = np.exp(-(np.array([inner, outer]) ** 2) / width**2)
    bell = height * width**2 * (ends[0] - ends[1]) / (outer**2 - inner**2)  # exact ring means
    greatest, total, area = reading((1.0 + bell)[None], np.ones(len(bell)))[0]
    assert greatest == pytest.approx(bell[0])
    assert total == pytest.approx(np.pi * height * width**2 * (1 - ends[1][-1]))
    # Three rings a width: a press under 4 mm of tissue makes nothing narrower.
    outline, ring = width * np.sqrt(np.log(height / level)), outer[0] - inner[0]
    assert np.sqrt(area / np.pi) == pytest.approx(outline, abs=0.1 * ring)


def test_the_total_as_printed_is_the_force_whatever_is_pressed(surrogate: PressSurrogate) -> None:
    inclusions = np.random.default_rng(0).uniform([1, 4, 40], [15, 12, 120], (30, 3))
    _, total, area = simulated_outputs(surrogate, inclusions, printed_reading(PROBE), field="pressure_kpa").T
    assert_allclose(total, 1000.0 * surrogate.force_n, rtol=0.01)  # mN
    assert np.ptp(total) < 2e-3 * total.mean()
    assert_allclose(area, np.pi * PROBE.radius_mm**2)


def test_of_displacement_too_only_the_change_tells_inclusions_apart(surrogate: PressSurrogate) -> None:
    inclusions = np.random.default_rng(0).uniform([1, 4, 40], [15, 12, 120], (100, 3))

    def variation(outputs: np.ndarray) -> np.ndarray:
        return np.asarray(outputs.std(axis=0) / outputs.mean(axis=0))

    printed = variation(simulated_outputs(surrogate, inclusions, printed_reading(PROBE)))
    change = variation(simulated_outputs(surrogate, inclusions, change_reading()))
    assert (change > 0.5).all()
    assert (printed < [0.1, 0.002, 1e-9]).all()


def test_as_printed_no_network_can_be_trained(surrogate: PressSurrogate) -> None:
    inclusions = np.random.default_rng(0).uniform([1, 4, 40], [15, 12, 120], (30, 3))
    outputs = simulated_outputs(surrogate, inclusions, printed_reading(PROBE))
    with pytest.raises(InputError, match="inputs must vary in every column"):
        train_network(outputs, inclusions, rng=np.random.default_rng(0))


def test_outputs_rise_with_size_and_stiffness_and_fall_with_depth(surrogate: PressSurrogate) -> None:
    base = np.array([8.0, 6.0, 70.0])
    for column, sign in enumerate((1, -1, 1)):
        line = np.tile(base, (5, 1))
        line[:, column] *= np.linspace(0.8, 1.25, 5)
        steps = np.diff(simulated_outputs(surrogate, line, change_reading()), axis=0)
        assert (sign * steps > 0).all(), "as the source says of figure 6.18"


def test_simulated_outputs_are_those_of_the_press_itself(surrogate: PressSurrogate) -> None:
    slab = Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=Inclusion(diameter_mm=9.0, depth_mm=5.0, young_kpa=80.0))
    with_it, without = (press(PROBE, one, force_n=1.0) for one in (slab, slab.without_inclusion()))
    radius = np.linspace(0.0, 8.0, 4001)
    change = np.interp(radius, with_it.radius_mm, with_it.face_displacement_mm) - np.interp(
        radius, without.radius_mm, without.face_displacement_mm
    )
    greatest, total, _ = simulated_outputs(surrogate, [[9.0, 5.0, 80.0]], change_reading())[0]
    assert greatest == pytest.approx(change.max(), rel=0.01)
    assert total == pytest.approx(np.trapezoid(2 * np.pi * radius * change, radius), rel=0.01)


def _frame(level: float, bump: float = 0.0, *, force_n: float | None = 1.0) -> TactileImage:
    """A round bump of 3 mm on even light, on the default field of view at a coarser scale."""
    y, x = np.mgrid[:480, :640]
    radius = np.hypot(x - 319.5, y - 239.5) * 0.04
    grey = 8.0 + level + bump * np.exp(-(radius**2) / 9.0)
    return TactileImage(grey=grey, mm_per_pixel=(0.04, 0.04), force_n=force_n)


def test_frames_have_the_outputs_of_the_bump_in_them() -> None:
    reading = change_reading(threshold_fraction=0.2)
    greatest, total, area = frame_outputs([_frame(100.0, 50.0)], _frame(100.0), reading, calibration=FLAT)[0]
    assert greatest == pytest.approx(50.0, rel=0.02)
    assert total == pytest.approx(50.0 * np.pi * 9.0 * (1 - np.exp(-64 / 9)), rel=0.005)
    assert area == pytest.approx(np.pi * 9.0 * np.log(50.0 / 20.0), rel=0.03)


def test_a_brighter_press_scales_greatest_and_total_and_leaves_the_area() -> None:
    once, twice = (
        frame_outputs([_frame(k * 60.0, k * 30.0)], _frame(k * 60.0), change_reading(), calibration=FLAT)[0]
        for k in (1, 2)
    )
    assert_allclose(twice, once * [2, 2, 1], rtol=1e-6)


def test_uneven_light_that_the_calibration_knows_changes_no_output() -> None:
    ends = np.linspace(-13.0, 13.0, 27)
    relative = 1.0 + 0.03 * ends[None, :] + 0.002 * (ends[:, None] ** 2 - 60.0)
    none = np.zeros_like(relative)
    light = LightMap(x_mm=ends, y_mm=ends, relative=relative, flux_x=none, flux_y=none, growth_per_mm=none, error=0.0)
    x, y = (np.arange(640) - 319.5) * 0.04, (np.arange(480) - 239.5) * 0.04

    def lit(frame: TactileImage) -> TactileImage:
        return replace(frame, grey=8.0 + (frame.grey - 8.0) * light.at(x, y))

    plain, pressed = _frame(60.0), _frame(60.0, 30.0)
    even = frame_outputs([pressed], plain, change_reading(), calibration=FLAT)
    known = frame_outputs([lit(pressed)], lit(plain), change_reading(), calibration=replace(FLAT, light=light))
    assert_allclose(known, even, rtol=0.01)
    bright = 3.0
    burnt = [
        replace(lit(one), grey=np.minimum(8.0 + bright * (lit(one).grey - 8.0), 255.0)) for one in (pressed, plain)
    ]
    assert (burnt[1].grey == 255.0).any()
    left = frame_outputs(burnt[:1], burnt[1], change_reading(), calibration=replace(FLAT, light=light))
    assert_allclose(left, even * [bright, bright, 1.0], rtol=0.01)
    unknown = frame_outputs([lit(pressed)], lit(plain), change_reading(), calibration=FLAT)
    assert unknown[0, 0] < 0.9 * even[0, 0]


def test_printed_outputs_of_a_frame_are_centroid_sum_and_count() -> None:
    frame = _frame(0.0, 50.0)
    shifted = replace(frame, grey=np.roll(frame.grey, (20, -30), axis=(0, 1)) - 8.0)
    greatest, total, count = printed_frame_outputs(shifted, threshold_grey=25.0)[0]
    assert greatest == pytest.approx(50.0, rel=1e-3)
    assert total * 0.04**2 == pytest.approx(50.0 * np.pi * 9.0, rel=1e-3)
    assert count * 0.04**2 == pytest.approx(np.pi * 9.0 * np.log(2.0), rel=0.01)


def test_frames_that_cannot_be_read_are_refused() -> None:
    reading, plain = change_reading(), _frame(100.0)
    with pytest.raises(InputError, match="without"):
        frame_outputs([_frame(100.0, 200.0)], plain, reading, calibration=FLAT)
    far = replace(reading, edges_mm=np.linspace(0.0, 20.0, 31))
    with pytest.raises(InputError, match="to 20 mm must have lit pixels"):
        frame_outputs([_frame(90.0)], plain, far, calibration=FLAT)
    with pytest.raises(InputError, match="force_n must be known"):
        frame_outputs([_frame(90.0, force_n=None)], plain, reading, calibration=FLAT)
    with pytest.raises(InputError, match="same for all"):
        frame_outputs([_frame(90.0, force_n=2.0)], plain, reading, calibration=FLAT)
    with pytest.raises(InputError, match="a frame at least"):
        frame_outputs([], plain, reading, calibration=FLAT)
    with pytest.raises(ImageMismatchError, match="mm_per_pixel"):
        frame_outputs([replace(plain, mm_per_pixel=(0.05, 0.05))], plain, reading, calibration=FLAT)
    with pytest.raises(InputError, match="hold light"):
        printed_frame_outputs(replace(plain, grey=np.zeros((4, 4))), threshold_grey=3.0)


def test_simulations_outside_the_box_are_refused(surrogate: PressSurrogate) -> None:
    reading = change_reading()
    with pytest.raises(InputError, match="diameter_mm"):
        simulated_outputs(surrogate, [[16.0, 5.0, 80.0]], reading)
    with pytest.raises(InputError, match="columns diameter_mm"):
        simulated_outputs(surrogate, [[9.0, 5.0]], reading)
    with pytest.raises(InputError, match="thickness_mm"):
        simulated_outputs(surrogate, [[9.0, 5.0, 80.0]], reading, thickness_mm=50.0)
    with pytest.raises(InputError, match="extent"):
        simulated_outputs(surrogate, [[9.0, 5.0, 80.0]], change_reading(extent_mm=13.0))
    with pytest.raises(UnknownNameError, match="pressure_kpa"):
        simulated_outputs(surrogate, [[9.0, 5.0, 80.0]], reading, field="pressure")
    with pytest.raises(InputError, match="surrogate must be a PressSurrogate"):
        simulated_outputs(surrogate.pressure_kpa, [[9.0, 5.0, 80.0]], reading)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="ascending"):
        replace(reading, edges_mm=np.array([0.0, 2.0, 1.0]))
    with pytest.raises(InputError, match="20 rings"):
        reading(np.ones((2, 5)), np.ones(5))


@pytest.fixture
def tables() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(4)
    measured = rng.normal(100.0, 30.0, (9, 3))
    return measured, measured * [0.1, -2.0, 5.0] + rng.normal(0.0, 4.0, (9, 3))


def test_each_column_has_the_line_that_scipy_fits(tables: tuple[np.ndarray, np.ndarray]) -> None:
    mapping = fit_mapping(*tables)
    for column in range(3):
        peer = linregress(tables[0][:, column], tables[1][:, column])
        assert mapping.slope[column] == pytest.approx(peer.slope)
        assert mapping.intercept[column] == pytest.approx(peer.intercept)
        assert mapping.r_squared[column] == pytest.approx(peer.rvalue**2)


def test_an_inclusions_own_simulation_does_not_move_its_mapped_outputs(
    tables: tuple[np.ndarray, np.ndarray],
) -> None:
    measured, simulated = tables
    before = leave_one_out_mapping(measured, simulated)
    assert_allclose(before[2], fit_mapping(np.delete(measured, 2, 0), np.delete(simulated, 2, 0))(measured[[2]])[0])
    changed = simulated.copy()
    changed[2] += 1000.0
    after = leave_one_out_mapping(measured, changed)
    assert_allclose(after[2], before[2])
    assert (np.abs(np.delete(after - before, 2, axis=0)) > 1e-3).all()


def test_points_on_a_line_come_back(tables: tuple[np.ndarray, np.ndarray]) -> None:
    line = 3.0 - 2.0 * tables[0]
    assert_allclose(leave_one_out_mapping(tables[0], line), line)
    assert_allclose(fit_mapping(tables[0], line).r_squared, 1.0)


def test_tables_that_fit_no_line_are_refused() -> None:
    with pytest.raises(InputError, match="one shape"):
        fit_mapping([[1.0], [2.0]], [[1.0]])
    with pytest.raises(InputError, match="must vary"):
        fit_mapping([[1.0], [1.0]], [[1.0], [2.0]])
    with pytest.raises(InputError, match="three rows"):
        leave_one_out_mapping([[1.0], [2.0]], [[1.0], [2.0]])
