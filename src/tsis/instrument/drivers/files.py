"""Image and video files as cameras, and the base of OpenCV's captures."""

from __future__ import annotations

import os
import re
import threading
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import CameraError, FileInputError, ImageMismatchError
from tsis.files.images import LARGEST_PIXELS
from tsis.files.reading import as_path, file_size, printable_path, read_head
from tsis.instrument.camera import Frame, Mode
from tsis.instrument.image_files import grey_of_opencv, opencv, quiet_decoders, quiet_ffmpeg, read_image

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.instrument.camera import Setting
    from tsis.model.image import TactileImage


class StoredFrames:
    """Frames of a file or folder behind the camera protocol; a subclass gives its mode and yields the frames."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._path = as_path(path)
        self._running = threading.Event()

    @property
    def name(self) -> str:
        """The file's or folder's name."""
        return self._path.name

    def modes(self) -> tuple[Mode, ...]:
        """The mode of the stored frames."""
        raise NotImplementedError

    def settings(self) -> tuple[Setting, ...]:
        """Stored frames have no settings."""
        return ()

    def adjust(self, name: str, value: float) -> None:
        """Refuse: stored frames have no settings."""
        raise CameraError(f"{name} cannot be set to {value:g}: {printable_path(self._path)} holds stored frames")

    def start(self, mode: Mode | None = None) -> None:
        """Begin at the first frame; ``mode`` may only be that of `modes`."""
        (only,) = self.modes()
        if mode not in (None, only):
            raise CameraError(f"mode must be {only} for these stored frames; got {mode}")
        self._running.set()

    def _require_started(self) -> None:
        if not self._running.is_set():
            raise CameraError(f"{printable_path(self._path)} must be started before frames are read; call start()")

    def _not_opened(self) -> CameraError:
        return CameraError(f"{printable_path(self._path)} must be opened first; call open()")


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


IMAGE_ENDINGS = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff")
VIDEO_ENDINGS = (".avi", ".mkv", ".mov", ".mp4", ".webm")


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sort key by which ``frame2`` comes before ``frame10``; letters without regard to case.

    Examples
    --------
    >>> sorted(["b1", "a10", "A2"], key=natural_key)
    ['A2', 'a10', 'b1']
    """
    parts = re.split(r"([0-9]+)", name.casefold())
    return tuple((0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts if part)


class ImageFiles(StoredFrames):
    """The frames stored in one image file or in a folder of image files.

    Each file is read when its frame is requested, so a long folder takes no memory. Other and hidden files are
    ignored; subfolders are not entered.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        super().__init__(path)
        self._files: tuple[Path, ...] = ()
        self._first: TactileImage | None = None

    lost = False  # reading a missing frame raises

    def open(self) -> None:
        """List the files and read the first one.

        Raises `FileInputError` when there is no such file or folder, it holds no image, or the first image cannot be
        read.
        """
        self._files = _listed(self._path)
        self._first = read_image(self._files[0])

    def modes(self) -> tuple[Mode, ...]:
        """The mode: size and range of the first image."""
        first = self._opened()
        rows, columns = first.grey.shape
        return (Mode(width_px=columns, height_px=rows, full_scale=first.full_scale),)

    def frames(self) -> Iterator[Frame]:
        """Yield one frame a file.

        Raises `FileInputError` when a file cannot be read; the frames before it have been yielded; `ImageMismatchError`
        when an image differs from the first in size or range.
        """
        self._require_started()
        first = self._opened()
        for sequence, file in enumerate(self._files):
            image = first if sequence == 0 else read_image(file)
            if first.grey.shape != image.grey.shape or first.full_scale != image.full_scale:
                raise ImageMismatchError(
                    f"frames of one folder must have one format; {first.name!r} has shape {first.grey.shape} and full "
                    f"scale {first.full_scale:g}, {image.name!r} has {image.grey.shape} and {image.full_scale:g}"
                )
            # Whole grey levels have the smallest integer type; those of colour images are fractions.
            whole = image.grey.astype(np.uint8 if image.full_scale <= 255 else np.uint16)
            yield Frame(
                pixels=whole if np.array_equal(whole, image.grey) else image.grey,
                sequence=sequence,
                full_scale=image.full_scale,
                name=file.name,
                settings=image.settings,
            )
            if not self._running.is_set():
                return

    def stop(self) -> None:
        """End the stream."""
        self._running.clear()

    def _opened(self) -> TactileImage:
        if self._first is None:
            raise self._not_opened()
        return self._first


def _listed(path: Path) -> tuple[Path, ...]:
    try:
        if not path.is_dir():
            file_size(path)  # raises for what is no readable file
            return (path,)
        entries = [entry for entry in path.iterdir() if entry.suffix.lower() in IMAGE_ENDINGS]
    except (OSError, ValueError) as error:
        if isinstance(error, FileInputError):
            raise
        raise FileInputError(f"{printable_path(path)} must be a readable file or folder; got: {error}") from error
    files = [entry for entry in entries if not entry.name.startswith(".")]
    if not files:
        kinds = ", ".join(IMAGE_ENDINGS)
        raise FileInputError(f"{printable_path(path)} must hold at least one image ({kinds}); got none")
    return tuple(sorted(files, key=lambda entry: (natural_key(entry.name), entry.name)))
