"""Which cameras OpenCV could open, asked without disturbing them where the system can tell."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2

from tsis.instrument.found import CameraInfo
from tsis.instrument.quiet import quiet_decoders
from tsis.instrument.sources.files import natural_key

_LINUX_DEVICES = Path("/sys/class/video4linux")
_TRIED_ELSEWHERE = 4


def missing_requirement() -> str | None:
    """Nothing: OpenCV comes with the plain install."""
    return None


def find_cameras_here(*, devices: Path = _LINUX_DEVICES, platform: str = sys.platform) -> tuple[CameraInfo, ...]:
    """On Linux those that the system lists; elsewhere those of the first indices that open.

    Parameters
    ----------
    devices
        Folder in which Linux lists video devices.
    platform
        As ``sys.platform``.
    """
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
    with quiet_decoders():
        for index in range(_TRIED_ELSEWHERE):
            capture = cv2.VideoCapture(index)
            if capture.isOpened():
                cameras.append(CameraInfo(source="opencv", identity=str(index)))
            capture.release()
    return tuple(cameras)
