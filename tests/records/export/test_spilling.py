"""A file that refuses no write reads as one in memory does, whatever the disk says."""

from __future__ import annotations

import io
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.records.export.arrays import SpillingFile

places = st.integers(0, 60)
steps = st.lists(st.tuples(places, st.one_of(st.binary(min_size=1, max_size=20), st.integers(0, 30))), max_size=20)


class Disk:
    """A file of which bytes from a place on find no room."""

    def __init__(self, file: Any, room: int) -> None:
        self.file, self.room = file, room

    def __getattr__(self, name: str) -> Any:
        return getattr(self.file, name)

    def write(self, content: bytes) -> int:
        left = self.room - self.file.tell()
        if left <= 0:
            raise OSError(28, "No space left on device")
        return int(self.file.write(content[:left]))


@given(steps, st.integers(0, 80))
def test_it_is_a_file_in_memory_to_who_reads_it(steps: list[tuple[int, bytes | int]], room: int) -> None:
    model, end = io.BytesIO(), 0
    with tempfile.TemporaryDirectory() as folder:
        file = SpillingFile(Path(folder) / "new")
        file._file = Disk(file._file, room)  # type: ignore[assignment]
        for at, what in steps:
            assert file.seek(at) == model.seek(at)
            if isinstance(what, bytes):
                assert file.write(memoryview(what)) == model.write(what)
                end = max(end, at + len(what))
            else:
                assert file.read(what) == model.read(what)
            assert file.tell() == model.tell()
        assert file.seek(0, io.SEEK_END) == model.seek(0, io.SEEK_END)
        file.close()
        if end <= room:
            file.require_written()
            assert (Path(folder) / "new").read_bytes() == model.getvalue()
        else:
            with pytest.raises(OSError, match="No space left"):
                file.require_written()


def test_a_file_that_is_there_is_not_touched(tmp_path: Path) -> None:
    (tmp_path / "mine").write_bytes(b"mine")
    with pytest.raises(FileExistsError):
        SpillingFile(tmp_path / "mine")
    assert (tmp_path / "mine").read_bytes() == b"mine"


def test_what_else_went_wrong_is_told_first(tmp_path: Path) -> None:
    file = SpillingFile(tmp_path / "new")
    file._file = Disk(file._file, 0)  # type: ignore[assignment]

    def stop() -> None:
        file.write(memoryview(b"1"))
        raise KeyError

    with pytest.raises(KeyError), file:
        stop()
    assert file.closed
