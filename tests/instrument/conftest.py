from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import cv2
import numpy as np
import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

ROWS, COLUMNS = 13, 17


class Write(Protocol):
    """Writes pixels with OpenCV to a file of that name; colour is given red first."""

    def __call__(self, name: str, pixels: NDArray[Any]) -> Path: ...


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def written(name: str, pixels: NDArray[Any]) -> Path:
        path = tmp_path / name
        assert cv2.imwrite(str(path), pixels if pixels.ndim == 2 else pixels[..., ::-1])
        return path

    return written


@pytest.fixture
def grey() -> NDArray[np.uint8]:
    return np.random.default_rng(0).integers(0, 256, (ROWS, COLUMNS)).astype(np.uint8)


@pytest.fixture
def colour() -> NDArray[np.uint8]:
    return np.random.default_rng(1).integers(0, 256, (ROWS, COLUMNS, 3)).astype(np.uint8)
