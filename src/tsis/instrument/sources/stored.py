"""What image files and videos have in common as cameras: one mode, nothing to set."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from tsis.instrument.file_bytes import as_path, printable_path
from tsis.model.errors import CameraError

if TYPE_CHECKING:
    import os

    from tsis.instrument.camera import Mode, Setting


class StoredFrames:
    """Frames on disk behind the camera protocol; a subclass lists its one mode and yields the frames.

    Parameters
    ----------
    path
        The file or folder.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._path = as_path(path)
        self._running = threading.Event()

    @property
    def name(self) -> str:
        """The file's or folder's name."""
        return self._path.name

    def modes(self) -> tuple[Mode, ...]:
        """The one mode that the frames were stored in."""
        raise NotImplementedError

    def settings(self) -> tuple[Setting, ...]:
        """Nothing can be set on stored frames."""
        return ()

    def adjust(self, name: str, value: float) -> None:
        """Refuse: nothing can be set on stored frames."""
        raise CameraError(f"{name} cannot be set to {value:g}: {printable_path(self._path)} holds stored frames")

    def start(self, mode: Mode | None = None) -> None:
        """Begin at the first frame; ``mode`` may only be the one of `modes`."""
        (only,) = self.modes()
        if mode not in (None, only):
            raise CameraError(f"mode must be {only} for these stored frames; got {mode}")
        self._running.set()

    def _require_started(self) -> None:
        if not self._running.is_set():
            raise CameraError(f"{printable_path(self._path)} must be started before frames are read; call start()")

    def _not_opened(self) -> CameraError:
        return CameraError(f"{printable_path(self._path)} must be opened first; call open()")
