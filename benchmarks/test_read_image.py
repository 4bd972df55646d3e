"""What the checks of `read_image` cost beside a bare decode by OpenCV and by Pillow, on frames of 768 x 492."""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from PIL import Image

from tsis.instrument import read_image

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

REPEATS = 20


def _median_ms(call: Callable[[], Any]) -> float:
    times = []
    for _ in range(REPEATS):
        started = perf_counter()
        call()
        times.append(1e3 * (perf_counter() - started))
    return float(np.median(times))


@pytest.mark.benchmark
@pytest.mark.parametrize("suffix", ["png", "bmp", "jpg", "tif"])
def test_reading_a_frame_keeps_up_with_thirty_a_second(tmp_path: Path, suffix: str) -> None:
    rows, columns = np.mgrid[:492, :768]
    noise = np.random.default_rng(0).normal(0.0, 2.0, rows.shape)
    frame = (120 + 100 * np.exp(-((rows - 246) ** 2 + (columns - 384) ** 2) / 2e4) + noise).clip(0, 255)
    path = tmp_path / f"frame.{suffix}"
    assert cv2.imwrite(str(path), frame.astype(np.uint8))

    ours = _median_ms(lambda: read_image(path))
    opencv = _median_ms(lambda: cv2.imread(str(path), cv2.IMREAD_UNCHANGED))
    pillow = _median_ms(lambda: np.asarray(Image.open(path)))
    print(f"\n{suffix}: read_image {ours:.1f} ms, OpenCV {opencv:.1f} ms, Pillow {pillow:.1f} ms")
    assert ours < 1e3 / 30
