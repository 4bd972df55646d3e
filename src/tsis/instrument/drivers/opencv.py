"""Cameras through OpenCV, and the search for them."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import CameraError
from tsis.instrument.camera import Frame, Mode, Setting, checked_setting
from tsis.instrument.discovery import CameraInfo, missing_message
from tsis.instrument.drivers.files import BRIGHTNESS, EXPOSURE, GAIN, HEIGHT, WIDTH, OpenCVCapture, natural_key
from tsis.instrument.image_files import grey_of_opencv, opencv, quiet_decoders
from tsis.model.require import require_number

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


_LINUX_DEVICES = Path("/sys/class/video4linux")
_TRIED_ELSEWHERE = 4
_FEATURE = "the camera source opencv"


def missing_requirement() -> str | None:
    """What is not installed, with the cure; None when nothing is missing."""
    return missing_message(lambda: opencv(_FEATURE))


def find_cameras_here(*, devices: Path = _LINUX_DEVICES, platform: str = sys.platform) -> tuple[CameraInfo, ...]:
    """On Linux the devices that the system lists in a folder; elsewhere the first indices that open."""
    return _listed(devices) if platform == "linux" else _opening()


def _listed(devices: Path) -> tuple[CameraInfo, ...]:
    entries = sorted(devices.glob("video*"), key=lambda entry: natural_key(entry.name)) if devices.is_dir() else []
    return tuple(
        CameraInfo(
            source="opencv",
            identity=entry.name.removeprefix("video"),
            model=_line(entry / "name"),
            note=f"/dev/{entry.name}",
        )
        for entry in entries
        # a driver's further devices carry metadata, not frames
        if entry.name.removeprefix("video").isdecimal() and _line(entry / "index") in ("", "0")
    )


def _line(file: Path) -> str:
    try:
        text = file.read_text(errors="replace").strip()
    except OSError:
        return ""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def _opening() -> tuple[CameraInfo, ...]:
    cameras = []
    cv2 = opencv(_FEATURE)
    with quiet_decoders():
        for index in range(_TRIED_ELSEWHERE):
            capture = cv2.VideoCapture(index)
            if capture.isOpened():
                cameras.append(CameraInfo(source="opencv", identity=str(index)))
            capture.release()
    return tuple(cameras)


_PROPERTIES = {"brightness": BRIGHTNESS, "gain": GAIN, "exposure": EXPOSURE}
_UNSUPPORTED = -1.0  # OpenCV's value of a property that the driver does not have


class OpenCVDevice(OpenCVCapture):
    """A live camera that OpenCV can open.

    Colour becomes grey by the Rec. 709 luma, rounded to whole levels, and the frame keeps it beside the grey levels.
    OpenCV gives neither modes, ranges nor dropped frames: the list contains the present mode only, ranges are infinite,
    and sequence numbers count received frames.

    Parameters
    ----------
    index
        Number of the camera, from 0.
    capture
        Opens an index like ``cv2.VideoCapture``, which is the default.
    clock
        Seconds, monotonic.
    """

    def __init__(
        self,
        index: int,
        *,
        capture: Callable[[int], Any] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._index = int(require_number("index", index, 0, 9999))
        super().__init__()
        self._open_capture, self._clock = capture, clock

    @property
    def name(self) -> str:
        """Display name."""
        return f"camera {self._index}"

    def open(self) -> None:
        """Connect to the camera with a new handle; `CameraError` when no camera answers at this index."""
        self.stop()
        with quiet_decoders():
            capture = (self._open_capture or opencv(_FEATURE).VideoCapture)(self._index)
        if not capture.isOpened():
            raise CameraError(
                f"no camera answers at index {self._index}; check its cable and permissions, or try another index"
            )
        self._capture, self._lost = capture, False

    def settings(self) -> tuple[Setting, ...]:
        """Brightness, gain and exposure where the driver has them, in the driver's own units."""
        with self._lock:
            capture = self._opened()
            values = {name: float(capture.get(number)) for name, number in _PROPERTIES.items()}
        return tuple(Setting(name=name, value=value) for name, value in values.items() if value != _UNSUPPORTED)

    def adjust(self, name: str, value: float) -> None:
        """Set one of `settings`.

        Raises `UnknownNameError` when the camera has no such setting; `CameraError` when the camera does not take the
        value.
        """
        checked = checked_setting(self.settings(), name, value, camera=self.name)
        with self._lock:
            taken = self._opened().set(_PROPERTIES[name], checked)
        if not taken:
            raise CameraError(f"{self.name} does not take {name} = {checked:g}")

    def start(self, mode: Mode | None = None) -> None:
        """Begin to deliver frames; a ``mode`` other than the present one is requested and checked."""
        capture = self._opened()
        if mode is not None and mode not in self.modes():
            capture.set(WIDTH, mode.width_px)
            capture.set(HEIGHT, mode.height_px)
            (present,) = self.modes()
            if (present.width_px, present.height_px) != (mode.width_px, mode.height_px):
                raise CameraError(f"{self.name} does not take {mode}; it is in {present}")
        self._running.set()

    def frames(self) -> Iterator[Frame]:
        """Yield frames on arrival; `CameraError` when the camera stops answering; the frames before that stay valid."""
        if not self._running.is_set():
            raise CameraError(f"{self.name} must be started before frames are read; call start()")
        settings = {setting.name: setting.value for setting in self.settings()}
        sequence, first_s = 0, None
        while self._running.is_set():
            with self._lock:
                present, pixels = (False, None) if self._capture is None else self._capture.read()
            now_s = self._clock()
            if not self._running.is_set():
                return
            if not present or pixels is None:
                self._lost = True
                raise CameraError(f"{self.name} was lost after {sequence} frames; check its cable and open it again")
            first_s = now_s if first_s is None else first_s
            yield Frame(
                pixels=np.rint(grey_of_opencv(pixels)).astype(pixels.dtype),  # whole, so that it can be stored
                sequence=sequence,
                time_s=now_s - first_s,
                name=f"{self.name}#{sequence}",
                settings=settings,
                colour=pixels[..., 2::-1] if pixels.ndim == 3 and pixels.shape[2] >= 3 else None,
            )
            sequence += 1

    def _not_opened(self) -> CameraError:
        return CameraError(f"{self.name} must be opened first; call open()")
