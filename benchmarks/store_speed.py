"""How fast a store of records keeps a press, and how its lists slow down as it grows.

Run ``python -m benchmarks.store_speed [--rows 100 100000]``. A press is a frame of 768 x 492 with its record. Beside
it, in turns on the same disk: the frame's PNG alone written, synced, renamed, its folder synced; a row alone in SQLite,
synced; nothing but the PNG's compression. Lists are of stores whose rows are entered in bulk, with an honest audit;
every call is of one that was opened before. The exit code is 1 where a bound is passed.
"""

from __future__ import annotations

import os
import sqlite3
import sys
import tempfile
import time
import uuid
from contextlib import closing
from datetime import UTC, datetime, timedelta
from functools import partial
from itertools import islice, product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.harness import Bench, Goal, Several
from sqlalchemy import insert

from tsis.model.image import TactileImage
from tsis.records.audit import AuditChange, append_audit, locked_head
from tsis.records.blobs import frame_bytes
from tsis.records.rows import press_row, target_row
from tsis.records.schema import frame_table, press_table, target_table
from tsis.records.store import Store, open_store
from tsis.records.values import StoredPress, Target

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from sqlalchemy import Table

MOST_MS = {"press": 25.0, "list": 50.0, "million": 200.0}
OWN, ADDED = "tsis: frame, row, audit, anchor", "add_press()"
IN_ONE = 20_000  # rows in a transaction
BEGUN = datetime(2026, 1, 1, tzinfo=UTC)


def frame(rng: np.random.Generator) -> TactileImage:
    """A frame as large as the dissertation's, with a bright patch and noise."""
    y, x = np.mgrid[:492, :768]
    patch = 120 * np.exp(-(((x - 384) / 90) ** 2) - ((y - 246) / 90) ** 2)
    grey = np.clip(np.rint(25 + patch + rng.normal(0, 1, patch.shape)), 0, 255)
    return TactileImage(grey=grey, full_scale=255.0, force_n=1.0)


def saving(folder: Path, count: int, seed: int) -> dict[str, list[float]]:
    """Milliseconds of each way to keep a frame, in turns."""
    rng = np.random.default_rng(seed)
    found: dict[str, list[float]] = {}
    with open_store(folder / "store") as store, closing(plain_database(folder / "plain.sqlite3")) as plain:
        target = store.add_target()
        for number in range(count):
            image = frame(rng)
            content = frame_bytes(image)
            ways: dict[str, Callable[[], object]] = {
                OWN: partial(store.add_press, target, image, taken=BEGUN),
                "PNG compressed, nothing written": partial(frame_bytes, image),
                "PNG written, synced, renamed, folder synced": partial(_kept, folder / f"{number}.png", content),
                "one row in SQLite, synced": partial(_entered, plain),
            }
            for name, way in ways.items():
                began = time.perf_counter()
                way()
                found.setdefault(name, []).append(1e3 * (time.perf_counter() - began))
    return found


def plain_database(path: Path) -> sqlite3.Connection:
    """A database with one table, which syncs each transaction."""
    plain = sqlite3.connect(path)
    plain.execute("PRAGMA journal_mode=WAL")
    plain.execute("PRAGMA synchronous=FULL")
    plain.execute("CREATE TABLE presses (id TEXT, taken TEXT, note TEXT)")
    return plain


def kept_plainly(plain: sqlite3.Connection, path: Path, image: TactileImage) -> None:
    """What a press comes to without a record of who, when and what: the same PNG file, and a row."""
    _kept(path, frame_bytes(image))
    _entered(plain)


def _kept(path: Path, content: bytes) -> None:
    draft = path.with_suffix(".part")
    with draft.open("xb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)
    handle = os.open(path.parent, os.O_RDONLY)
    os.fsync(handle)
    os.close(handle)


def _entered(plain: sqlite3.Connection) -> None:
    with plain:
        plain.execute("INSERT INTO presses VALUES (?, ?, ?)", (uuid.uuid4().hex, BEGUN.isoformat(), ""))


def grown(folder: Path, count: int, spread: int, *, frames: int | None = None) -> None:
    """A store of so many presses over so many targets, which share ``frames`` frames; these are never read here."""
    distinct = count if frames is None else min(frames, count)
    kept = [
        Target(number=i + 1, kind="phantom", name=f"target {i}", made=BEGUN, id=uuid.uuid4().hex) for i in range(spread)
    ]
    with open_store(folder) as store:
        _enter(store, target_table, map(target_row, kept))
        shape = {"rows": 492, "columns": 768, "bytes": 200_000}
        _enter(store, frame_table, ({"id": f"{i:064x}", **shape} for i in range(distinct)))
        _enter(store, press_table, (press_row(_press(kept[i % spread], i, i % distinct)) for i in range(count)))


def _enter(store: Store, table: Table, rows: Iterable[dict[str, Any]]) -> None:
    for some in batched(rows, IN_ONE):
        changes = [AuditChange(action="add", kind=table.name, row=str(row["id"]), values=row) for row in some]
        with store.database.writing() as connection:
            connection.execute(insert(table), list(some))
            append_audit(connection, locked_head(connection), changes, actor="bulk")


def batched(rows: Iterable[dict[str, Any]], size: int) -> Iterator[list[dict[str, Any]]]:
    """Lists of so many; `itertools.batched` is of Python 3.12."""
    left = iter(rows)
    while some := list(islice(left, size)):
        yield some


def _press(target: Target, number: int, frame: int) -> StoredPress:
    return StoredPress(
        role="target",
        taken=BEGUN + timedelta(seconds=number),
        frame=f"{frame:064x}",
        rows=492,
        columns=768,
        full_scale=255.0,
        force_n=1.0,
        axis_px=(383.5, 245.5),
        probe="tsis-2011",
        settings={"exposure_ms": 10.0, "gain": 1.0},
        name=f"{number}.png",
        id=uuid.uuid4().hex,
        target=target.id,
    )


def listing(store: Store, repeats: int) -> dict[str, list[float]]:
    """Milliseconds of each list; the first of an opened store counts everything."""
    began = time.perf_counter()
    first = store.targets()[0]
    found = {"targets(), the first time": [1e3 * (time.perf_counter() - began)]}
    target, size = first.target, first.presses
    calls: dict[str, Callable[[], object]] = {
        "targets()": store.targets,
        "targets(), after a change": store.targets,
        "target(number)": lambda: store.target(1),
        "targets() and those whose name holds 7": lambda: [s for s in store.targets() if "7" in s.target.name][:50],
        "presses(target, limit=50)": lambda: store.presses(target, limit=50),
        f"presses(target, limit=50, offset={size - 50})": lambda: store.presses(target, limit=50, offset=size - 50),
    }
    image = frame(np.random.default_rng(3))
    calls[ADDED] = lambda: store.add_press(target, image, taken=BEGUN)
    if size <= 1000:
        calls[f"presses(target), all {size}"] = lambda: store.presses(target)
    for number in range(repeats):
        for name, call in calls.items():
            if name.endswith("a change"):
                target = store.edit_target(target, note=f"change {number}")
            began = time.perf_counter()
            call()
            found.setdefault(name, []).append(1e3 * (time.perf_counter() - began))
    return found


def _row(name: str, values: list[float]) -> tuple[str, str, str]:
    return name, f"{np.median(values):.1f} ms", f"{np.quantile(values, 0.95):.1f} ms"


def main() -> int:
    """Print the tables; the exit code is 1 where a bound is passed."""
    bench = Bench(__doc__, presses=200, rows=[100_000], targets=Several(), frames=int, repeats=20, folder=Path)
    heads = ("what", "median", "95 %")
    with tempfile.TemporaryDirectory(prefix="tsis-speed-", dir=bench.folder) as folder:
        found = saving(Path(folder), bench.presses, 1)
        bench.table(f"{bench.presses} presses kept", heads, [_row(*each) for each in found.items()])
        goals = [Goal(name="a press, median ms", value=float(np.median(found[OWN])), most=MOST_MS["press"])]
        for rows, spread in product(bench.rows, map(int, bench.targets or (100, 1))):
            place = Path(folder) / f"{rows}-of-{spread}"
            grown(place, rows, spread, frames=bench.frames)
            began = time.perf_counter()
            with open_store(place) as store:
                opened = 1e3 * (time.perf_counter() - began)
                listed = {"open_store": [opened], **listing(store, bench.repeats)}
            title = f"{rows} presses of {spread} target{'s' if spread > 1 else ''}"
            bench.table(title, heads, [_row(*each) for each in listed.items()])
            slowest = max(float(np.median(each)) for name, each in listed.items() if name != ADDED)
            most = MOST_MS["list" if rows < 1_000_000 else "million"]
            goals.append(Goal(name=f"{title}: slowest list, median ms", value=slowest, most=most))
    return bench.end(goals)


if __name__ == "__main__":
    sys.exit(main())
