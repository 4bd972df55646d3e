"""Storage of a recording's frames: a folder of PNG files, or one lossless video."""

from __future__ import annotations

import shutil
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Protocol

from tsis.errors import InputError
from tsis.files import QUICK_PNG, encode_picture
from tsis.instrument._image_files import whole_levels
from tsis.instrument._quiet import opencv, quiet_decoders, quiet_ffmpeg

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.instrument._camera import Frame


VIDEO_NAME = "frames.mkv"
ASSUMED_RATE = 30.0  # for players, of a source without a clock; the index contains the real times
SPARE_BYTES = 64 * 2**20  # the encoder does not report a full disk


class FrameSink(Protocol):
    """Storage of frames."""

    def save(self, frame: Frame, number: int) -> str:
        """Store the frame as number ``number`` from 0 and return its place; OSError when it cannot."""

    def close(self) -> None:
        """Finish; OSError when the stored frames are incomplete."""


class FrameFolder:
    """One PNG file per frame, 8 or 16 bits.

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
        content = encode_picture(whole_levels(frame.pixels, frame.full_scale), level=QUICK_PNG)
        try:
            with (self._folder / name).open("xb") as file:
                file.write(content)
        except OSError:
            with suppress(OSError):
                (self._folder / name).unlink(missing_ok=True)  # half a frame would be read as a damaged one
            raise
        return name

    def close(self) -> None:
        """Every file is closed already."""


class LosslessVideo:
    """One video file in the FFV1 codec, 8 bits, lossless.

    Parameters
    ----------
    folder
        An existing folder, for ``frames.mkv``.
    frames_per_s
        Rate for players; the index contains the real times.
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
        """End the file and check its number of frames."""
        if self._writer is None:
            return
        self._writer.release()
        self._writer = None
        cv2 = opencv("video files")
        with quiet_decoders(), quiet_ffmpeg():
            written = cv2.VideoCapture(str(self._file.resolve()), cv2.CAP_FFMPEG)
            count = int(written.get(cv2.CAP_PROP_FRAME_COUNT)) if written.isOpened() else 0
            written.release()
        if abs(count - self._saved) > 1 + 0.01 * self._saved:  # this container stores only its duration
            raise OSError(5, f"the video holds {count} of {self._saved} frames")

    def _opened(self, columns: int, rows: int) -> Any:
        cv2 = opencv("video files")
        codec = cv2.VideoWriter.fourcc(*"FFV1")
        with quiet_decoders(), quiet_ffmpeg():
            writer = cv2.VideoWriter(
                str(self._file.resolve()), cv2.CAP_FFMPEG, codec, self._rate, (columns, rows), isColor=False
            )
        if not writer.isOpened():
            raise OSError(5, "OpenCV cannot write an FFV1 video here")
        return writer
