"""Frames of each calibration step, as a camera delivers them; targets whose scale an estimator finds again."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.calibration_force import PROBE, SENSOR
from scipy import ndimage

from tsis.calibration.force_line import loading_forces
from tsis.calibration.session import BOARD, BOARD_UNTOUCHED, DARK, EDGE, UNTOUCHED, CalibrationStep, plan_steps
from tsis.errors import InputError
from tsis.imaging.sensor import Sensor
from tsis.virtual.calibration_bench import FRAMES_PER_S, VirtualBench, ball_frame, dot_board_frame, untouched_frame

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


QUIET = Sensor(columns=240, rows=200, mm_per_pixel=(0.05, 0.06), read_noise_grey=0.0, shot_noise_grey=0.0)


def rng() -> np.random.Generator:
    return np.random.default_rng(8)


def test_dots_lie_where_the_board_and_the_pixels_say() -> None:
    """Centroids of the dots against the arithmetic of pitch over pixel size."""
    frame = dot_board_frame(QUIET, rng=rng(), pitch_mm=2.0, scatter_mm=0.0, distortion=0.0, offset_mm=(0.25, -0.3))
    change = untouched_frame(QUIET, rng=rng()).grey - frame.grey
    labels, count = ndimage.label(change > 8.0)
    centres = np.array(ndimage.center_of_mass(change, labels, range(1, count + 1)))[:, ::-1]
    whole = centres[(centres > 12).all(axis=1) & (centres < np.array([227, 187])).all(axis=1)]
    face = (whole - [119.5, 99.5]) * [0.05, 0.06] - [0.25, -0.3]
    assert len(whole) >= 12
    np.testing.assert_allclose(face, 2.0 * np.rint(face / 2.0), atol=0.01)


def test_a_turned_board_turns_from_x_to_y() -> None:
    square = Sensor(columns=240, rows=240, mm_per_pixel=(0.05, 0.05), read_noise_grey=0.0, shot_noise_grey=0.0)
    frame = dot_board_frame(square, rng=rng(), pitch_mm=3.0, angle_deg=20.0, scatter_mm=0.0, distortion=0.0)
    place = 119.5 + 60.0 * np.array([np.cos(np.radians(20.0)), np.sin(np.radians(20.0))])
    change = untouched_frame(square, rng=rng()).grey - frame.grey
    x, y = np.rint(place).astype(int)
    assert change[y, x] > 0.9 * change.max()
    assert change[240 - y, x] < 0.5 * change.max()


def test_pincushion_moves_outer_dots_outwards() -> None:
    def reach(distortion: float) -> float:
        frame = dot_board_frame(QUIET, rng=rng(), pitch_mm=2.0, scatter_mm=0.0, distortion=distortion)
        change = untouched_frame(QUIET, rng=rng()).grey - frame.grey
        row = change[96:104, 180:220].sum(axis=0)  # the last whole dot of the middle row, at 4 mm
        return float((np.arange(180, 220) * row).sum() / row.sum())

    assert reach(-0.05) > reach(0.0) + 0.5 > reach(0.05) + 1.0


def test_gaps_strays_scatter_and_sign() -> None:
    def marks(**drawn: float) -> int:
        frame = dot_board_frame(QUIET, rng=rng(), pitch_mm=2.0, **drawn)  # type: ignore[arg-type]
        change = np.abs(untouched_frame(QUIET, rng=rng()).grey - frame.grey)
        return int(ndimage.label(change > 8.0)[1])

    assert marks(missing=1.0) == 0
    assert marks(missing=1.0, strays=3) == 3
    assert 0 < marks(missing=0.5) < marks()
    bright = dot_board_frame(QUIET, rng=rng(), pitch_mm=2.0, bright=True)
    assert bright.grey.max() > 1.15 * untouched_frame(QUIET, rng=rng()).grey.max()


def test_noise_is_the_sensors() -> None:
    noisy = Sensor(columns=240, rows=200, read_noise_grey=3.0, shot_noise_grey=0.0)
    first, second = (untouched_frame(noisy, rng=np.random.default_rng(seed)).grey for seed in (1, 2))
    assert np.std(first - second) == pytest.approx(3.0 * np.sqrt(2), rel=0.03)
    np.testing.assert_array_equal(first, untouched_frame(noisy, rng=np.random.default_rng(1)).grey)


def test_a_ball_is_as_deep_and_as_wide_as_its_geometry() -> None:
    fine = Sensor(columns=400, rows=300, mm_per_pixel=(0.02, 0.03), read_noise_grey=0.0, shot_noise_grey=0.0)
    bare = untouched_frame(fine, rng=rng()).grey - fine.background_grey
    shallow, deep = (
        (ball_frame(fine, rng=rng(), ball_radius_mm=3.0, depth_mm=depth, blur_px=0.0).grey - fine.background_grey)
        / bare
        for depth in (0.4, 0.9)
    )
    # Where the deep ball is 0.4 mm deep the light is that of the shallow one's lowest point.
    reach = np.sqrt(3.0**2 - 2.5**2)
    level = shallow[149:151, 199:201].mean()
    row, column = deep[149:151].mean(axis=0), deep[:, 199:201].mean(axis=1)
    for line, size in ((row, 0.02), (column, 0.03)):
        middle = len(line) // 2
        crossing = middle + int(np.argmax(line[middle:] > level))
        assert (crossing - (len(line) - 1) / 2) * size == pytest.approx(reach, abs=2.5 * size)
    assert deep.min() < shallow.min() < 1.0


@pytest.mark.parametrize(
    ("call", "wrong"),
    [
        (dot_board_frame, {"pitch_mm": 0.0}),
        (dot_board_frame, {"missing": 1.5}),
        (dot_board_frame, {"distortion": 1.0}),
        (dot_board_frame, {"contrast": np.nan}),
        (dot_board_frame, {"blur_px": -1.0}),
        (ball_frame, {"depth_mm": 5.0}),
        (ball_frame, {"conforming": 1.0}),
        (ball_frame, {"ball_radius_mm": -1.0}),
    ],
)
def test_arguments_out_of_range(call: object, wrong: dict[str, float]) -> None:
    assert callable(call)
    with pytest.raises(InputError, match=next(iter(wrong))):
        call(QUIET, rng=rng(), **wrong)
    with pytest.raises(InputError, match="sensor"):
        call("camera", rng=rng())
