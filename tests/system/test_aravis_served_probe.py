"""The virtual probe as a GigE Vision camera: what any program sets changes the image as light does."""

from __future__ import annotations

import itertools
import signal
import subprocess
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.system.aravis_peer import FOREIGN_CLIENT, LOOPBACK, loopback_camera_port, served_probe, standing_clock

from tsis.catalog.phantoms import phantom_variant
from tsis.catalog.probes import load_probe
from tsis.errors import CameraError
from tsis.instrument.drivers.aravis import AravisCamera, find_cameras_here
from tsis.virtual.camera import VirtualCamera
from tsis.virtual.gige import GigEServer
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from tsis.instrument.camera import Frame

pytestmark = pytest.mark.system
SERIAL, SEED, FORCE_N, FRAMES = "TSIS01", 4, 1.0, 20
OPTIONS = ("--seed", str(SEED), "--force-n", str(FORCE_N), "--frames-per-s", "60")
BACKGROUND, READ_VARIANCE, SHOT = 8.0, 0.5**2 + 1 / 12, 0.017  # of the virtual sensor, in grey levels


@pytest.fixture(scope="module")
def served() -> Iterator[subprocess.Popen[str]]:
    with loopback_camera_port(), served_probe(SERIAL, *OPTIONS) as process:
        yield process


@pytest.fixture(scope="module")
def light() -> NDArray[np.float64]:
    """Expected grey levels above the background at 20 ms and 0 dB."""
    rig = VirtualProbe(load_probe("tsis-2011"), rng=np.random.default_rng(SEED), strain="small")
    return rig.light(phantom_variant("hardness-100", None, None, None), force_n=FORCE_N)


def _taken(*, exposure_ms: float = 20.0, gain: float = 0.0) -> list[Frame]:
    camera = AravisCamera(LOOPBACK, clock=standing_clock)
    camera.open()
    camera.adjust("exposure_ms", exposure_ms)
    camera.adjust("gain", gain)
    camera.start()
    frames = list(itertools.islice(camera.frames(), FRAMES))
    camera.stop()
    assert frames[0].settings["exposure_ms"] == exposure_ms
    return frames


def _mean(frames: list[Frame]) -> NDArray[np.float64]:
    return np.asarray(np.mean([frame.pixels for frame in frames], axis=0, dtype=float))


def test_programs_find_it_by_its_name(served: subprocess.Popen[str]) -> None:
    (camera,) = (camera for camera in find_cameras_here() if camera.identity == f"tsis-VirtualProbe-{SERIAL}")
    assert (camera.maker, camera.model) == ("tsis", "VirtualProbe")


def test_the_frames_are_those_of_the_virtual_probe_within_its_noise(
    served: subprocess.Popen[str], light: NDArray[np.float64]
) -> None:
    frames = _taken()
    assert frames[0].pixels.shape == (492, 768)
    clear = light < 200  # far from clipping
    deviation = (_mean(frames) - BACKGROUND - light)[clear] / np.sqrt((READ_VARIANCE + SHOT * light[clear]) / FRAMES)
    pixels = deviation.size
    assert pixels > 200_000
    assert abs(deviation.mean()) < 5 / np.sqrt(pixels) + 0.01  # rounding leaves thousandths of a grey level
    assert deviation.var() == pytest.approx(1.0, abs=0.02)


def test_grey_above_background_is_linear_in_exposure_and_decibels_amplify_it(
    served: subprocess.Popen[str], light: NDArray[np.float64]
) -> None:
    clear = (light > 0) & (light < 60)
    full = light[clear].mean()
    for exposure_ms, gain in ((2.5, 0.0), (10.0, 0.0), (40.0, 0.0), (10.0, 6.0), (2.5, 10.0)):
        seen = _mean(_taken(exposure_ms=exposure_ms, gain=gain))[clear].mean() - BACKGROUND
        assert seen == pytest.approx(full * exposure_ms / 20 * 10 ** (gain / 20), abs=0.01)


def test_bright_light_clips(served: subprocess.Popen[str], light: NDArray[np.float64]) -> None:
    frames = _taken(exposure_ms=400.0)
    assert np.all(_mean(frames)[light > 20] == 255)


def test_what_a_foreign_program_sets_changes_the_image(
    served: subprocess.Popen[str], light: NDArray[np.float64]
) -> None:
    command = [FOREIGN_CLIENT, "-n", LOOPBACK, "--duration", "1", "-e", "5000", "-g", "3"]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    counted = {line.split("=")[0].strip(): line.split("=")[1].strip() for line in said.splitlines() if "=" in line}
    assert int(counted["n_completed_buffers"]) > 0
    assert int(counted["n_failures"]) == 0
    camera = AravisCamera(LOOPBACK, clock=standing_clock)
    camera.open()
    camera.start()  # with what the other program has set
    frames = list(itertools.islice(camera.frames(), FRAMES))
    camera.stop()
    assert frames[0].settings["exposure_ms"] == 5.0
    clear = light < 100
    expected = light[clear].mean() * 0.25 * 10 ** (3 / 20)
    assert _mean(frames)[clear].mean() - BACKGROUND == pytest.approx(expected, abs=0.01)


def test_sixteen_bits_hold_the_same_grey_levels(served: subprocess.Popen[str]) -> None:
    camera = AravisCamera(LOOPBACK, clock=standing_clock)
    camera.open()
    camera.adjust("exposure_ms", 20.0)
    camera.adjust("gain", 0.0)
    (mode,) = (mode for mode in camera.modes() if mode.pixel_format == "Mono16")
    camera.start(mode)
    deep = next(camera.frames())
    camera.stop()
    eight, left_over = np.divmod(deep.pixels, 257)
    assert not left_over.any()
    camera.open()
    camera.start(next(mode for mode in camera.modes() if mode.pixel_format == "Mono8"))
    plain = next(camera.frames())
    camera.stop()
    assert eight.mean() == pytest.approx(plain.pixels.mean(), abs=0.02)


def test_a_second_one_on_the_same_interface_is_refused(served: subprocess.Popen[str]) -> None:
    rng = np.random.default_rng(0)
    rig = VirtualProbe(load_probe("tsis-2011"), rng=rng, strain="small")
    camera = VirtualCamera(rig, phantom_variant("plain", None, None, None), rng=rng)
    with pytest.raises(CameraError, match=r"another program serves a camera on 127\.0\.0\.1"):
        GigEServer(camera, serial="TSIS02").__enter__()
    camera.stop()


def test_it_ends_in_order(served: subprocess.Popen[str]) -> None:
    """Keep this one the last: the others need the camera."""
    served.send_signal(signal.SIGTERM)
    said, _ = served.communicate()
    assert served.returncode == 0
    assert "as tsis-VirtualProbe-TSIS01 on 127.0.0.1; Ctrl-C ends it." in said
    assert "tsis acquire --list" in said
    assert "frames were sent." in said.splitlines()[-1]
