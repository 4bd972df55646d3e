"""Disks that are full, damaged, read-only or over quota at any one step, and what a store makes of them."""

from __future__ import annotations

import errno
import json
import os
import shutil
import sys
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING
from unittest import mock

from tests.present.test_lump_map import map_of
from tests.records.sample import WHEN, levels, sample_calibration, sample_estimate

from tsis.errors import RecordsError
from tsis.files.atomic import UNFINISHED, Disk
from tsis.model.image import TactileImage
from tsis.records import database as engines
from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tsis.records.store import Store

REASONS = (errno.ENOSPC, errno.EIO, errno.EROFS, errno.EDQUOT)
SHORT = 500  # of a sentence


class FailingDisk(Disk):
    """Fails at a step once it is armed: that one only, or all from then on until it is mended.

    Parameters
    ----------
    reason
        Number of the error.
    lasting
        Whether all later steps fail as well; files are taken away always.
    """

    def __init__(self, reason: int, *, lasting: bool) -> None:
        self._reason, self._lasting = reason, lasting
        self._left: int | None = None
        self.failed = False

    def arm(self, at: int | None) -> None:
        """Fail before the step of that number, counted from now; never for None."""
        self._left, self.failed = at, False

    def create(self, path: Path, *, private: bool = False) -> IO[bytes]:
        self._step()
        return super().create(path, private=private)

    def write(self, file: IO[bytes], content: bytes) -> None:
        try:
            self._step()
        except OSError:
            super().write(file, content[: len(content) // 2])  # what still found room
            raise
        super().write(file, content)

    def sync(self, file: IO[bytes]) -> None:
        self._step()
        super().sync(file)

    def rename(self, draft: Path, path: Path) -> None:
        self._step()
        super().rename(draft, path)

    def name(self, draft: Path, path: Path) -> None:
        self._step()
        super().name(draft, path)

    def sync_folder(self, folder: Path) -> None:
        self._step()
        super().sync_folder(folder)

    def make_folder(self, folder: Path, *, private: bool = False) -> None:
        self._step()
        super().make_folder(folder, private=private)

    def _step(self) -> None:
        if self._left is None:
            return
        self._left -= 1
        if self._left == -1 or (self._lasting and self._left < 0):
            self.failed = True
            raise OSError(self._reason, os.strerror(self._reason))


@dataclass
class Tally:
    """At how many points something failed, and what went wrong then."""

    points: int = 0
    refused: int = 0  # the call raised one sentence
    wrong: list[str] = field(default_factory=list)


def image(seed: int) -> TactileImage:
    """A frame."""
    return TactileImage(grey=levels(seed), full_scale=255.0, force_n=1.0)


def add_press(store: Store) -> None:
    """Store a frame that is new to the store, with its calibration."""
    store.add_press(store.target(1), image(7), taken=WHEN, calibration=sample_calibration())


def add_known_press(store: Store) -> None:
    """Store a frame that is there already."""
    store.add_press(store.target(1), image(1), taken=WHEN)


def add_estimate(store: Store) -> None:
    """Store an estimate, its samples and its calibration."""
    presses = store.presses(store.target(1))[:1]
    store.add_estimate(
        store.target(1),
        sample_estimate(),
        kind="inclusion",
        presses=presses,
        probe="p",
        calibration=sample_calibration(),
    )


def add_map(store: Store) -> None:
    """Store a map, its file and its calibration."""
    presses = store.presses(store.target(1))[:1]
    store.add_map(store.target(1), map_of(1), presses=presses, probe="p", calibration=sample_calibration())


def edit(store: Store) -> None:
    """Change a press."""
    store.edit_press(store.presses(store.target(1))[0], note="changed")


def add_target(store: Store) -> None:
    """Enter another target."""
    store.add_target(name="b")


CALLS: tuple[Callable[[Store], None], ...] = (add_press, add_known_press, add_estimate, add_map, edit, add_target)


def begin(folder: Path) -> None:
    """A store with one press."""
    with open_store(folder, actor="before") as store:
        store.add_press(store.add_target(name="a"), image(1), taken=WHEN)


def failing_steps(folder: Path, call: Callable[[Store], None], reason: int, *, lasting: bool) -> Tally:
    """Let a call fail at its first step, its second, and so on until it passes."""
    found = Tally()
    begin(folder / "base")
    for at in range(1000):
        place = folder / str(at)
        shutil.copytree(folder / "base", place)
        disk = FailingDisk(reason, lasting=lasting)
        with open_store(place, actor="bench", disk=disk) as store:
            before = _entries(store)
            disk.arm(at)
            refused = _refused(partial(call, store), found)
            failed = disk.failed
            disk.arm(None)
            _judge(store, call, found, refused=refused, before=before)
        shutil.rmtree(place)
        if not failed:
            return found
        found.points += 1
    raise AssertionError("a call has no end")


def failing_openings(folder: Path, reason: int, *, lasting: bool) -> Tally:
    """Let the making of a store fail at each of its steps."""
    found = Tally()
    for at in range(1000):
        disk = FailingDisk(reason, lasting=lasting)
        disk.arm(at)
        place = folder / f"new-{at}" / "phantoms"
        _refused(lambda: open_store(place, actor="bench", disk=disk).close(), found)  # noqa: B023 - used at once
        if not disk.failed:
            return found
        found.points += 1
        with open_store(place, actor="bench") as store:
            store.add_press(store.add_target(), image(1), taken=WHEN)
            found.wrong += verify_store(store).faults
    raise AssertionError("opening has no end")


def full_databases(folder: Path, call: Callable[[Store], None], *, pages: int = 8) -> Tally:
    """Repeat a call until the database has no page left, with so many different numbers of pages."""
    found = Tally()
    begin(folder / "base")
    with open_store(folder / "base") as store, store.database.reading() as connection:
        least = connection.exec_driver_sql("PRAGMA page_count").scalar_one()
    for most in range(least, least + pages):
        place = folder / str(most)
        shutil.copytree(folder / "base", place)
        limited = mock.patch.object(engines, "_PRAGMAS", (*engines._PRAGMAS, f"max_page_count={most}"))
        with limited, open_store(place, actor="bench") as full:
            before = _entries(full)
            while not _refused(partial(call, full), found):
                before = _entries(full)
            found.points += 1
            _sound(full, found)
        with open_store(place, actor="bench") as store:
            _judge(store, call, found, refused=True, before=before)
        shutil.rmtree(place)
    return found


def _refused(call: Callable[[], None], found: Tally) -> bool:
    try:
        call()
    except RecordsError as error:
        found.refused += 1
        if "\n" in str(error) or len(str(error)) > SHORT:
            found.wrong.append(f"no sentence: {error}")
        return True
    except Exception as error:
        found.wrong.append(f"{type(error).__name__}: {error}")
        return True
    return False


def _judge(store: Store, call: Callable[[Store], None], found: Tally, *, refused: bool, before: int) -> None:
    """All is as before or as after the call, and where it was refused it passes now."""
    if refused and _entries(store) != before:
        found.wrong.append("a call was refused, and had stored something")
    if not refused and _entries(store) == before:
        found.wrong.append("a call passed, and had stored nothing")
    _sound(store, found)
    if refused:
        call(store)
        if _entries(store) == before:
            found.wrong.append("a call passed in the end, and had stored nothing")
        _sound(store, found)


def _sound(store: Store, found: Tally) -> None:
    found.wrong += verify_store(store).faults
    found.wrong += [f"left: {path.name}" for path in store.folder.rglob(f"*{UNFINISHED}")]
    store.levels(store.presses(store.target(1))[0].frame)


def _entries(store: Store) -> int:
    return verify_store(store).head.number


def filled(folder: Path, ballast: int) -> Iterator[tuple[int, Tally]]:
    """Store presses on a real file system until it is full, free ``ballast`` bytes, and go on; twice.

    Yields
    ------
    tuple
        How many presses were acknowledged in all, and what was found by then.
    """
    (folder / "ballast").write_bytes(bytes(ballast))
    acknowledged: list[str] = []
    found = Tally()
    with open_store(folder / "phantoms", actor="bench") as store:
        target = store.add_target()
        for freed in (False, True):
            refused = False
            for seed in range(10_000):
                kept: list[str] = []
                refused = _refused(lambda: kept.append(_pressed(store, target, seed)), found)  # noqa: B023
                acknowledged += kept
                if refused:
                    break
            found.points += 1
            if not refused:
                found.wrong.append("it never was full")
            if {press.id for press in store.presses(target)} != set(acknowledged):
                found.wrong.append("presses are not those that were acknowledged")
            found.wrong += verify_store(store).faults
            if not freed:
                (folder / "ballast").unlink()
            yield len(acknowledged), found
    (folder / "phantoms" / "records.sqlite3").stat()


def _pressed(store: Store, target: object, seed: int) -> str:
    return store.add_press(target, image(seed), taken=WHEN).id  # type: ignore[arg-type]


if __name__ == "__main__":  # fills the small file system of a folder, and prints what came of it as JSON
    result = list(filled(Path(sys.argv[1]), 100_000))
    sys.stdout.write(json.dumps({"acknowledged": [number for number, _ in result], **asdict(result[-1][1])}))
