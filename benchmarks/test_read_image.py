"""What the checks of `read_image` cost beside a bare decode by OpenCV and by Pillow, on frames of 768 x 492."""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from benchmarks.image_reading import SUFFIXES, frame_file, readers

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
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_reading_a_frame_keeps_up_with_thirty_a_second(tmp_path: Path, suffix: str) -> None:
    took = {name: _median_ms(call) for name, call in readers(frame_file(tmp_path, suffix)).items()}
    print(f"\n{suffix}: " + ", ".join(f"{name} {each:.1f} ms" for name, each in took.items()))
    assert took["tsis"] < 1e3 / 30
