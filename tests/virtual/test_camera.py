from __future__ import annotations

import itertools
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import tsis
from tsis.instrument import Camera
from tsis.instrument.acquisition import Acquisition
from tsis.model import LightMap
from tsis.model.errors import CameraError, InputError, UnknownNameError
from tsis.virtual import VirtualCamera, VirtualProbe

if TYPE_CHECKING:
    from numpy.typing import NDArray


def _camera(**options: Any) -> VirtualCamera:
    rng = np.random.default_rng(7)
    probe = VirtualProbe(tsis.load_probe("tsis-2011"), rng=rng, light=LightMap.uniform())
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


def test_a_paced_camera_ends_when_it_is_stopped() -> None:
    camera = _camera(force_n=0.0, frames_per_s=0.1, paced=True)
    with Acquisition(lambda: camera) as acquisition:
        assert acquisition.ring.wait(0, 10.0)
    assert acquisition.account().received == 1
