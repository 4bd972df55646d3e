"""Histories of stores that nobody tampered with."""

from __future__ import annotations

import shutil
import subprocess
import sys
import threading
from typing import TYPE_CHECKING

from tests.records.tampered import fill

from tsis.errors import RecordsError
from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    import random
    from collections.abc import Callable
    from pathlib import Path


def empty(folder: Path, _rng: random.Random) -> None:
    open_store(folder).close()


def edited(folder: Path, rng: random.Random) -> None:
    with open_store(folder, actor="ñ") as store:
        fill(store, rng.randrange(100), targets=rng.randint(1, 3))


def two_writers(folder: Path, rng: random.Random) -> None:
    """Who verifies meanwhile sees no fault either."""
    open_store(folder).close()
    seed = rng.randrange(100)
    faults: list[str] = []

    def work(of: int) -> None:
        with open_store(folder) as store:
            fill(store, of)

    writers = [threading.Thread(target=work, args=(seed + 200 * at,)) for at in range(2)]
    for writer in writers:
        writer.start()
    with open_store(folder) as store:
        while any(writer.is_alive() for writer in writers):
            faults += verify_store(store).faults
    if faults:
        raise AssertionError(f"a store that was written to meanwhile had the faults {faults}")


def killed_writer(folder: Path, rng: random.Random) -> None:
    """One that was killed in the midst of a save."""
    command = [sys.executable, "-m", "tests.records.writer", str(folder), "-", str(rng.randrange(100)), "100000"]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as writer:
        assert writer.stdout is not None
        for _ in range(rng.randint(1, 30)):
            writer.stdout.readline()
        writer.kill()


def killed_before_the_anchor(folder: Path, rng: random.Random) -> None:
    """One that was killed between row and anchor; another went on."""
    with open_store(folder) as store:
        fill(store, 1)
        shutil.copy(folder / "audit-anchor.json", folder / "lagging")
        store.add_target()
        (folder / "lagging").replace(folder / "audit-anchor.json")
    if rng.random() < 0.5:
        with open_store(folder) as store:
            fill(store, 2)


def refused_writes(folder: Path, rng: random.Random) -> None:
    """Some of what was asked of it could not be done."""
    with open_store(folder) as store:
        fill(store, rng.randrange(100))
        target = store.target(1)
        for changes in ({"name": "late"}, {"name": "too late"}):
            try:
                store.edit_target(target, **changes)
            except RecordsError:
                continue


HONEST: dict[str, Callable[[Path, random.Random], None]] = {
    "empty": empty,
    "filled and edited": edited,
    "two writers, verified meanwhile": two_writers,
    "a writer killed in a save": killed_writer,
    "killed before the anchor": killed_before_the_anchor,
    "refused edits": refused_writes,
}
