"""The guard on one frame and on a stream, with and without a calibration."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.calibration.bench import bench, bench_reference

import tsis
from tsis.calibration.frames import UsableCalibration
from tsis.calibration.guard.limits import GuardLimits
from tsis.calibration.guard.reading import FrameShape, GuardReference, prepare_reference, read_guard_frame
from tsis.calibration.guard.watch import (
    PressWatch,
    WatchState,
    check_press,
    flicker_amplitude,
    guard_reference,
    press_watch,
    with_calibrated_scale,
)
from tsis.calibration.lamps import ReferencePatch
from tsis.calibration.settling import assess_settling
from tsis.catalog.probes import load_probe
from tsis.errors import ImageMismatchError, InputError
from tsis.instrument.camera import Frame
from tsis.model.image import TactileImage
from tsis.virtual.probe import VirtualProbe

ROWS, COLUMNS, RADIUS_PX, DARK = 246, 384, 60.0, 8.0
LIT = ReferencePatch(first_row=0, last_row=16, first_column=0, last_column=24)


def scene(
    *,
    peak: float = 120.0,
    centre: tuple[float, float] = (0.0, 0.0),
    gradient: tuple[float, float] = (0.0, 0.0),
    lamps: float = 1.0,
    stray: float = 0.0,
    seed: int = 1,
    force_n: float | None = 1.0,
) -> TactileImage:
    """A bell of light that ends at a sharp edge, a lit corner, and what goes wrong with them."""
    y, x = np.mgrid[:ROWS, :COLUMNS]
    x, y = (x - (COLUMNS - 1) / 2 - centre[0]) / RADIUS_PX, (y - (ROWS - 1) / 2 - centre[1]) / RADIUS_PX
    bell = peak * (1 - 0.8 * (x**2 + y**2)) * (1 + gradient[0] * x + gradient[1] * y)
    light = np.where(np.hypot(x, y) < 1, np.maximum(bell, 0.0), 0.0)
    light[LIT.first_row : LIT.last_row, LIT.first_column : LIT.last_column] = 90.0
    grey = DARK + stray + lamps * light + 0.7 * np.random.default_rng(seed).standard_normal(light.shape)
    return TactileImage(grey=np.clip(np.rint(grey), 0.0, 255.0), mm_per_pixel=(0.05, 0.05), force_n=force_n)


PRESS, UNTOUCHED = scene(), scene(peak=0.0, seed=99)


def reference(**changes: Any) -> GuardReference:
    return GuardReference(**{"untouched": UNTOUCHED, "patch": LIT, "dark_grey": DARK, **changes})


def names(image: TactileImage, against: GuardReference | None = None, **more: Any) -> list[str]:
    return [flag.name for flag in check_press(image, reference=against or reference(), **more)]


def test_a_good_press_raises_nothing() -> None:
    assert names(PRESS) == []


@pytest.mark.parametrize(
    ("image", "flag"),
    [
        (scene(peak=0.0), "no-contact"),
        (scene(force_n=0.05), "force-too-small"),
        (scene(force_n=2.3), "force-too-large"),
        (scene(peak=400.0), "saturated"),
        (scene(peak=8.0), "dark-frame"),
        (scene(centre=(0.0, 100.0)), "cropped"),
        (scene(centre=(12.0, -9.0)), "off-centre"),
        (scene(gradient=(0.0, 0.2)), "tilted"),
        (scene(stray=3.0), "ambient-light"),
        (scene(lamps=1.04), "led-drift"),
        (scene(lamps=0.96), "led-drift"),
    ],
)
def test_each_fault_raises_its_flag(image: TactileImage, flag: str) -> None:
    assert flag in names(image)


@pytest.mark.parametrize(
    ("image", "only"),
    [
        (scene(gradient=(0.2, 0.1)), ["tilted"]),
        (scene(centre=(12.0, -9.0)), ["off-centre"]),
        (scene(stray=3.0), ["ambient-light"]),
        (scene(lamps=1.04), ["led-drift"]),
        (scene(lamps=1.04, stray=-1.0 + 4.0), ["ambient-light", "led-drift"]),
    ],
)
def test_one_fault_is_not_taken_for_another(image: TactileImage, only: list[str]) -> None:
    assert names(image) == only


@given(x=st.floats(-0.3, 0.3), y=st.floats(-0.3, 0.3))
@settings(max_examples=15)
def test_the_gradient_read_is_that_put_in(x: float, y: float) -> None:
    image = scene(gradient=(x, y))
    reading = read_guard_frame(image.grey, prepare_reference(reference(), FrameShape.of(image)))
    # The lens draws the foot of the brighter side out, which takes some of a steep gradient.
    assert reading.tilt == pytest.approx((x, y), abs=0.02 + 0.15 * max(abs(x), abs(y)))
    assert reading.off_centre == pytest.approx(0.0, abs=0.02)


@given(x=st.floats(-30, 30), y=st.floats(-30, 30))
@settings(max_examples=15)
def test_the_distance_read_is_that_put_in(x: float, y: float) -> None:
    image = scene(centre=(x, y))
    reading = read_guard_frame(image.grey, prepare_reference(reference(), FrameShape.of(image)))
    assert reading.off_centre == pytest.approx(np.hypot(x, y) / RADIUS_PX, abs=0.02)
    assert reading.tilt == pytest.approx((0.0, 0.0), abs=0.02)


@given(lamps=st.floats(0.8, 1.2), stray=st.floats(0.0, 10.0))
@settings(max_examples=15)
def test_lamps_and_light_from_outside_are_told_apart(lamps: float, stray: float) -> None:
    image = scene(lamps=lamps, stray=stray)
    reading = read_guard_frame(image.grey, prepare_reference(reference(), FrameShape.of(image)))
    assert reading.led_drift == pytest.approx(lamps - 1, abs=0.004)
    assert reading.ambient_grey == pytest.approx(stray, abs=0.25)


def test_a_frame_that_clips_all_over_is_saturated_and_one_that_is_black_shows_no_contact() -> None:
    for grey, result, denied in ((255.0, "saturated", "no-contact"), (0.0, "no-contact", "saturated")):
        frame = TactileImage(grey=np.full((ROWS, COLUMNS), grey), mm_per_pixel=(0.05, 0.05))
        for against in (reference(), GuardReference()):
            found = names(frame, against)
            assert result in found
            assert denied not in found


@pytest.mark.slow
def test_a_camera_that_moved_against_the_face_is_told_by_two_flags() -> None:
    """What the page says cannot be told apart from light from outside, and a contact from border to border."""
    probe = tsis.load_probe("tsis-2011")
    virtual = VirtualProbe(probe, rng=np.random.default_rng(1), strain="small")
    against = GuardReference(untouched=virtual.no_contact(), face_radius_mm=probe.radius_mm)
    press = virtual.press(tsis.load_phantom("plain"), force_n=1.0)
    for shift, axis, result in ((80, 1, ["off-centre", "ambient-light"]), (40, 0, ["tilted"])):
        assert names(replace(press, grey=np.roll(press.grey, shift, axis)), against) == result


def test_a_level_press_takes_uneven_lamps_out() -> None:
    uneven = scene(gradient=(0.2, 0.0))
    assert names(uneven) == ["tilted"]
    assert names(uneven, reference(level=scene(gradient=(0.2, 0.0), seed=5))) == []


def test_light_that_falls_where_it_is_pressed_is_read_with_invert() -> None:
    fallen = TactileImage(grey=200.0 - 0.5 * scene(peak=120.0).grey, mm_per_pixel=(0.05, 0.05))
    lit = TactileImage(grey=200.0 - 0.5 * UNTOUCHED.grey, mm_per_pixel=(0.05, 0.05))
    assert names(fallen, GuardReference(untouched=lit, invert=True)) == []
    assert "no-contact" in names(lit, GuardReference(untouched=lit, invert=True))


def test_settling_raises_moving_with_the_time_to_wait() -> None:
    time = np.arange(0.0, 6.0, 1 / 30)
    relaxing = assess_settling(
        time, 1 + 0.5 * np.exp(-time / 5.0) + 1e-3 * np.random.default_rng(1).standard_normal(time.size)
    )
    (flag,) = check_press(PRESS, reference=reference(), settling=relaxing)
    assert flag.name == "moving"
    assert flag.advice.startswith("hold still for ")
    plateau = assess_settling(np.arange(0.0, 60.0, 0.1), 1 + 1e-3 * np.random.default_rng(1).standard_normal(600))
    assert names(PRESS, settling=plateau) == []


def test_a_virtual_press_is_innocent_and_one_too_hard_is_not() -> None:
    virtual = VirtualProbe(tsis.load_probe("tsis-2011"), rng=np.random.default_rng(1), strain="small")
    against = GuardReference(
        untouched=virtual.no_contact(),
        level=virtual.press(tsis.load_phantom("plain"), force_n=1.0),
        face_radius_mm=12.0,
    )
    assert names(virtual.press(tsis.load_phantom("size-8"), force_n=1.0), against) == []
    too_hard = names(virtual.press(tsis.load_phantom("size-8"), force_n=2.4), against)
    assert too_hard[:2] == ["force-too-large", "saturated"]


def series(watch: PressWatch, images: list[TactileImage], step_s: float = 1 / 30) -> list[frozenset[str]]:
    state, found = WatchState(), []
    for number, image in enumerate(images):
        frame = Frame(pixels=image.grey.astype(np.uint8), sequence=number, time_s=number * step_s)
        flags, state = watch.step(state, frame, 1.0)
        assert {flag.name for flag in flags} == state.raised
        found.append(state.raised)
    return found


@given(seed=st.integers(0, 1000), share=st.floats(0.92, 1.08))
@settings(max_examples=8)
def test_noise_at_a_limit_makes_no_flag_flicker(seed: int, share: float) -> None:
    """Values that wander around a limit by less than the release pass it once at most."""
    rng = np.random.default_rng(seed)
    limits = GuardLimits()
    forces = limits.most_force_n * share * (1 + rng.uniform(-0.09, 0.09, 60))
    small = TactileImage(grey=PRESS.grey[64:182:2, 92:292:2])  # the force decides alone
    watch = PressWatch(FrameShape.of(small))
    state, up = WatchState(), []
    frame = Frame(pixels=small.grey, sequence=0)
    for force in forces.tolist():
        _, state = watch.step(state, frame, force)
        up.append("force-too-large" in state.raised)
    assert np.count_nonzero(np.diff(np.array(up, dtype=int))) <= 1


def test_the_live_view_agrees_with_one_frame_and_settles() -> None:
    press = PRESS
    watch = PressWatch(FrameShape.of(press), reference=reference(), longest_s=1.0)
    found = series(watch, [scene(peak=0.0)] * 3 + [scene(seed=number) for number in range(120)])
    assert found[0] == {"no-contact"}
    assert found[4] == {"moving"}
    assert found[-1] == frozenset()


def test_mains_flicker_is_seen_and_a_trembling_press_is_none() -> None:
    rate, watch = 28.0, PressWatch(FrameShape.of(PRESS), reference=reference())
    swing = [2.0 * (1 + np.cos(2 * np.pi * 100.0 * number / rate)) for number in range(48)]
    lit = [scene(stray=value, seed=number) for number, value in enumerate(swing)]
    assert "flicker" in series(watch, lit, 1 / rate)[-1]
    trembling = [scene(peak=120.0 + 5.0 * value, seed=number) for number, value in enumerate(swing)]
    assert "flicker" not in series(watch, trembling, 1 / rate)[-1]


def test_a_picture_that_comes_again_and_again_is_frozen_and_no_settled_press() -> None:
    watch = PressWatch(FrameShape.of(PRESS), reference=reference(), longest_s=1.0)
    live, stuck = [scene(seed=number) for number in range(4)], [scene(seed=9)] * 120
    found = series(watch, [*live, *stuck, scene(seed=10)])
    assert ["frozen" in flags for flags in found] == [False] * 6 + [True] * 118 + [False]
    from_the_start = series(watch, stuck)
    assert "frozen" not in from_the_start[1]
    assert from_the_start[-1] == {"frozen", "moving"}


def test_frames_that_clip_all_over_are_alike_and_not_frozen() -> None:
    watch = PressWatch(FrameShape.of(PRESS), reference=reference())
    for level in (0.0, 255.0):
        grey = np.full((ROWS, COLUMNS), level)
        grey[100, 100:104] = [40.0, 80.0, 120.0, 160.0]  # stuck pixels
        even = TactileImage(grey=grey)
        assert not any("frozen" in flags for flags in series(watch, [even] * 5))


def test_memory_stays_bounded() -> None:
    small = TactileImage(grey=PRESS.grey[64:182:2, 92:292:2])
    watch, state = PressWatch(FrameShape.of(small)), WatchState()
    pixels = small.grey.astype(np.uint8)
    for number in range(400):
        _, state = watch.step(state, Frame(pixels=pixels, sequence=number, time_s=float(number)))
    assert len(state.history.time_s) <= 128
    assert len(state.outside) <= 64


def test_what_does_not_belong_together_is_refused() -> None:
    watch = PressWatch(FrameShape.of(PRESS), reference=reference())
    with pytest.raises(ImageMismatchError, match="size"):
        watch.step(WatchState(), Frame(pixels=np.zeros((10, 10)), sequence=0))
    with pytest.raises(ImageMismatchError, match="full scale"):
        watch.step(WatchState(), Frame(pixels=PRESS.grey, sequence=0, full_scale=4095.0))
    with pytest.raises(InputError, match="force_n"):
        watch.step(WatchState(), Frame(pixels=PRESS.grey, sequence=0), float("nan"))
    with pytest.raises(ImageMismatchError):
        check_press(PRESS, reference=TactileImage(grey=np.zeros((10, 10))))
    with pytest.raises(InputError, match="untouched"):
        GuardReference(patch=LIT)
    with pytest.raises(InputError, match="untouched"):
        GuardReference(invert=True)
    with pytest.raises(InputError, match="lit"):
        check_press(
            PRESS,
            reference=reference(patch=ReferencePatch(first_row=100, last_row=110, first_column=0, last_column=9)),
        )
    with pytest.raises(InputError, match="no contact"):
        check_press(PRESS, reference=reference(level=scene(peak=0.0)))


@pytest.mark.parametrize("seed", range(20))
def test_frames_that_stalled_do_not_turn_a_slow_trend_into_flicker(seed: int) -> None:
    rng = np.random.default_rng(seed)
    steps = np.full(64, 1 / 30)
    steps[rng.integers(1, 64, 3)] += rng.uniform(0.0, 0.5, 3)
    time = np.cumsum(steps)
    swing = flicker_amplitude(time.tolist(), (8.0 + 0.02 * np.sin(0.8 * time)).tolist())
    assert swing is None or swing < 0.02  # never more than the trend itself


PROBE = load_probe("tsis-2011")


def known(**changes: Any) -> UsableCalibration:
    return UsableCalibration(calibration=bench(**changes), identity="0" * 64)


def test_the_untouched_probe_is_that_of_the_calibration() -> None:
    reference, measured = guard_reference(known()), bench_reference()
    assert reference.untouched is not None
    np.testing.assert_allclose(reference.untouched.grey, measured.dark_grey + measured.untouched_grey, rtol=1e-12)
    assert reference.untouched.mm_per_pixel == (0.0336, 0.0392)
    assert reference.dark_grey == pytest.approx(8.0, abs=0.05)
    assert reference.face_radius_mm == PROBE.radius_mm


def test_what_was_not_measured_is_not_compared() -> None:
    for calibration in (None, known(reference=None)):
        reference = guard_reference(calibration)
        assert (reference.untouched, reference.face_radius_mm, reference.dark_grey) == (None, None, None)
    foreign = guard_reference(known(probe="of my own", response=None))
    assert foreign.untouched is not None
    assert foreign.face_radius_mm is None
    unscaled = guard_reference(known(scale=None)).untouched
    assert unscaled is not None
    assert unscaled.mm_per_pixel is None


def test_a_frame_gets_the_scale_of_its_camera_alone() -> None:
    image = TactileImage(grey=np.full((30, 40), 9.0))
    assert with_calibrated_scale(image, known()).mm_per_pixel == (0.0336, 0.0392)
    assert with_calibrated_scale(image, None) is image
    assert with_calibrated_scale(image, known(scale=None)) is image
    with pytest.raises(ImageMismatchError, match=r"\(30, 40\) that the scale was measured on"):
        with_calibrated_scale(TactileImage(grey=np.full((40, 30), 9.0)), known())


def test_only_with_a_calibration_does_the_watch_tell_light_that_was_not_there() -> None:
    measured = bench_reference()
    untouched = np.rint(measured.dark_grey + measured.untouched_grey).astype(np.uint8)

    def told(added: int, calibration: UsableCalibration | None) -> set[str]:
        frame = Frame(pixels=(untouched + added).astype(np.uint8), sequence=0, time_s=0.0, full_scale=255.0)
        flags, _ = press_watch(frame, calibration).step(WatchState(), frame)
        return {flag.name for flag in flags}

    assert told(0, known()) == {"no-contact"}
    assert told(100, known()) == {"no-contact", "ambient-light"}
    assert "ambient-light" not in told(100, None)
