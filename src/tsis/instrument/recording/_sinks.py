"""Where a recording's frames go: a folder of PNG files, or one lossless video."""

from __future__ import annotations

import shutil
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Protocol

import cv2

from tsis.errors import InputError
from tsis.instrument._image_files import QUICK_PNG, whole_levels
from tsis.instrument._quiet import quiet_decoders, quiet_ffmpeg

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.instrument._camera import Frame


VIDEO_NAME = "frames.mkv"
ASSUMED_RATE = 30.0  # what a player shows of a source without a clock; the index holds the real times
SPARE_BYTES = 64 * 2**20  # the encoder does not say when a disk is full, so it must never become so


class FrameSink(Protocol):
    """Something that keeps frames."""

    def save(self, frame: Frame, number: int) -> str:
        """Store the frame as the recording's ``number``-th, from 0, and return where; OSError when it cannot."""

    def close(self) -> None:
        """Finish; OSError when what was kept is not whole."""


class FrameFolder:
    """One PNG file a frame, 8 or 16 bits.

    Parameters
    ----------
    folder
        An existing folder.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def save(self, frame: Frame, number: int) -> str:
        """Write ``frame-000000.png`` and so on."""
        name = f"frame-{number:06d}.png"
        content = cv2.imencode(".png", whole_levels(frame.pixels, frame.full_scale), QUICK_PNG)[1]
        try:
            with (self._folder / name).open("xb") as file:
                file.write(content.tobytes())
        except OSError:
            with suppress(OSError):
                (self._folder / name).unlink(missing_ok=True)  # half a frame would be read as a damaged one
            raise
        return name

    def close(self) -> None:
        """Every file is closed already."""


class LosslessVideo:
    """One video file in the FFV1 codec, 8 bits: every grey level comes back as it was.

    Parameters
    ----------
    folder
        An existing folder, in which ``frames.mkv`` is made.
    frames_per_s
        Rate that players show it at; the index holds the real times.
    """

    def __init__(self, folder: Path, *, frames_per_s: float | None = None) -> None:
        self._file = folder / VIDEO_NAME
        self._rate = frames_per_s or ASSUMED_RATE
        self._writer: Any = None
        self._saved = 0

    def save(self, frame: Frame, number: int) -> str:
        """Append the frame."""
        pixels = whole_levels(frame.pixels, frame.full_scale)
        if frame.full_scale > 255:
            raise InputError(
                f"frames of a video must have at most 8 bits; got full scale {frame.full_scale:g} (record a folder)"
            )
        if shutil.disk_usage(self._file.parent).free < SPARE_BYTES:
            raise OSError(28, "less than 64 MiB are free on this disk, too little for a video to go on")
        if self._writer is None:
            self._writer = self._opened(pixels.shape[1], pixels.shape[0])
        self._writer.write(pixels)
        self._saved += 1
        return f"{VIDEO_NAME}#{number}"

    def close(self) -> None:
        """End the file and see that it declares as many frames as were given to it."""
        if self._writer is None:
            return
        self._writer.release()
        self._writer = None
        with quiet_decoders(), quiet_ffmpeg():
            written = cv2.VideoCapture(str(self._file.resolve()), cv2.CAP_FFMPEG)
            result = int(written.get(cv2.CAP_PROP_FRAME_COUNT)) if written.isOpened() else 0
            written.release()
        if abs(result - self._saved) > 1 + 0.01 * self._saved:  # this container knows only its duration
            raise OSError(5, f"the video holds {result} of {self._saved} frames")

    def _opened(self, columns: int, rows: int) -> Any:
        codec = cv2.VideoWriter.fourcc(*"FFV1")
        with quiet_decoders(), quiet_ffmpeg():
            writer = cv2.VideoWriter(
                str(self._file.resolve()), cv2.CAP_FFMPEG, codec, self._rate, (columns, rows), isColor=False
            )
        if not writer.isOpened():
            raise OSError(5, "OpenCV cannot write an FFV1 video here")
        return writer
