from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tsis
from tsis.calibration.guard.watch import PressHistory
from tsis.calibration.settling import BINS, DecayFit, assess_settling
from tsis.errors import InputError
from tsis.mechanics.small_strain.relaxation import relaxing_press, settling_time_s
from tsis.model.phantom import Relaxation

RATE_HZ = 30.0


def fading(
    amplitudes: list[float], taus: list[float], until_s: float, noise: float, seed: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """A standard linear solid, or several: the settled value is 1."""
    time = np.arange(0.0, until_s, 1 / RATE_HZ)
    value = 1 + sum(size * np.exp(-time / tau) for size, tau in zip(amplitudes, taus, strict=True))
    return time, value + noise * np.random.default_rng(seed).standard_normal(time.size)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_remaining_change_of_a_standard_linear_solid_is_that_of_its_closed_form(sign: float) -> None:
    time, value = fading([0.3 * sign], [4.0], 10.0, 1e-3)
    left = 0.3 * sign * np.exp(-time[-1] / 4.0)
    found = assess_settling(time, value)
    assert found.verdict == "settling"
    low, high = found.remaining.interval(0.95)
    assert low < -left / (1 + left) < high
    assert found.remaining.value == pytest.approx(-left / (1 + left), abs=0.01)
    assert found.wait_s == pytest.approx(4.0 * np.log(0.3 / 0.01) - time[-1], rel=0.3)


def test_without_noise_the_waiting_time_is_that_of_the_closed_form() -> None:
    time, value = fading([0.3], [4.0], 10.0, 0.0)
    assert assess_settling(time, value).wait_s == pytest.approx(4.0 * np.log(0.3 / 0.01) - time[-1], rel=0.05)


def test_two_exponentials_are_told_apart() -> None:
    found = [assess_settling(*fading([0.3, 0.1], [1.0, 15.0], 20.0, 1e-3, seed)) for seed in range(20)]
    left = 0.1 * np.exp(-20.0 / 15.0)
    assert np.median([one.remaining.value for one in found]) == pytest.approx(-left / (1 + left), rel=0.3)
    assert sum(one.bound < left / (1 + left) for one in found) <= 2  # its certainty is 95 %


def test_a_long_plateau_is_settled_and_one_of_a_second_is_not_known_to_be() -> None:
    assert assess_settling(*fading([0.2], [1.0], 30.0, 1e-3)).settled
    short = assess_settling(*fading([0.0], [1.0], 1.0, 1e-3))
    assert short.verdict == "cannot tell"
    assert short.wait_s is None


def test_how_long_a_plateau_must_be_depends_on_the_longest_time_constant() -> None:
    plateau = fading([0.0], [1.0], 3.0, 1e-3)
    assert assess_settling(*plateau, longest_s=2.0).settled
    assert assess_settling(*plateau, longest_s=1000.0).verdict == "cannot tell"


def test_noise_that_hides_the_trend_leaves_it_unknown() -> None:
    assert assess_settling(*fading([0.3], [4.0], 8.0, 0.3)).verdict == "cannot tell"


def test_a_travel_before_the_hold_does_not_spoil_the_answer() -> None:
    time = np.arange(0.0, 40.0, 1 / RATE_HZ)
    held = np.where(time < 2.0, time / 2.0, 1 + 0.2 * np.exp(-(time - 2.0) / 3.0))
    value = held + 1e-3 * np.random.default_rng(3).standard_normal(time.size)
    assert assess_settling(time, value).settled


def test_settled_presses_are_seen_and_hardly_one_is_called_settled_too_early() -> None:
    """Against the mechanics of probe and tissue, whose course is many exponentials and no fit."""
    probe, phantom = tsis.load_probe("tsis-2011"), tsis.load_phantom("plain")
    early = said = 0
    for child in np.random.SeedSequence(5).spawn(25):
        rng = np.random.default_rng(child)
        tissue = Relaxation(shares=(rng.uniform(0.1, 0.5),), times_s=(float(np.exp(rng.uniform(-1.0, 2.3))),))
        true = settling_time_s(probe, phantom, tissue, approach_mm=1.0, ramp_s=0.5)
        time = np.arange(0.05, 3 * true + 40.0, 0.05)
        force = relaxing_press(probe, phantom, tissue, approach_mm=1.0, time_s=time, ramp_s=0.5).force_n
        noisy = force * (1 + 2e-3 * rng.standard_normal(time.size))
        for until in np.geomspace(1.0, time[-1], 25):
            upto = int(until / 0.05)
            if assess_settling(time[:upto], noisy[:upto]).settled:
                said += 1
                early += bool(time[upto - 1] < true)
                break
    assert said == 25
    assert early <= 2


@pytest.mark.parametrize(
    ("time", "value", "wrong"),
    [
        ([0.0, 1.0, 1.0], [1.0, 1.0, 1.0], "ascend"),
        ([0.0, 2.0, 1.0], [1.0, 1.0, 1.0], "ascend"),
        ([0.0, 1.0, np.nan], [1.0, 1.0, 1.0], "finite"),
        ([0.0, 1.0, 2.0], [1.0, np.inf, 1.0], "finite"),
        ([0.0, 1.0], [1.0, 1.0, 1.0], "one length"),
        ([], [], "empty"),
    ],
)
def test_series_that_are_none_are_refused(time: list[float], value: list[float], wrong: str) -> None:
    with pytest.raises(InputError, match=wrong):
        assess_settling(time, value)


def test_a_value_that_crosses_zero_has_no_share_to_settle_to() -> None:
    time = np.arange(0.0, 10.0, 0.1)
    assert assess_settling(time, np.sin(time)).verdict == "cannot tell"
    noise = 1e-3 * np.random.default_rng(1).standard_normal(time.size)
    # Exponentials both: one ends beyond zero, with another sign than most of it, the other begins there.
    assert assess_settling(time, np.exp(-time / 2.0) - 0.1 + noise).verdict == "cannot tell"
    assert assess_settling(time, 1.0 - 1.5 * np.exp(-time / 0.5) + noise).settled


@given(
    steps=st.lists(st.floats(1e-3, 1e3), min_size=1, max_size=60),
    values=st.lists(st.floats(-1e6, 1e6) | st.integers(0, 255), min_size=60, max_size=60),
)
@settings(max_examples=60)
def test_any_finite_series_gets_a_verdict(steps: list[float], values: list[float]) -> None:
    found = assess_settling(np.cumsum(steps), values[: len(steps)])
    assert found.verdict in ("settled", "settling", "cannot tell")
    assert 0.0 <= found.bound <= 1.0
    assert (found.wait_s is None) == (found.verdict == "cannot tell")


def test_a_constant_series_is_settled_when_it_is_long_and_its_step_is_known() -> None:
    time, value = np.arange(600) / 5.0, np.full(600, 42.0)
    assert assess_settling(time, value, step=0.01).settled
    assert not assess_settling(time[:50], value[:50], step=0.1).settled
    assert assess_settling(time, value, step=1.0).verdict == "cannot tell"  # 2.4 % may hide below a step
    assert assess_settling(time, value).verdict == "cannot tell"


@pytest.mark.parametrize("step", [0.001, 0.002, 0.005, 0.01])
@pytest.mark.parametrize("noise", [0.0, 3e-4, 1e-3])
def test_steps_of_a_display_hide_no_slow_fall(step: float, noise: float) -> None:
    """Four per cent in 80 s: at each of these times more than two are still to come."""
    for until in (3.0, 5.0, 8.0, 12.0, 20.0, 30.0, 40.0):
        time = np.arange(0.0, until, 0.1)
        for seed in range(4):
            scatter = noise * np.random.default_rng(seed).standard_normal(time.size)
            shown = np.round((1 - 0.04 * (1 - np.exp(-time / 80.0)) + scatter) / step) * step
            assert not assess_settling(time, shown).settled


@given(step=st.floats(5e-4, 2e-2), size=st.floats(0.02, 0.1), tau=st.floats(5.0, 100.0), seed=st.integers(0, 1000))
@settings(max_examples=60)
def test_a_display_says_settled_before_it_is_hardly_ever(step: float, size: float, tau: float, seed: int) -> None:
    until = tau * np.log(size / 0.012)  # a fifth more than the tolerance is still to come
    if until < 2.0:
        return
    time = np.arange(0.0, until, 0.1)
    scatter = 0.2 * step * np.random.default_rng(seed).standard_normal(time.size)
    assert not assess_settling(time, np.round((1 + size * np.exp(-time / tau) + scatter) / step) * step).settled


def test_a_fine_display_lets_a_long_plateau_settle() -> None:
    time, value = fading([0.2], [1.0], 40.0, 5e-4)
    found = assess_settling(time, np.round(value, 3))
    assert found.settled
    assert found.bound >= 0.001  # a step


@given(scale=st.floats(1e-3, 1e6), unit_s=st.floats(0.5, 3.0), seed=st.integers(0, 50))
@settings(max_examples=25)
def test_the_unit_of_the_value_and_that_of_time_do_not_matter(scale: float, unit_s: float, seed: int) -> None:
    time, value = fading([0.3], [4.0], 12.0, 2e-3, seed)
    one, other = assess_settling(time, value), assess_settling(time * unit_s, value * scale, longest_s=100.0 * unit_s)
    assert one.verdict == other.verdict
    assert other.bound == pytest.approx(one.bound, rel=1e-2)


def test_the_interval_of_what_may_fade_holds_it_as_often_as_it_says() -> None:
    held = 0
    for seed in range(200):
        time, value = fading([0.2], [3.0], 5.0, 5e-3, seed)
        fit = DecayFit(time, value, tau_range_s=(1 / RATE_HZ, 100.0)).decay(5e-3, deviations=1.96)
        held += fit.low <= 0.2 * np.exp(-time[-1] / 3.0) <= fit.high
    assert held >= 0.93 * 200  # amplitudes of one sign make it wider than it says, never shorter


@given(st.lists(st.floats(0.5, 1.5), min_size=1, max_size=700))
@settings(max_examples=50)
def test_the_history_is_bounded_and_keeps_the_mean_of_what_it_holds(values: list[float]) -> None:
    history = PressHistory()
    level = 100.0 + 0.01 * np.array(values)  # no step that begins another press
    for number, value in enumerate(level.tolist()):
        history = history.with_sample(float(number), value)
    assert len(history.time_s) == len(history.value) <= BINS
    held = history.per_bin * len(history.value)
    assert held + history.open_count == len(values)
    if held:
        assert np.mean(history.value) == pytest.approx(level[:held].mean(), rel=1e-12)
        assert np.mean(history.time_s) == pytest.approx((held - 1) / 2)


def test_a_step_or_a_time_that_runs_back_begins_another_press() -> None:
    history = PressHistory()
    for number in range(40):
        history = history.with_sample(float(number), 100.0)
    assert len(history.with_sample(40.0, 110.0).value) == 1
    assert len(history.with_sample(39.0, 100.0).value) == 1
