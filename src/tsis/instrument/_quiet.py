"""Silences decoders: they must not write to the terminal."""

from __future__ import annotations

import logging
import os
import sys
import threading
import warnings
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from tsis.errors import import_extra

if TYPE_CHECKING:
    from collections.abc import Iterator


_FFMPEG_LEVEL, _FFMPEG_SILENT = "OPENCV_FFMPEG_LOGLEVEL", "-8"
# warnings.catch_warnings and the two log levels belong to the whole process, so one thread at a time may change them
_lock = threading.Lock()


@contextmanager
def quiet_decoders() -> Iterator[None]:
    """Silence Pillow and OpenCV inside the block, and restore their levels after it."""
    pillow = logging.getLogger("PIL")
    with _lock, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pillow_level = pillow.level
        pillow.setLevel(logging.CRITICAL + 1)
        loaded = sys.modules.get("cv2")
        logs = None if loaded is None else loaded.utils.logging
        opencv_level = logs and logs.setLogLevel(logs.LOG_LEVEL_SILENT)
        try:
            yield
        finally:
            if logs:
                logs.setLogLevel(opencv_level)
            pillow.setLevel(pillow_level)


@contextmanager
def quiet_ffmpeg() -> Iterator[None]:
    """Silence FFmpeg inside OpenCV, unless the environment sets its level.

    OpenCV reads the level once, when the process first opens a video.
    """
    if _FFMPEG_LEVEL in os.environ:
        yield
        return
    os.environ[_FFMPEG_LEVEL] = _FFMPEG_SILENT
    try:
        yield
    finally:
        os.environ.pop(_FFMPEG_LEVEL, None)


def opencv(feature: str) -> Any:
    """The module ``cv2``; `MissingExtraError` where it is not installed."""
    return import_extra("cv2", feature=feature, extra="camera")
