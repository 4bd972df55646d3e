"""A frame of 768 x 492 as an image file, and the programs that read it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from PIL import Image

from tsis.instrument.image_files import read_image

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

SUFFIXES = ("png", "bmp", "jpg", "tif")


def frame_file(folder: Path, suffix: str) -> Path:
    """A bright patch with noise, written by OpenCV."""
    rows, columns = np.mgrid[:492, :768]
    noise = np.random.default_rng(0).normal(0.0, 2.0, rows.shape)
    frame = (120 + 100 * np.exp(-((rows - 246) ** 2 + (columns - 384) ** 2) / 2e4) + noise).clip(0, 255)
    path = folder / f"frame.{suffix}"
    if not cv2.imwrite(str(path), frame.astype(np.uint8)):
        raise OSError(f"OpenCV did not write {path.name}")
    return path


def readers(path: Path) -> dict[str, Callable[[], object]]:
    """Calls that read the file, by program; the first is ours."""
    return {
        "tsis": lambda: read_image(path),
        "OpenCV": lambda: cv2.imread(str(path), cv2.IMREAD_UNCHANGED),
        "Pillow": lambda: np.asarray(Image.open(path)),
    }
