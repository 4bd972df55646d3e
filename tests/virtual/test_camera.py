from __future__ import annotations

import itertools
import threading
from itertools import islice
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.waiting import HANGS_S

import tsis
from tsis.errors import CameraError, InputError, MechanicsError, UnknownNameError
from tsis.imaging.sensor import Sensor
from tsis.instrument.acquisition import Acquisition
from tsis.instrument.camera import Camera
from tsis.model.calibration import LightMap
from tsis.model.phantom import Phantom, SoftSphere
from tsis.virtual.camera import VirtualCamera
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from numpy.typing import NDArray


def _camera(**options: Any) -> VirtualCamera:
    rng = np.random.default_rng(7)
    probe = VirtualProbe(tsis.load_probe("tsis-2011"), rng=rng, light=LightMap.uniform(), strain="small")
    return VirtualCamera(probe, tsis.load_phantom("plain"), rng=rng, **options)


@pytest.fixture(scope="module")
def running() -> VirtualCamera:
    camera = _camera(force_n=0.5)
    camera.open()
    camera.start()
    return camera


def _grey(camera: VirtualCamera, *settings: dict[str, float]) -> list[NDArray[np.float64]]:
    """Mean grey above the black level under each settings in turn, of one press that is held."""
    camera.start()
    before = {setting.name: setting.value for setting in camera.settings()}
    stream, seen = camera.frames(), []
    for changed in settings:
        for name, value in {**before, **changed}.items():
            camera.adjust(name, value)
        frames = [frame.pixels.astype(float) for frame in islice(stream, 4)]
        seen.append(np.asarray(np.mean(frames, axis=0) - {**before, **changed}["brightness"]))
    for name, value in before.items():
        camera.adjust(name, value)
    return seen


def test_it_follows_the_protocol(running: VirtualCamera) -> None:
    assert isinstance(running, Camera)
    first, second = islice(running.frames(), 2)
    assert (first.sequence, second.sequence) == (0, 1)
    assert (first.pixels.dtype, first.pixels.shape) == (np.dtype(np.uint8), (492, 768))
    assert second.time_s == pytest.approx(1 / 30)
    assert (first.pixels != second.pixels).mean() > 0.5  # noise is fresh in each frame
    assert first.settings["exposure_ms"] == 20.0


def test_light_is_proportional_to_the_exposure(running: VirtualCamera) -> None:
    full, half = _grey(running, {}, {"exposure_ms": 10.0})
    assert half.mean() / full.mean() == pytest.approx(0.5, rel=0.01)


def test_gain_amplifies_light_and_noise_alike(running: VirtualCamera) -> None:
    plain, amplified = _grey(running, {"exposure_ms": 8.0}, {"exposure_ms": 8.0, "gain": 6.0206})
    assert amplified.mean() / plain.mean() == pytest.approx(2.0, rel=0.01)

    def noise(gain: float) -> float:
        running.adjust("exposure_ms", 8.0)
        running.adjust("gain", gain)
        running.start()
        one, two = (frame.pixels.astype(float) for frame in islice(running.frames(), 2))
        running.adjust("gain", 0.0)
        running.adjust("exposure_ms", 20.0)
        return float(np.sqrt(max((one - two).var() / 2 - 1 / 12, 0.0)))  # less rounding

    assert noise(6.0206) / noise(0.0) == pytest.approx(2.0, rel=0.03)


def test_brightness_is_the_black_level() -> None:
    camera = _camera(force_n=0.0)
    camera.open()
    camera.adjust("brightness", 30.0)
    camera.start()
    assert next(camera.frames()).pixels.mean() == pytest.approx(30.0, abs=0.1)


def test_no_contact_is_dark_and_a_press_is_not(running: VirtualCamera) -> None:
    nothing, light, heavy = _grey(running, {"force_n": 0.0}, {"force_n": 0.5}, {"force_n": 1.0})
    assert nothing.mean() == pytest.approx(0.0, abs=0.05)
    assert heavy.mean() > 1.5 * light.mean() > 1.0


def test_settings_out_of_range_are_refused(running: VirtualCamera) -> None:
    with pytest.raises(InputError, match="exposure_ms must lie in"):
        running.adjust("exposure_ms", 34.0)  # longer than a frame of 30 a second
    with pytest.raises(InputError, match="gain must lie in"):
        running.adjust("gain", float("nan"))
    with pytest.raises(UnknownNameError, match="did you mean 'exposure_ms'"):
        running.adjust("exposure", 1.0)
    with pytest.raises(InputError, match="frames_per_s"):
        _camera(frames_per_s=0.0)
    with pytest.raises(CameraError, match="must be opened first"):
        _camera().start()


@pytest.mark.parametrize(("paced", "step_s"), [(True, 0.25), (False, 1 / 50)])
def test_a_paced_camera_keeps_the_clocks_time_and_catches_up_with_nothing(paced: bool, step_s: float) -> None:
    slow = itertools.count(0.0, 0.25)  # a computer that takes a quarter of a second for everything
    camera = _camera(force_n=0.0, frames_per_s=50.0, paced=paced, clock=lambda: next(slow))
    camera.open()
    camera.start()
    times = [frame.time_s or 0.0 for frame in islice(camera.frames(), 5)]
    assert times[0] == 0.0
    assert np.diff(times).min() >= step_s - 1e-12
    assert (np.diff(times).max() < 2 / 50) == (not paced)


def test_a_frame_late_by_less_than_a_period_delays_no_other() -> None:
    now = [0.0]
    camera = _camera(force_n=0.0, frames_per_s=100.0, paced=True, clock=lambda: now[0])
    camera.open()
    camera.start()
    frames, times = camera.frames(), []
    for now[0] in (0.0, 0.015, 0.02, 0.065, 0.066):  # late: the second by half a period, the fourth by more than three
        times.append(next(frames).time_s or 0.0)
    np.testing.assert_allclose(times, (0.0, 0.01, 0.02, 0.055, 0.065), atol=1e-12)


def test_a_paced_camera_ends_when_it_is_stopped() -> None:
    camera = _camera(force_n=0.0, frames_per_s=0.1, paced=True)
    with Acquisition(lambda: camera) as acquisition:
        assert acquisition.ring.wait(0, HANGS_S)
    assert acquisition.account().received == 1


TISSUE = tsis.load_phantom("plain")
BALL = SoftSphere(radius_mm=3.0, young_kpa=100.0, name="ball")
LEVEL_PER_N = 20.0


class FlatRig:
    """Light as bright as the force, evenly; it refuses more than 3 N, and waits at the gate where there is one."""

    def __init__(self) -> None:
        self.sensor = Sensor(columns=10, rows=8, read_noise_grey=0.0, shot_noise_grey=0.0)
        self.frame_settings = {"source": "virtual"}
        self.pressed: list[tuple[Any, float]] = []
        self.gate: threading.Event | None = None
        self.waits = threading.Event()

    def light(self, lies: Any, /, *, force_n: float) -> NDArray[np.float64]:
        if self.gate is not None:
            self.waits.set()
            assert self.gate.wait(HANGS_S)
        if force_n > 3.0:
            raise MechanicsError("force_n must be at most 3 here; got more (choose at most that)")
        self.pressed.append((lies, force_n))
        return np.full((8, 10), LEVEL_PER_N * force_n)


def _flat(lies: Phantom | SoftSphere = TISSUE, **options: Any) -> SimpleNamespace:
    rig = FlatRig()
    camera = VirtualCamera(rig, lies, rng=np.random.default_rng(1), **options)
    camera.open()
    camera.start()
    return SimpleNamespace(rig=rig, camera=camera, frames=camera.frames())


def _told_and_shown(flat: SimpleNamespace) -> tuple[float, float]:
    """The force that a frame carries, and that which its grey levels show."""
    frame = next(flat.frames)
    return frame.settings["force_n"], (float(frame.pixels.mean()) - flat.rig.sensor.background_grey) / LEVEL_PER_N


def test_it_is_held_on_something_else_while_it_runs() -> None:
    flat = _flat(force_n=1.0)
    assert _told_and_shown(flat) == (1.0, 1.0)
    flat.camera.hold_on(BALL, force_n=2.5)
    frame = next(flat.frames)
    assert frame.name == "virtual probe on ball#1"
    assert frame.settings["force_n"] == 2.5
    assert frame.pixels.mean() == flat.rig.sensor.background_grey + 50.0
    assert [lies for lies, _ in flat.rig.pressed] == [TISSUE, BALL]
    assert {setting.name: setting.value for setting in flat.camera.settings()}["force_n"] == 2.5


def test_every_lift_is_another_press_and_other_settings_are_none() -> None:
    flat = _flat()
    next(flat.frames)
    flat.camera.hold_on(TISSUE, force_n=1.0)
    flat.camera.adjust("gain", 6.0)
    flat.camera.adjust("force_n", 1.0)  # as it is held
    next(flat.frames)
    assert flat.rig.pressed == [(TISSUE, 1.0)] * 2


@pytest.mark.parametrize("act", ["hold_on", "adjust"])
def test_what_cannot_be_pressed_leaves_the_press_as_it_was(act: str) -> None:
    flat = _flat()
    next(flat.frames)
    with pytest.raises(MechanicsError, match="at most 3"):
        flat.camera.hold_on(BALL, force_n=4.0) if act == "hold_on" else flat.camera.adjust("force_n", 4.0)
    for wrong in (5.5, float("nan")):
        with pytest.raises(InputError, match="force_n must lie in"):
            flat.camera.hold_on(BALL, force_n=wrong)
    assert _told_and_shown(flat) == (1.0, 1.0)
    assert flat.camera.name == "virtual probe on plain"


def test_frames_go_on_as_they_were_while_a_press_is_solved() -> None:
    flat = _flat(force_n=0.5)
    next(flat.frames)
    flat.rig.gate = threading.Event()
    holding = threading.Thread(target=flat.camera.hold_on, args=(BALL,), kwargs={"force_n": 2.0})
    holding.start()
    assert flat.rig.waits.wait(HANGS_S)
    assert [_told_and_shown(flat) for _ in range(3)] == [(0.5, 0.5)] * 3
    flat.rig.gate.set()
    holding.join(HANGS_S)
    assert _told_and_shown(flat) == (2.0, 2.0)


def test_no_frame_shows_one_press_under_the_force_of_another() -> None:
    flat, over = _flat(force_n=0.0), threading.Event()

    def press() -> None:
        for step in range(2000):
            flat.camera.hold_on(TISSUE, force_n=float(step % 4) / 2)
        over.set()

    pressing = threading.Thread(target=press)
    pressing.start()
    seen = {_told_and_shown(flat)}
    while not over.is_set():
        seen.add(_told_and_shown(flat))
    pressing.join(HANGS_S)
    assert all(result == shown for result, shown in seen)


def test_known_light_is_not_computed_again() -> None:
    flat = _flat(light=np.full((8, 10), 33.0))
    assert next(flat.frames).pixels.mean() == flat.rig.sensor.background_grey + 33.0
    assert flat.rig.pressed == []
    with pytest.raises(InputError, match=r"light must have the sensor's shape, \(8, 10\); got \(3, 3\)"):
        _flat(light=np.zeros((3, 3)))


def test_it_looks_at_a_sphere_through_the_rig_of_direct_contact() -> None:
    from tests.hardness.stand_ins import by_table

    rig = tsis.virtual.direct_contact.DirectContactRig(
        tsis.load_probe("tsis-direct"),
        rng=np.random.default_rng(1),
        sensor=Sensor(columns=192, rows=128),
        solve=by_table,
    )
    camera = VirtualCamera(rig, BALL, rng=np.random.default_rng(1), force_n=0.0)
    camera.open()
    camera.start()
    stream = camera.frames()
    dark = next(stream).pixels
    camera.hold_on(BALL, force_n=0.7)
    lit = next(stream).pixels
    assert dark.max() < rig.sensor.background_grey + 6
    rows, columns = np.nonzero(lit > 60)
    assert abs(columns.mean() - 95.5) < 10  # near the axis, beside which it lies a little
    assert abs(rows.mean() - 63.5) < 10
