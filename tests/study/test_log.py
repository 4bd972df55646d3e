from __future__ import annotations

import threading
from dataclasses import replace
from typing import IO, TYPE_CHECKING

import pytest
from tests.study.made import made_study

from tsis.errors import RecordsError
from tsis.files.atomic import Disk
from tsis.files.hash_chain import LogDraft
from tsis.study.folder import enter_readings, open_study
from tsis.study.log import LOG_FILE, append_log, read_log
from tsis.study.plan import DeviceReading

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.files.hash_chain import LogChain


class FailingDisk(Disk):
    """Fails at one step."""

    def __init__(self, step: str) -> None:
        self._step = step

    def _fail(self, step: str) -> None:
        if step == self._step:
            raise OSError(28, "No space left on device")

    def reopen(self, path: Path) -> IO[bytes]:
        self._fail("reopen")
        return super().reopen(path)

    def write(self, file: IO[bytes], content: bytes) -> None:
        if self._step == "write":
            super().write(file, content[: len(content) // 2])
        self._fail("write")
        super().write(file, content)

    def sync(self, file: IO[bytes]) -> None:
        self._fail("sync")
        super().sync(file)


def note(chain: LogChain) -> list[LogDraft]:
    return [LogDraft(actor="Ada", action="said", content={"lines": chain.lines})]


@pytest.mark.parametrize("step", ["reopen", "write", "sync"])
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


def test_readings_are_entered_without_reading_the_log_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = made_study(tmp_path / "study")
    code, other = study.plan.codes[:2]
    reading = DeviceReading(device="thumb", operator="Ada", code=code, repeat=1, score=1.0)
    study = enter_readings(study, [reading], actor="Ada")
    monkeypatch.setattr("tsis.files.hash_chain.read_bytes", None)
    after = enter_readings(study, [replace(reading, code=other)], actor="Ada")
    monkeypatch.undo()
    assert after == open_study(study.folder)
    assert [each.code for each in after.readings] == [code, other]
