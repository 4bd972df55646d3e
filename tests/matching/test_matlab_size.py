"""MATLAB files: what SciPy writes is let through, what declares more than it holds is not."""

from __future__ import annotations

import io
import struct
import zlib
from typing import Any, cast

import numpy as np
import pytest
import scipy.io

from tsis.matching.matlab_size import require_small_inside
from tsis.model.errors import FileInputError

MOST = 2**20
HEADER = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"


def _saved(values: Any, *, compressed: bool) -> bytes:
    stream = io.BytesIO()
    scipy.io.savemat(cast("Any", stream), {"a": values}, do_compression=compressed)
    return stream.getvalue()


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize(
    "values",
    [
        np.arange(6.0).reshape(2, 3),
        np.array([[1]], np.uint8),
        np.zeros((0, 3)),
        "some text",
        {"one": np.eye(3), "two": {"deep": np.arange(5)}},
        np.array([np.eye(2), "text", np.zeros((3, 0))], dtype=object),
        np.array([True, False]),
        np.array([1 + 2j]),
        [],
    ],
)
def test_what_scipy_writes_is_let_through(values: Any, compressed: bool) -> None:
    require_small_inside(_saved(values, compressed=compressed), most=MOST)


def _matrix(sides: tuple[int, ...], kind: int = 6) -> bytes:
    dimensions = struct.pack(f"<{len(sides)}i", *sides)
    body = struct.pack("<IIII", 6, 8, kind, 0) + struct.pack("<II", 5, len(dimensions)) + dimensions
    return struct.pack("<II", 14, len(body)) + body


def _packed(content: bytes) -> bytes:
    packed = zlib.compress(content)
    return struct.pack("<II", 15, len(packed)) + packed


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "version 5"),
        (b"\x89HDF\r\n\x1a\n" + bytes(200), "version 5"),
        (HEADER + _matrix((1, 2**30), kind=1), "must fit into it"),
        (HEADER + _packed(_matrix((2**15, 2**15))), "must fit into it"),
        (HEADER + _matrix((-1, 5)), "must fit into it"),
        (HEADER + _packed(bytes(2 * MOST)), "at most 1048576 bytes"),
        (HEADER + struct.pack("<II", 14, 2**31), "cut short"),
        (HEADER + struct.pack("<II", 15, 5) + b"xxxxx", "damaged"),
        (HEADER + (struct.pack("<II", 1, 0) * 110_000), "at most 100000 elements"),
    ],
)
def test_what_is_a_trap_is_refused(content: bytes, said: str) -> None:
    with pytest.raises(FileInputError, match=said):
        require_small_inside(content, most=MOST)
