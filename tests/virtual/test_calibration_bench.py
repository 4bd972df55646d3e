from __future__ import annotations

import numpy as np
import pytest
from benchmarks.calibration_force import PROBE, SENSOR

from tsis.calibration.force import loading_forces
from tsis.calibration.session import BOARD, BOARD_UNTOUCHED, DARK, EDGE, UNTOUCHED, CalibrationStep, plan_steps
from tsis.errors import InputError
from tsis.virtual.calibration_bench import FRAMES_PER_S, VirtualBench

STEPS = {step.name: step for step in plan_steps((10.0,))}


def bench(seed: int = 1) -> VirtualBench:
    return VirtualBench(PROBE, rng=np.random.default_rng(seed), sensor=SENSOR, pitch_mm=1.5)


@pytest.mark.parametrize("name", STEPS)
def test_every_step_gives_bare_frames_as_a_camera_does(name: str) -> None:
    step = STEPS[name]
    shots = list(bench().shots(step))
    assert len(shots) == (step.frames or len(loading_forces()))
    for number, shot in enumerate(shots):
        assert shot.image.grey.shape == (SENSOR.rows, SENSOR.columns)
        assert np.array_equal(shot.image.grey, np.rint(shot.image.grey))
        assert shot.image.mm_per_pixel is None
        assert shot.image.force_n is None
        assert shot.time_s == (None if step.is_loading else pytest.approx(number / FRAMES_PER_S))
        assert (shot.force_n is None) != step.is_loading
    assert not np.array_equal(shots[0].image.grey, shots[-1].image.grey) or name == BOARD


def test_light_is_as_the_instructions_say() -> None:
    taken = bench()
    middle = np.s_[80:130, 100:150]

    def light(name: str) -> float:
        return float(np.mean([shot.image.grey[middle] for shot in taken.shots(STEPS[name])]))

    dark, untouched, *flats = (light(name) for name in (DARK, UNTOUCHED, "flat-1", "flat-2", "flat-3"))
    assert dark == pytest.approx(SENSOR.background_grey, abs=0.5)
    assert dark + 1 < untouched < flats[0] < flats[1] < flats[2] < 0.9 * SENSOR.full_scale
    (edge, *_) = (shot.image.grey for shot in taken.shots(STEPS[EDGE]))
    assert edge[:, -40:].mean() > 5 * edge[:, 40:80].mean()
    board, plain = (next(taken.shots(STEPS[name])).image.grey for name in (BOARD, BOARD_UNTOUCHED))
    assert board.max() > 1.2 * plain.max()  # dots gain light


def test_a_loading_goes_up_and_back_and_the_gauge_sees_it() -> None:
    shots = list(bench().shots(STEPS["tip-10mm-1"]))
    forces = [shot.force_n for shot in shots]
    assert forces == pytest.approx(loading_forces(), abs=0.05)
    sums = np.array([shot.image.grey.sum() for shot in shots])
    assert int(np.argmax(sums)) == pytest.approx(len(shots) // 2, abs=1)


def test_a_seed_gives_the_same_bench_and_another_one_another() -> None:
    first, again, other = (next(bench(seed).shots(STEPS["flat-2"])).image.grey for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    assert bench().patch_px == bench().machine.patch_px is not None


def test_a_step_of_no_plan_is_refused() -> None:
    with pytest.raises(InputError, match="step must be one of a calibration's plan; got 'flat-9'"):
        list(bench().shots(CalibrationStep(name="flat-9", instruction="", frames=1)))
