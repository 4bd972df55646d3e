"""Archives of arrays: NumPy's own come back, all others are one sentence, and nothing is unpickled."""

from __future__ import annotations

import io
import pickle
import zipfile
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hn

from tsis.errors import FileInputError
from tsis.files.archive import npy_layout, read_arrays

NUMBERS = hn.arrays(
    st.sampled_from(["<f8", "<f4", ">f8", "<i8", "u1", "<u2", "?", "<U7"]),
    hn.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=5),
)


def _archive(**arrays: Any) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


@given(one=NUMBERS, two=NUMBERS, by_column=st.booleans())
def test_what_numpy_writes_comes_back(one: Any, two: Any, by_column: bool) -> None:
    one = np.asfortranarray(one) if by_column else one
    found = read_arrays(_archive(one=one, two=two))
    for name, expected in (("one", one), ("two", two)):
        assert found[name].dtype == expected.dtype
        np.testing.assert_array_equal(found[name], expected)
    assert list(read_arrays(_archive(one=one, two=two), ["two", "three"])) == ["two"]


class _Bad:
    def __reduce__(self) -> Any:
        return (pytest.fail, ("it was unpickled",))


def test_objects_are_never_unpickled() -> None:
    objects = np.empty(1, dtype=object)
    objects[0] = _Bad()
    for content in (_archive(a=objects), pickle.dumps(_Bad())):
        with pytest.raises(FileInputError, match=r"never unpickled|archive of NumPy"):
            read_arrays(content)


def test_more_than_is_allowed_is_never_unpacked() -> None:
    content = _archive(a=np.zeros(10_000_000))
    assert len(content) < 200_000
    with pytest.raises(FileInputError, match="at most 1048576 bytes; it declares 80000128"):
        read_arrays(content, most=2**20)
    assert read_arrays(content, ["b"], most=2**20) == {}


def _members(**contents: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in contents.items():
            archive.writestr(f"{name}.npy", content)
    return stream.getvalue()


def _npy(header: str, data: bytes = b"") -> bytes:
    text = header.encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + data


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"PK\x03\x04",
        _members(a=b""),
        _members(a=_npy("{'descr': '<f8', 'fortran_order': False, 'shape': (3,)}", bytes(23))),
        _members(a=_npy("{'descr': '<f8', 'fortran_order': False, 'shape': (-1, -1)}", bytes(8))),
        _members(a=_npy("{'descr': '<f8', 'fortran_order': False, 'shape': (2**62,)}")),
        _members(a=_npy("{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (1,)}", bytes(8))),
        _members(a=_npy("{'descr': '|O', 'fortran_order': False, 'shape': (1,)}", bytes(8))),
        _members(a=_npy("{'descr': '(9,9)f8', 'fortran_order': False, 'shape': (1,)}", bytes(648))),
        _members(a=_npy("{'descr': '<f8', 'fortran_order': 1, 'shape': (1,)}", bytes(8))),
        _members(a=_npy("{'descr': '<f8', 'fortran_order': False, 'shape': (True,)}", bytes(8))),
        _members(a=_npy("((" * 3000)),
        _members(a=_npy("__import__('os')")),
    ],
)
def test_what_is_no_archive_is_one_sentence(content: bytes) -> None:
    with pytest.raises(FileInputError) as refused:
        read_arrays(content)
    assert str(refused.value).isprintable()


def test_the_layout_says_where_the_numbers_begin() -> None:
    stream = io.BytesIO()
    np.save(stream, np.arange(6.0).reshape(2, 3))
    layout = npy_layout(stream.getvalue())
    assert (layout.shape, layout.by_column, layout.start) == ((2, 3), False, 128)
    np.testing.assert_array_equal(layout.values(stream.getvalue()), np.arange(6.0).reshape(2, 3))
