"""Image files as a camera, and the common base with videos: one mode, no settings."""

from __future__ import annotations

import re
import threading
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import CameraError, FileInputError, ImageMismatchError
from tsis.files import as_path, file_size, printable_path
from tsis.instrument._camera import Frame, Mode
from tsis.instrument._image_files import read_image

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator
    from pathlib import Path

    from tsis.instrument._camera import Setting
    from tsis.model import TactileImage


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


IMAGE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff"})


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
        entries = [entry for entry in path.iterdir() if entry.suffix.lower() in IMAGE_SUFFIXES]
    except (OSError, ValueError) as error:
        if isinstance(error, FileInputError):
            raise
        raise FileInputError(f"{printable_path(path)} must be a readable file or folder; got: {error}") from error
    files = [entry for entry in entries if not entry.name.startswith(".")]
    if not files:
        kinds = ", ".join(sorted(IMAGE_SUFFIXES))
        raise FileInputError(f"{printable_path(path)} must hold at least one image ({kinds}); got none")
    return tuple(sorted(files, key=lambda entry: (natural_key(entry.name), entry.name)))
