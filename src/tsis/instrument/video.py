"""Frames of a video file, each decoded once."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

from tsis.errors import FileInputError
from tsis.files.reading import file_size
from tsis.instrument.image_files import opencv

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


class Video:
    """A video file, read on from the last frame that was asked for.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    FileInputError
        When the file is missing or holds no video that can be decoded.
    MissingExtraError
        Without OpenCV, of the extra ``camera``.
    """

    def __init__(self, path: Path) -> None:
        file_size(path)
        self._path, self._cv = path, opencv("frames of a video")
        self._open()

    def _open(self) -> None:
        self._capture, self._next = self._cv.VideoCapture(str(self._path)), 0
        if not self._capture.isOpened():
            raise FileInputError(f"{self._path.name} must be a video that can be decoded; got another file")

    @property
    def count(self) -> int:
        """Number of frames that the file states."""
        return int(self._capture.get(self._cv.CAP_PROP_FRAME_COUNT))

    @property
    def rate_hz(self) -> float:
        """Frames per second that the file states; `FileInputError` where it states none."""
        rate = float(self._capture.get(self._cv.CAP_PROP_FPS))
        if not 0.01 < rate < 1e5:  # nor NaN
            raise FileInputError(f"{self._path.name} must state its frames per second; got {rate:g}")
        return rate

    def levels(self, number: int) -> NDArray[Any]:
        """Levels of a frame, from 0, shape (rows, columns, 3), red first; `FileInputError` behind the video's end."""
        if number < self._next:
            self._open()
        while True:
            ok, levels = self._capture.read()
            self._next += 1
            if not ok or levels is None:
                raise FileInputError(
                    f"frame {number} of {self._path.name} must be decodable; the video ends or breaks before it"
                )
            if self._next > number:
                frame: NDArray[Any] = levels[..., ::-1].copy()
                return frame


def opened_video(path: Path) -> Video:
    """The video of a file, which stays open until another is asked for, or the file has changed."""
    try:
        state = path.stat()
    except OSError:
        return Video(path)
    return _opened(path.absolute(), state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=1)
def _opened(path: Path, changed_ns: int, size: int) -> Video:
    return Video(path)
