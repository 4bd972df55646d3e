"""The line of force: exact lines, intervals against drawn errors, the budget against the sum written out."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.calibration_force import coverage, one_run
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom, linregress
from tests.calibration.bench import bench_line, even_reference, measured

from tsis.calibration.file import ProbeCalibration
from tsis.calibration.force_line import (
    ForceLine,
    Loading,
    LoadingRun,
    _residuals,
    fit_force_line,
    fit_run,
    loading_forces,
)
from tsis.calibration.frames import UsableCalibration
from tsis.calibration.measured import MeasuredValue
from tsis.errors import CalibrationError, InputError
from tsis.model.calibration import Calibration

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.calibration.camera_reference import CameraReference


SLOPE, TIPS = 4e5, (2.0, 10.0, 14.0)
FORCES = np.array(loading_forces())


def reference(*, patched: bool = True) -> CameraReference:
    some = MeasuredValue(value=0.5, sd=0.01)
    noise = dict.fromkeys(("read_noise_grey", "shot_noise_grey", "stray_grey"), some)
    patch = {"patch_px": (4, 4, 36, 36), "patch_grey": some, "lamp_sd": 4e-4} if patched else {}
    return even_reference((216, 256), dark=8.0, untouched=3.0, **noise, **patch)


def loading(
    tip_mm: float = 10.0,
    *,
    total: NDArray[np.float64] | None = None,
    force: NDArray[np.float64] = FORCES,
    shown: NDArray[np.float64] | None = None,
    run: int = 1,
    clipped: NDArray[np.float64] | None = None,
    field_noise: NDArray[np.float64] | None = None,
) -> Loading:
    sums = SLOPE * force if total is None else total
    none = np.zeros_like(force)
    return Loading(
        tip_radius_mm=tip_mm,
        force_n=force if shown is None else shown,
        total_grey=sums,
        touched=force > 0,
        field_grey=sums if field_noise is None else sums + field_noise,
        peak_grey=none,
        mean_square_mm2=none,
        clipped=none if clipped is None else clipped,
        run=run,
    )


def test_forces_of_the_procedure() -> None:
    forces = loading_forces()
    assert len(forces) == 41
    assert forces[0] == forces[-1] == 0.0
    assert max(forces) == forces[20] == 2.0
    assert np.allclose(np.abs(np.diff(forces)), 0.1)


def test_an_exact_line_is_found_exactly() -> None:
    sums = np.where(FORCES > 0, 900.0 + SLOPE * FORCES, 0.0)
    line, found = fit_force_line([loading(tip, total=sums) for tip in TIPS], reference=reference(), gauge_fraction=0.0)
    assert line.intercept_grey.value == pytest.approx(900.0, rel=1e-6)
    assert line.slope_grey_per_n.value == pytest.approx(SLOPE, rel=1e-9)
    assert line.slope_grey_per_n.sd < 1e-6 * SLOPE
    assert found.r_squared == pytest.approx(1.0)
    assert found.residual_sd_grey < 1e-3
    assert found.hysteresis is not None
    assert abs(found.hysteresis.value) < 1e-9
    assert [line.least_n, line.most_n] == pytest.approx([0.1, 2.0])


def test_the_line_of_one_run_is_that_of_linear_regression() -> None:
    rng = np.random.default_rng(1)
    sums = SLOPE * FORCES + 1e4 * rng.standard_normal(41) + 2e5
    run, good = fit_run(loading(total=sums)), FORCES > 0
    other = linregress(FORCES[good], sums[good])
    assert run.slope == pytest.approx(other.slope, rel=1e-9)
    assert run.intercept == pytest.approx(other.intercept, rel=1e-9)


def test_scatter_of_presses_has_a_constant_part_and_one_that_grows_with_the_light() -> None:
    """Residuals whose squares are exactly ``a^2 + (b light)^2``, a run of which has lost two freedoms to its line."""
    force = np.linspace(0.1, 2.0, 40)
    light = 5e4 * force
    scatter = np.sqrt((300.0**2 + (0.01 * light) ** 2) * 38 / 40) * (-1.0) ** np.arange(40)
    run = LoadingRun(
        tip_mm=10.0, force_n=force, total_grey=900 + light + scatter, rising=np.ones(40, bool), intercept=900, slope=5e4
    )
    constant, relative = _residuals([run, run], 5e4)
    assert (constant.value, relative.value) == pytest.approx((300.0, 0.01), rel=1e-6)
    assert constant.degrees_of_freedom == relative.degrees_of_freedom == 76.0


def test_the_zero_of_the_gauge_is_taken_away() -> None:
    line, _ = fit_force_line([loading(tip, shown=FORCES + 0.004) for tip in TIPS], reference=reference())
    assert abs(line.intercept_grey.value) < 1e-3


def test_millinewtons_are_refused_with_the_cure() -> None:
    with pytest.raises(InputError, match=r"newtons.*got 2000 \(millinewtons\? divide them by 1000\)"):
        loading(shown=1000 * FORCES)


def test_a_line_of_more_than_sixteen_bits_is_refused() -> None:
    line, _ = fit_force_line([loading(tip) for tip in TIPS], reference=reference())
    assert replace(line, full_scale=2.0**16 - 1).full_scale == 65535.0
    with pytest.raises(InputError, match="full_scale must lie in"):
        replace(line, full_scale=2.0**16)


def test_the_printed_line_read_in_millinewtons_is_refused() -> None:
    def sure(value: float) -> MeasuredValue:
        return MeasuredValue(value=value, sd=0.0)

    def printed(slope_grey_per_n: float) -> ForceLine:
        return ForceLine(
            intercept_grey=sure(0.056e6),
            slope_grey_per_n=sure(slope_grey_per_n),
            unit_covariance=(0.0, 0.0, 0.0),
            units=3,
            residual_grey=sure(0.0),
            residual_share=sure(0.0),
            least_n=0.1,
            most_n=2.0,
            pixels=768 * 492,
            full_scale=255.0,
            tips_mm=(2.0,),
        )

    assert printed(1.4778e6).force_n(1e6).value == pytest.approx((1e6 - 0.056e6) / 1.4778e6)
    with pytest.raises(InputError, match=r"31 times as much \(give forces in newtons"):
        printed(1000 * 1.4778e6)


def test_one_loading_is_not_enough() -> None:
    with pytest.raises(CalibrationError, match="at least 2 loadings"):
        fit_force_line([loading()], reference=reference())


@pytest.mark.parametrize(
    ("sums", "message"),
    [(-SLOPE * FORCES + 1e6, "must rise"), (np.where(FORCES > 1.9, 1e5, 0.0), "at least 4 presses")],
)
def test_sums_that_make_no_line_are_refused(sums: NDArray[np.float64], message: str) -> None:
    with pytest.raises(CalibrationError, match=message):
        fit_force_line([loading(total=sums), loading(total=sums)], reference=reference())


def test_a_gauge_that_shows_one_force_is_refused() -> None:
    with pytest.raises(CalibrationError, match="gauge showed one"):
        fit_force_line([loading(shown=np.full(41, 0.5)), loading()], reference=reference())


def test_a_force_that_any_tip_does_not_show_lies_below_the_range() -> None:
    faint = np.where(FORCES > 0.15, SLOPE * FORCES, 0.0)
    line, _ = fit_force_line([loading(2.0, total=faint), loading(10.0), loading(14.0)], reference=reference())
    assert line.least_n == pytest.approx(0.2)
    assert line.most_n == pytest.approx(2.0)


def test_clipped_presses_end_the_range() -> None:
    clipped = np.where(FORCES > 1.45, 0.02, 0.0)
    bent = np.where(FORCES > 1.45, SLOPE * 1.45, SLOPE * FORCES)
    line, found = fit_force_line([loading(2.0, total=bent, clipped=clipped), loading(10.0)], reference=reference())
    assert found.saturated
    assert line.most_n == pytest.approx(1.4)
    assert line.slope_grey_per_n.value == pytest.approx(SLOPE)


def test_forces_outside_the_range_are_refused() -> None:
    line, _ = fit_force_line([loading(tip) for tip in TIPS], reference=reference())
    for total in (SLOPE * 0.01, SLOPE * 2.5, 0.0):
        with pytest.raises(InputError, match="press within the range"):
            line.force_n(total)
    with pytest.raises(InputError):
        line.force_n(float("nan"))


def test_a_loop_is_measured_at_six_tenths_of_the_largest_force() -> None:
    def with_loop(tip: float, loop: float) -> Loading:
        down = np.arange(41) > 20
        return loading(tip, total=SLOPE * FORCES * (1 + np.where(down, loop * FORCES * (2 - FORCES), 0.0)))

    _, found = fit_force_line([with_loop(tip, 0.01 + 0.001 * k) for k, tip in enumerate(TIPS)], reference=reference())
    # of the sum F (1 + c F (2 - F)) over 2, at 1.2 N, towards unloading; 16 c / 27 where the loop is widest
    assert found.hysteresis is not None
    assert found.hysteresis.value == pytest.approx(-0.011 * 1.2**2 * 0.8 / 2, rel=0.01)
    assert found.hysteresis.interval()[1] < 0


def test_hysteresis_of_loadings_without_unloading_is_left_open() -> None:
    rising = [loading(tip, force=FORCES[:21]) for tip in TIPS]
    for loadings in (rising, [loading(2.0), *rising]):
        assert fit_force_line(loadings, reference=reference())[1].hysteresis is None


def test_tips_and_repeats_are_told_apart() -> None:
    gains = {(2.0, 1): 1.0, (2.0, 2): 1.002, (10.0, 1): 1.02, (10.0, 2): 1.022, (14.0, 1): 1.04, (14.0, 2): 1.042}
    runs = [loading(tip, total=gain * SLOPE * FORCES, run=run) for (tip, run), gain in gains.items()]
    line, found = fit_force_line(runs, reference=reference())
    assert line.units == 3
    assert found.tip_difference is not None
    assert found.tip_difference.value == pytest.approx(1.041 / 1.021 - 1)
    assert found.repeatability is not None
    # repeats 0.2 % apart: 0.2 % / sqrt 2 of the sum, root mean square over 0.1 to 2 N of the range
    rms = np.sqrt(np.mean(np.linspace(0.1, 2, 20) ** 2)) / 2
    assert found.repeatability.value == pytest.approx(0.002 / np.sqrt(2) * rms, rel=0.03)
    _, once = fit_force_line(runs[::2], reference=reference())
    assert once.repeatability is None


def test_one_tip_with_repeats_assumes_the_printed_difference_between_tips() -> None:
    line, found = fit_force_line([loading(run=1), loading(run=2)], reference=reference())
    assert line.assumed_tip_share == 0.0245
    assert found.tip_difference is None
    force = line.force_n(SLOPE)
    assert force.sd == pytest.approx(0.0245, rel=0.01)


def test_lamps_that_nothing_watches_widen_the_force() -> None:
    runs = [loading(tip, total=(1 + 0.001 * k) * SLOPE * FORCES) for k, tip in enumerate(TIPS)]
    watched, unwatched = (fit_force_line(runs, reference=reference(patched=known))[0] for known in (True, False))
    assert unwatched.drift_share == 0.01
    assert unwatched.force_n(SLOPE).sd > 2 * watched.force_n(SLOPE).sd


def test_the_smallest_force_follows_from_untouched_frames() -> None:
    rng = np.random.default_rng(2)
    noise = 400.0
    runs = [loading(tip, field_noise=noise * rng.standard_normal(41), run=k) for k in range(1, 21) for tip in TIPS]
    _, found = fit_force_line(runs, reference=reference())
    assert found.detectable_n is not None
    # 120 untouched frames: 1.645 to each side
    assert found.detectable_n.value == pytest.approx(2 * 1.6449 * noise / SLOPE, rel=0.25)
    low, high = found.detectable_n.interval(0.999)
    assert low < 2 * 1.6449 * noise / SLOPE < high


def _machine(rng: np.random.Generator, *, tip_sd: float = 0.01, wander: float = 0.003) -> list[Loading]:
    """Loadings by plain random numbers: tips, lamps that walk, scatter in proportion, a gauge zero."""
    runs, lamp = [], 1.0
    for tip in TIPS:
        gain, zero = 1 + tip_sd * rng.standard_normal(), 0.002 * rng.standard_normal()
        lamps = lamp * (1 + wander / np.sqrt(41) * np.cumsum(rng.standard_normal(41)))
        lamp = float(lamps[-1])
        sums = gain * lamps * SLOPE * FORCES * (1 + 0.002 * rng.standard_normal(41)) + 100.0 * rng.standard_normal(41)
        runs.append(loading(tip, total=sums, shown=FORCES + zero + 0.001 * rng.standard_normal(41)))
    return runs


def test_intervals_hold_although_errors_of_a_run_go_together() -> None:
    held = {"intercept": 0, "slope": 0, "force": 0}
    naive, count = 0, 200
    for seed in range(count):
        rng = np.random.default_rng(seed)
        runs = _machine(rng)
        line, _ = fit_force_line(runs, reference=reference(), gauge_fraction=0.0)
        held["intercept"] += _holds(line.intercept_grey, 0.0)
        held["slope"] += _holds(line.slope_grey_per_n, SLOPE)
        new = (1 + 0.01 * rng.standard_normal()) * (1 + 0.002 * rng.standard_normal())
        force = float(rng.uniform(0.2, 1.8))
        held["force"] += _holds(line.force_n(new * SLOPE * force), force)
        pooled = linregress(
            np.concatenate([one.load_n for one in runs]), np.concatenate([one.total_grey for one in runs])
        )
        naive += abs(pooled.slope - SLOPE) < 1.96 * pooled.stderr
    # Lamps that walk on from tip to tip make the slope's own truth move, which nobody sees without a patch.
    assert held["intercept"] / count == pytest.approx(0.95, abs=0.04)
    assert held["slope"] / count == pytest.approx(0.95, abs=0.04)
    assert held["force"] / count == pytest.approx(0.95, abs=0.04)
    assert naive / count < 0.5  # what least squares over all presses would claim


def _holds(value: MeasuredValue, truth: float) -> bool:
    low, high = value.interval()
    return low <= truth <= high


@given(scale=st.floats(1e-3, 1e3), seed=st.integers(0, 1000))
@settings(max_examples=20)
def test_forces_do_not_depend_on_the_gain_of_the_camera(scale: float, seed: int) -> None:
    runs = _machine(np.random.default_rng(seed))
    other = [replace(one, total_grey=scale * one.total_grey, field_grey=scale * one.field_grey) for one in runs]
    wide = replace(reference(), full_scale=65535.0)
    if scale * SLOPE * 2.1 > wide.full_scale * wide.dark_grey.size:
        return
    line, brighter = (fit_force_line(which, reference=wide)[0] for which in (runs, other))
    force, same = line.force_n(SLOPE), brighter.force_n(scale * SLOPE)
    assert same.value == pytest.approx(force.value, rel=1e-9)
    assert same.sd == pytest.approx(force.sd, rel=1e-4)


def test_hostile_loadings_are_refused() -> None:
    with pytest.raises(InputError, match="finite"):
        loading(shown=np.where(FORCES == 1.0, np.nan, FORCES))
    with pytest.raises(InputError, match="one number a press"):
        loading(total=np.ones(3))
    with pytest.raises(CalibrationError, match="4 presses"):
        loading(force=np.array([0.0, 0.1, 0.0]))
    with pytest.raises(InputError, match="Loading"):
        fit_force_line([loading(), "a loading"], reference=reference())  # type: ignore[list-item]


def test_the_budget_of_a_force_is_its_uncertainty() -> None:
    line = bench_line(
        unit_covariance=(4e4, 1e3, 9e6),
        residual_grey=MeasuredValue(value=300.0, sd=10.0, degrees_of_freedom=20.0, unit="grey"),
        residual_share=measured(0.01),
        assumed_tip_share=0.02,
        drift_share=0.01,
        gauge_share=0.005,
    )
    force, slope = 0.8, line.slope_grey_per_n.value
    budget = line.budget(force)
    units = (4e4 + 2e3 * force + 9e6 * force**2) * (1 + 1 / line.units) / slope**2
    others = (300.0 / slope) ** 2 + force**2 * (0.01**2 + 0.02**2 + 0.01**2 + 0.005**2)
    assert budget.combined == pytest.approx(math.sqrt(units + others))
    assert (line.with_uncertainty(force).sd, line.with_uncertainty(force).degrees_of_freedom) == (
        budget.combined,
        budget.degrees_of_freedom,
    )
    low, high = line.with_uncertainty(force).interval(0.95)
    assert budget.expanded == pytest.approx((high - low) / 2)
    assert [part.evaluation for part in budget.components] == ["A", "A", "A", "B", "B", "B"]
    assert budget.components[-1].sensitivity == pytest.approx(force)


def test_a_force_on_soft_tissue_spreads_as_its_line_and_ratio_drawn_at_random() -> None:
    ratio = MeasuredValue(value=0.8, sd=0.02, degrees_of_freedom=9.0)
    line = bench_line(soft_ratio=ratio)
    total = 900.0 + 1e5 * 0.6
    tips, soft = line.force_n(total), line.soft_force_n(total)
    rng = np.random.default_rng(24)
    drawn = rng.normal(tips.value, tips.sd, 200_000) / rng.normal(ratio.value, ratio.sd, 200_000)
    assert soft.value == pytest.approx(0.6 / 0.8)
    assert soft.sd == pytest.approx(drawn.std(), rel=0.02)
    assert min(tips.degrees_of_freedom, 9.0) <= soft.degrees_of_freedom <= tips.degrees_of_freedom + 9.0
    assert bench_line().soft_force_n(total) == tips


def test_a_stated_force_has_the_uncertainty_of_the_response() -> None:
    response = Calibration(gain_grey_per_kpa=60.0, saturation_kpa=20.0, force_sd=0.02)
    usable = UsableCalibration(calibration=ProbeCalibration(name="rig", response=response), identity="0" * 64)
    budget = usable.force_budget(1.5, by_line=False)
    assert budget.combined == pytest.approx(0.03)
    assert (budget.unit, len(budget.components)) == ("N", 1)
    with pytest.raises(CalibrationError, match="needs the part 'force_line'"):
        usable.force_budget(1.5, by_line=True)


RUNS = 60
# Half of the 95 % interval over the truth, in the median: about twice what it is, for wide intervals are no answer.
WIDEST_HALF = {
    "intercept": 8.0,  # whose truth is next to nothing
    "slope": 0.045,
    "read noise": 0.005,
    "shot noise": 0.008,
    "gain": 0.045,
    "hysteresis": 2.0,  # of loops of a few tenths of a per cent
    "saturation": 0.4,
    "force of a new frame": 0.06,
}


@pytest.mark.slow
def test_intervals_of_a_whole_calibration_hold_the_truth() -> None:
    trials = [one for seed in range(RUNS) for one in one_run(np.random.default_rng(9000 + seed))]
    found = coverage(trials)
    assert set(found) == set(WIDEST_HALF)
    for name, (share, count, width) in found.items():
        assert count >= RUNS
        # 52 of 60 or fewer would have a chance of 1 in 100 if intervals held in 95 % of runs
        assert share >= binom.ppf(0.01, count, 0.95) / count, name
        assert width < WIDEST_HALF[name], name


def test_one_calibration_from_the_first_frame_to_a_new_force() -> None:
    trials = one_run(np.random.default_rng(5))
    assert {one.quantity for one in trials} == set(WIDEST_HALF)
    forces = [one for one in trials if one.quantity == "force of a new frame"]
    assert all(abs(one.value / one.truth - 1) < 0.06 for one in forces)
    gain = next(one for one in trials if one.quantity == "gain")
    assert gain.value == pytest.approx(gain.truth, rel=0.03)
