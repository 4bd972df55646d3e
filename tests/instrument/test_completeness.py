"""A file that was cut short never becomes pixels, wherever it was cut."""

from __future__ import annotations

import io
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from tsis.errors import FileInputError
from tsis.files.images import jpeg_fault
from tsis.instrument.image_files import read_image

if TYPE_CHECKING:
    from pathlib import Path

KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "png": ("PNG", {}),
    "jpeg": ("JPEG", {}),
    "progressive jpeg": ("JPEG", {"progressive": True}),
    "bmp": ("BMP", {}),
    "tiff": ("TIFF", {}),
    "tiff lzw": ("TIFF", {"compression": "tiff_lzw"}),
    "tiff deflate": ("TIFF", {"compression": "tiff_deflate"}),
}


@cache
def _file(kind: str, colour: bool) -> bytes:
    shape = (23, 19, 3) if colour else (23, 19)
    pixels = np.random.default_rng(6).integers(0, 256, shape).astype(np.uint8)
    file_format, options = KINDS[kind]
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, file_format, **options)
    return buffer.getvalue()


@pytest.mark.parametrize("colour", [False, True])
@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=120, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_a_cut_file_is_refused_or_still_holds_every_pixel(
    tmp_path: Path, kind: str, colour: bool, share: float
) -> None:
    data = _file(kind, colour)
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    whole.write_bytes(data)
    cut.write_bytes(data[: int(share * len(data))])
    try:
        kept = read_image(cut)
    except FileInputError:
        return
    assert kind.startswith("tiff"), "only a TIFF may lose bytes that hold no pixel"
    np.testing.assert_array_equal(kept.grey, read_image(whole).grey)


def test_the_end_marker_of_a_thumbnail_does_not_end_the_file() -> None:
    thumbnail = b"\xff\xd8\xff\xda\x00\x02\xff\xd9"
    body = b"\xff\xe1" + (len(thumbnail) + 2).to_bytes(2, "big") + thumbnail
    start = b"\xff\xd8" + body + b"\xff\xda\x00\x02" + b"\x12\xff\x00\x34\xff\xd0\x56"
    assert jpeg_fault(start + b"\xff\xd9") is None
    assert "truncated" in str(jpeg_fault(start))


def test_bytes_after_the_end_of_a_jpeg_are_allowed() -> None:
    assert jpeg_fault(_file("jpeg", colour=False) + b"maker's own bytes") is None
