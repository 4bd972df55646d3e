from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tsis.calibration.lamps import ReferencePatch, drift_corrected, fit_warm_up, patch_ratio
from tsis.errors import CalibrationError, ImageMismatchError, InputError
from tsis.imaging.sensor import LedDrift
from tsis.model.image import TactileImage

CORNER = ReferencePatch(first_row=0, last_row=20, first_column=60, last_column=80)


def frame(lamps: float, seed: int, *, dark: float = 8.0, noise: float = 1.0) -> TactileImage:
    light = 60.0 + 40.0 * np.linspace(0.0, 1.0, 80)[None, :] * np.ones((60, 1))
    grey = dark + lamps * light + noise * np.random.default_rng(seed).standard_normal(light.shape)
    return TactileImage(grey=np.clip(np.rint(grey), 0.0, 255.0))


def test_the_ratio_is_that_of_the_lamps_within_its_own_interval() -> None:
    held = 0
    for seed in range(300):
        found = patch_ratio(frame(1.04, 2 * seed), frame(1.0, 2 * seed + 1), patch=CORNER, dark_grey=8.0)
        low, high = found.interval(0.95)
        held += low < 1.04 < high
    assert 0.90 < held / 300 < 0.99


def test_a_corrected_frame_is_that_of_the_reference_lamps() -> None:
    ratio = patch_ratio(frame(1.07, 1, noise=0.0), frame(1.0, 2, noise=0.0), patch=CORNER, dark_grey=8.0)
    mended = drift_corrected(frame(1.07, 1, noise=0.0), ratio, dark_grey=8.0)
    assert np.abs(mended.grey - frame(1.0, 2, noise=0.0).grey).max() < 1.1  # two roundings


@given(ratio=st.floats(0.5, 2.0), dark=st.floats(0.0, 20.0))
@settings(max_examples=30)
def test_correcting_undoes_drift_above_the_dark_level(ratio: float, dark: float) -> None:
    light = np.linspace(1.0, 100.0, 64).reshape(8, 8)
    mended = drift_corrected(TactileImage(grey=dark + ratio * light), ratio, dark_grey=dark)
    np.testing.assert_allclose(mended.grey, dark + light, rtol=1e-9, atol=1e-9)


def test_patches_that_cannot_follow_the_lamps_are_refused() -> None:
    lit = frame(1.0, 1)
    with pytest.raises(InputError, match="lit by at least"):
        patch_ratio(lit, TactileImage(grey=np.full((60, 80), 9.0)), patch=CORNER, dark_grey=8.0)
    with pytest.raises(InputError, match="clipped"):
        patch_ratio(TactileImage(grey=np.full((60, 80), 255.0)), lit, patch=CORNER)
    with pytest.raises(InputError, match="inside the frame"):
        patch_ratio(lit, lit, patch=ReferencePatch(first_row=50, last_row=70, first_column=0, last_column=20))
    with pytest.raises(ImageMismatchError):
        patch_ratio(lit, TactileImage(grey=np.ones((10, 10))), patch=CORNER)
    with pytest.raises(InputError, match="ratio"):
        drift_corrected(lit, 0.0)


def test_sixteen_pixels_make_a_patch() -> None:
    assert ReferencePatch(first_row=0, last_row=4, first_column=0, last_column=4).pixels == 16
    with pytest.raises(InputError, match="at least 16 pixels; got 15"):
        ReferencePatch(first_row=0, last_row=3, first_column=0, last_column=5)


@pytest.mark.parametrize("wrong", [{"first_row": -1}, {"last_row": 0}, {"first_column": 2.5}, {"last_column": 2}])
def test_ends_of_a_patch_are_checked(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError):
        ReferencePatch(**{"first_row": 0, "last_row": 4, "first_column": 0, "last_column": 4, **wrong})  # type: ignore[arg-type]


def test_intervals_of_warming_up_hold_the_truth_though_lamps_wander() -> None:
    time, held, enough, count = np.arange(0.0, 2400.0, 20.0), 0, 0, 120
    for child in np.random.SeedSequence(4).spawn(count):
        rng = np.random.default_rng(child)
        size, tau = rng.uniform(0.02, 0.08), rng.uniform(120.0, 600.0)
        lamps = LedDrift(warm_up=size, warm_up_s=tau, wander=0.005).factors(time, rng)
        found = fit_warm_up(time, lamps * (1 + 5e-4 * rng.standard_normal(time.size)))
        low, high = found.amplitude.interval(0.95)
        held += low <= size <= high
        low, high = found.time_constant_s.interval(0.95)
        held += low <= tau <= high
        enough += found.wait_s(0.01) >= tau * np.log(size / 0.01)
    assert 0.90 <= held / (2 * count) <= 0.99
    assert enough >= 0.93 * count


def test_without_noise_the_numbers_are_those_put_in() -> None:
    time = np.arange(0.0, 2000.0, 10.0)
    found = fit_warm_up(
        time, 1.02 * LedDrift(warm_up=0.05, warm_up_s=300.0, wander=0.0).factors(time, np.random.default_rng())
    )
    assert found.amplitude.value == pytest.approx(0.05, rel=1e-3)
    assert found.time_constant_s.value == pytest.approx(300.0, rel=1e-2)
    assert found.level.value == pytest.approx(1.02, rel=1e-5)
    assert found.wait_s(0.01, now_s=100.0) == pytest.approx(300.0 * np.log(5.0) - 100.0, rel=0.03)


def test_steady_lamps_need_no_waiting() -> None:
    time = np.arange(0.0, 1200.0, 10.0)
    found = fit_warm_up(time, 1 + 1e-4 * np.random.default_rng(2).standard_normal(time.size))
    assert found.wait_s(0.01) == 0.0


def test_a_record_that_ends_too_early_is_refused() -> None:
    time = np.arange(0.0, 60.0, 1.0)
    with pytest.raises(CalibrationError, match="record longer"):
        fit_warm_up(time, 1 + 0.05 * np.exp(-time / 600.0) + 1e-6 * np.random.default_rng(1).standard_normal(time.size))


@pytest.mark.parametrize(
    ("time", "ratio"),
    [
        (np.arange(5.0), np.ones(5)),
        (np.arange(20.0)[::-1], np.ones(20)),
        (np.arange(20.0) - 1, np.ones(20)),
        (np.arange(20.0), np.zeros(20)),
        (np.arange(20.0), np.full(20, np.nan)),
        (np.arange(20.0), np.ones(19)),
    ],
)
def test_series_that_cannot_be_fitted_are_refused(time: np.ndarray, ratio: np.ndarray) -> None:
    with pytest.raises(InputError):
        fit_warm_up(time, ratio)
