"""Video files as a camera, and the common base of OpenCV's captures of files and devices."""

from __future__ import annotations

import os
import threading
from typing import TYPE_CHECKING, Any

from tsis.errors import CameraError, FileInputError
from tsis.files import LARGEST_PIXELS, printable_path, read_head
from tsis.instrument._camera import Frame, Mode
from tsis.instrument._image_files import grey_of_opencv
from tsis.instrument._quiet import opencv, quiet_decoders, quiet_ffmpeg
from tsis.instrument.drivers._files import StoredFrames

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray


# Numbers of OpenCV's properties CAP_PROP_...: a reader of this module needs no OpenCV.
POS_MSEC, WIDTH, HEIGHT, FPS, FRAME_COUNT, BRIGHTNESS, GAIN, EXPOSURE = 0, 3, 4, 5, 7, 10, 14, 15


class OpenCVCapture:
    """A capture of OpenCV behind the camera protocol; a subclass opens it and names itself in `_not_opened`."""

    _not_opened: Callable[[], CameraError]

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._capture: Any = None
        self._lock = threading.Lock()  # OpenCV's captures belong to one thread at a time
        self._running = threading.Event()
        self._lost = False

    @property
    def lost(self) -> bool:
        """True when the frames ended early: the device stopped answering, or the file is cut short."""
        return self._lost

    def modes(self) -> tuple[Mode, ...]:
        """The present mode of the device, or the declared mode of the file; without a rate where it declares none."""
        capture = self._opened()
        width, height = (int(capture.get(side)) for side in (WIDTH, HEIGHT))
        rate = float(capture.get(FPS))
        return (Mode(width_px=width, height_px=height, frames_per_s=rate if rate > 0 else None),)

    def stop(self) -> None:
        """End the stream, and release the device or file."""
        self._running.clear()
        with self._lock:
            if self._capture is not None:
                self._capture.release()
                self._capture = None

    def _opened(self) -> Any:
        if self._capture is None:
            raise self._not_opened()
        return self._capture


# containers without an index only estimate their number of frames, from the duration
_COUNT_TOLERANCE = 0.01
# FFmpeg would follow these to other files or addresses
_LISTS = (b"#", b"<", b"ffconcat", b"v=0", b"[")


class VideoFile(OpenCVCapture, StoredFrames):
    """The frames of a video file, decoded one at a time; colour becomes grey by the Rec. 709 luma.

    Videos have 8 bits and mostly lossy compression, so they are poor for measurements. A video that ends before its
    declared number of frames raises after its last complete frame.

    Parameters
    ----------
    path
        A video file that OpenCV's FFmpeg can decode (AVI, MP4, MKV and others).
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        super().__init__(path)

    def open(self) -> None:
        """Open the file and read its header.

        Raises `FileInputError` when there is no such file, it is no regular file, empty, cut short or no video.
        """
        self.stop()
        path = printable_path(self._path)
        if read_head(self._path).lstrip().startswith(_LISTS):
            raise FileInputError(f"{path} must be a video file; got a list that names other files")
        cv2 = opencv("video files")
        with quiet_decoders(), quiet_ffmpeg():
            # by its absolute path, so that no name is taken for an address, a device or a pattern
            capture = cv2.VideoCapture(os.path.realpath(self._path), cv2.CAP_FFMPEG)
        if not capture.isOpened():
            raise FileInputError(f"{path} must be a complete video file; no decoder could open it")
        columns, rows = (int(capture.get(side)) for side in (WIDTH, HEIGHT))
        if not 0 < columns * rows <= LARGEST_PIXELS:
            capture.release()
            raise FileInputError(f"{path} must hold at most {LARGEST_PIXELS} pixels a frame; got {columns} x {rows}")
        self._capture, self._lost = capture, False

    def frames(self) -> Iterator[Frame]:
        """Yield the frames in order, with their times in the video.

        Raises
        ------
        FileInputError
            After the last whole frame, when the file ends before its declared number of frames.
        """
        self._require_started()
        declared = int(self._opened().get(FRAME_COUNT))
        # The last frame of a file that is cut short may be decoded from half its bytes, so one frame waits.
        waiting, read = self._next(0), 1
        while waiting is not None and self._running.is_set():
            following = self._next(read)
            if following is None:
                break
            yield waiting
            waiting, read = following, read + 1
        if not self._running.is_set():
            return
        delivered = read if waiting is not None else 0
        if delivered + max(1.0, _COUNT_TOLERANCE * declared) <= declared:
            self._lost = True
            raise FileInputError(
                f"{printable_path(self._path)} declares {declared} frames and is cut short after "
                f"{max(delivered - 1, 0)}"
            )
        if waiting is not None:
            yield waiting

    def _next(self, sequence: int) -> Frame | None:
        pixels: NDArray[Any] | None
        with self._lock:
            if self._capture is None:  # stopped by another thread
                return None
            try:
                present, pixels = self._capture.read()
            except (opencv("video files").error, MemoryError) as error:
                raise FileInputError(
                    f"{printable_path(self._path)} must be a readable video; decoding failed"
                ) from error
            time_s = float(self._capture.get(POS_MSEC)) / 1000.0
        if not present or pixels is None:
            return None
        return Frame(pixels=grey_of_opencv(pixels), sequence=sequence, time_s=time_s, name=f"{self.name}#{sequence}")
