"""A frame as bytes, read by other means than it was written with."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from PIL import Image

from tsis.console.live.hub import display_levels, packet
from tsis.instrument.acquisition import ReceivedFrame
from tsis.instrument.camera import Frame

if TYPE_CHECKING:
    from numpy.typing import NDArray


def arrival(pixels: NDArray[Any], full_scale: float = 255.0) -> ReceivedFrame:
    return ReceivedFrame(frame=Frame(pixels=pixels, sequence=0, full_scale=full_scale), arrived_s=1.0)


def taken_apart(created: bytes) -> tuple[dict[str, Any], bytes]:
    """The header's fields, each cut out by hand."""
    whole = {
        name: int.from_bytes(created[a:b], "little")
        for name, a, b in (("encoding", 4, 5), ("number", 8, 12), ("rows", 12, 14), ("columns", 14, 16))
    }
    real = {"came_ms": np.frombuffer(created[16:24], "<f8")[0], "full_scale": np.frombuffer(created[24:28], "<f4")[0]}
    return {"magic": created[:4], **whole, **real}, created[32:]


@settings(max_examples=30)
@given(
    pixels=arrays(np.uint8, array_shapes(min_dims=2, max_dims=2, max_side=40)),
    number=st.integers(0, 2**40),
    came_ms=st.floats(0, 1e14),
)
def test_a_raw_frame_comes_whole(pixels: NDArray[np.uint8], number: int, came_ms: float) -> None:
    head, body = taken_apart(packet(arrival(pixels), number=number, came_ms=came_ms))
    assert head["magic"] == b"TSF1"
    assert (head["encoding"], head["number"]) == (0, number % 2**32)
    assert (head["came_ms"], head["full_scale"]) == (came_ms, 255.0)
    assert body == pixels.tobytes()
    assert (head["rows"], head["columns"]) == pixels.shape


@pytest.mark.parametrize("full_scale", [15, 1023, 4095, 65535])
def test_deep_frames_are_brought_to_what_a_screen_shows(full_scale: int) -> None:
    pixels = np.linspace(0, full_scale, 60 * 50).round().astype(np.uint16).reshape(60, 50)
    head, body = taken_apart(packet(arrival(pixels, full_scale), number=1, came_ms=0.0))
    shown = np.frombuffer(body, np.uint8).reshape(60, 50)
    assert head["full_scale"] == full_scale
    assert np.abs(shown - pixels.astype(float) * 255 / full_scale).max() <= 0.5 + 1e-3
    assert (shown.min(), shown.max()) == (0, 255)


def test_levels_beyond_full_scale_are_shown_as_full() -> None:
    assert display_levels(arrival(np.array([[-3.0, 12.0, 24.0, 90.0]]), 24.0)).tolist() == [[0, 128, 255, 255]]


@pytest.mark.parametrize(("quality", "most"), [(50, 2.5), (85, 1.5), (100, 0.6)])
def test_a_picture_is_what_the_frame_was_but_for_its_quality(quality: int, most: float) -> None:
    x, y = np.meshgrid(np.arange(160.0), np.arange(120.0))
    smooth = 20 + 200 * np.exp(-((x - 90) ** 2 + (y - 50) ** 2) / 800)
    noisy = smooth + np.random.default_rng(3).normal(0, 1, smooth.shape)
    pixels = noisy.round().clip(0, 255).astype(np.uint8)
    head, body = taken_apart(packet(arrival(pixels), number=1, came_ms=0.0, jpeg_quality=quality))
    picture = Image.open(io.BytesIO(body))
    assert head["encoding"] == 1
    assert (picture.mode, picture.size) == ("L", (160, 120))
    error = np.asarray(picture, float) - pixels
    assert np.sqrt(np.mean(error**2)) < most
    assert len(body) < pixels.nbytes


def test_better_pictures_take_more_bytes_and_err_less() -> None:
    pixels = np.random.default_rng(4).integers(0, 255, (64, 64), dtype=np.uint8)
    bodies = [taken_apart(packet(arrival(pixels), number=1, came_ms=0.0, jpeg_quality=q))[1] for q in (1, 50, 100)]
    errors = [float(np.abs(np.asarray(Image.open(io.BytesIO(body)), float) - pixels).mean()) for body in bodies]
    assert sorted(map(len, bodies)) == [*map(len, bodies)]
    assert sorted(errors, reverse=True) == errors
