"""MATLAB files: read as SciPy reads them; what declares more than it holds is refused."""

from __future__ import annotations

import io
import struct
import zlib
from typing import Any, cast

import numpy as np
import pytest
import scipy.io

from tsis.matching.matlab_file import read_matrices
from tsis.model.errors import FileInputError

MOST = 2**20
HEADER = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"


def _saved(values: Any, *, compressed: bool) -> bytes:
    stream = io.BytesIO()
    scipy.io.savemat(cast("Any", stream), {"a": values}, do_compression=compressed)
    return stream.getvalue()


def _same(found: Any, wanted: Any) -> None:
    """As SciPy's own reader gives it."""
    if wanted.dtype.names:
        assert [set(each) for each in found] == [set(wanted.dtype.names)] * wanted.size
        for name in wanted.dtype.names:
            for one, other in zip(found, wanted[name].ravel(order="F"), strict=True):
                _same(one[name], other)
    elif wanted.dtype == object:
        for one, other in zip(found, wanted.ravel(order="F"), strict=True):
            _same(one, other)
    elif wanted.dtype.kind == "U":
        assert found is None
    else:
        np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize(
    "values",
    [
        np.arange(6.0).reshape(2, 3),
        np.arange(24.0).reshape(2, 3, 4),
        np.array([[1]], np.uint8),
        np.array([[1, -70_000]], np.int64),
        np.array([[0.5]], np.float32),
        np.zeros((0, 3)),
        "some text",
        {"one": np.eye(3), "two": {"deep": np.arange(5)}},
        np.array([np.eye(2), "text", np.zeros((3, 0))], dtype=object),
        np.array([(1.0, 2.0), (3.0, 4.0)], dtype=[("x", float), ("y", float)]),
        np.array([True, False]),
        [],
    ],
)
def test_files_are_read_as_scipy_reads_them(values: Any, compressed: bool) -> None:
    content = _saved(values, compressed=compressed)
    wanted = scipy.io.loadmat(cast("Any", io.BytesIO(content)))["a"]
    _same(read_matrices(content, most=MOST)["a"], wanted)


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
        (HEADER + _matrix((1, 3)), "something is missing"),
        (HEADER + _matrix((1, 3), kind=1), "something is missing"),
    ],
)
def test_what_is_a_trap_is_refused(content: bytes, said: str) -> None:
    with pytest.raises(FileInputError, match=said):
        read_matrices(content, most=MOST)
