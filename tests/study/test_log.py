from __future__ import annotations

import threading
from typing import IO, TYPE_CHECKING

import pytest
from tests.study.made import made_study

from tsis.errors import RecordsError
from tsis.files import Disk
from tsis.study import LOG_FILE
from tsis.study._log import Draft, append_log, read_log

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.study._log import Chain


class FailingDisk(Disk):
    """Fails at one step."""

    def __init__(self, step: str) -> None:
        self._step = step

    def _fail(self, step: str) -> None:
        if step == self._step:
            raise OSError(28, "No space left on device")

    def create(self, path: Path, *, private: bool = False) -> IO[bytes]:
        self._fail("create")
        return super().create(path, private=private)

    def write(self, file: IO[bytes], content: bytes) -> None:
        if self._step == "write":
            super().write(file, content[: len(content) // 2])
        self._fail("write")
        super().write(file, content)

    def sync(self, file: IO[bytes]) -> None:
        self._fail("sync")
        super().sync(file)

    def rename(self, draft: Path, path: Path) -> None:
        self._fail("rename")
        super().rename(draft, path)


def note(chain: Chain) -> list[Draft]:
    return [Draft(actor="Ada", action="said", content={"lines": chain.lines})]


@pytest.mark.parametrize("step", ["create", "write", "sync", "rename"])
def test_a_full_disk_at_any_step_leaves_the_log_as_it_was(tmp_path: Path, step: str) -> None:
    folder = made_study(tmp_path / "study").folder
    before = (folder / LOG_FILE).read_bytes()
    with pytest.raises(RecordsError, match="No space left"):
        append_log(folder, note, disk=FailingDisk(step))
    assert (folder / LOG_FILE).read_bytes() == before
    append_log(folder, note)
    assert (folder / LOG_FILE).read_bytes().startswith(before)
    assert sorted(path.name for path in folder.iterdir()) == ["log.jsonl", "sealed.json", "study.json"]


def test_lines_of_many_writers_are_all_there(tmp_path: Path) -> None:
    folder = made_study(tmp_path / "study").folder
    threads = [threading.Thread(target=append_log, args=(folder, note)) for _ in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    chain = read_log(folder)
    assert not chain.breaks
    assert [entry.content.get("lines") for entry in chain.entries[1:]] == list(range(1, 13))


def test_nothing_is_added_to_a_log_that_does_not_fit(tmp_path: Path) -> None:
    folder = made_study(tmp_path / "study").folder
    changed = (folder / LOG_FILE).read_bytes().replace(b"maker", b"faker")
    (folder / LOG_FILE).write_bytes(changed)
    with pytest.raises(RecordsError, match="line 1 was changed"):
        append_log(folder, note)
    assert (folder / LOG_FILE).read_bytes() == changed
