"""States of a disk made from what a program really asked of the system, SQLite's own files and all, as strace tells it.

Of each file that was not synced every single write may be there, be cut short at a block, or be missing, and so may
each truncation; names are as in `tests.records.power_loss`. The wal-index is left out: SQLite makes it anew.
"""

from __future__ import annotations

import json
import random
import re
import subprocess
import sys
import tempfile
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tests.records.power_loss import image
from tests.records.sample import WHEN

from tsis.errors import RecordsError
from tsis.records.audit import ANCHOR_FILE as ANCHOR
from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

ROOT = Path(__file__).parents[2]
BLOCK = 512
FOLDER = -1
CALLS = (
    "open,openat,creat,write,pwrite64,fsync,fdatasync,rename,renameat,renameat2,link,linkat,unlink,unlinkat,"
    "mkdir,mkdirat,ftruncate"
)
_LINE = re.compile(r"^(\d+)\s+(\w+)\((.*)\)\s+= (-?\d+)(?:<.*>)?[^<>]*$")
_TEXT = re.compile(r'"((?:\\x[0-9a-f]{2})*)"')


@dataclass(frozen=True, slots=True, kw_only=True)
class Call:
    """One call of the system that passed."""

    name: str
    paths: tuple[str, ...] = ()
    handle: int = -1
    content: bytes = b""
    numbers: tuple[int, ...] = ()
    flags: str = ""
    result: int = 0


@dataclass
class Disk:
    """What was asked of it, and what of that lasts."""

    root: str
    names: dict[str, list[int | None]] = field(default_factory=dict)
    lasting: dict[int, bytes] = field(default_factory=dict)
    pending: dict[int, list[tuple[int, bytes | None]]] = field(default_factory=dict)  # None: cut at that length
    handles: dict[int, tuple[str, int | None]] = field(default_factory=dict)
    places: dict[int, int] = field(default_factory=dict)
    acknowledged: list[dict[str, Any]] = field(default_factory=list)
    under_way: bool = True  # whether a save was begun since the last acknowledgement
    files: int = 0

    def take(self, call: Call, *, skipped: bool = False) -> None:
        """Do what was asked; a sync that is ``skipped`` does nothing."""
        if call.name in ("open", "openat", "creat"):
            self._open(call)
        elif call.name in ("write", "pwrite64"):
            self._write(call)
        elif call.name in ("fsync", "fdatasync"):
            path, file = self.handles.get(call.handle, ("", None))
            if not skipped and file is not None:
                self.lasting[file] = self.content(file, None)
                self.pending[file] = []
            elif not skipped and path:
                for name, values in self.names.items():
                    if str(Path(name).parent) == path:
                        del values[:-1]
        elif call.name == "ftruncate":
            _, file = self.handles.get(call.handle, ("", None))
            if file is not None:
                self.pending[file].append((call.numbers[-1], None))
        elif call.name.startswith("mkdir") and self._inside(call.paths[0]):
            self._name(call.paths[0]).append(FOLDER)
        elif call.name.startswith("unlink") and self._inside(call.paths[0]):
            self._name(call.paths[0]).append(None)
        elif call.name.startswith(("rename", "link")) and self._inside(call.paths[1]):
            given, taken = self._name(call.paths[0]), self._name(call.paths[1])
            if taken[-1] is not None:
                taken.append(None)
            taken.append(given[-1])
            if call.name.startswith("rename"):
                given.append(None)
            self.under_way = True

    def _open(self, call: Call) -> None:
        path = call.paths[0]
        self.handles.pop(call.result, None)
        if path.endswith("/acknowledged"):
            self.handles[call.result] = ("acknowledged", None)
        if not self._inside(path) or path.endswith("-shm"):
            return
        now = self._name(path)[-1] if path != self.root else FOLDER
        if now is None and ("O_CREAT" in call.flags or call.name == "creat"):
            now, self.files = self.files, self.files + 1
            self._name(path).append(now)
            self.lasting[now], self.pending[now] = b"", []
        elif now is not None and now != FOLDER and "O_TRUNC" in call.flags:
            self.pending[now].append((0, None))
        self.handles[call.result] = (path, None if now == FOLDER else now)
        self.places[call.result] = 0

    def _write(self, call: Call) -> None:
        path, file = self.handles.get(call.handle, ("", None))
        if path == "acknowledged":
            self.acknowledged += [json.loads(line) for line in call.content.splitlines()]
            self.under_way = False
        elif file is not None:
            at = call.numbers[-1] if call.name == "pwrite64" else self.places[call.handle]
            self.pending[file].append((at, call.content[: call.result]))
            if call.name == "write":
                self.places[call.handle] += call.result

    def _inside(self, path: str) -> bool:
        return path == self.root or path.startswith(self.root + "/")

    def _name(self, path: str) -> list[int | None]:
        return self.names.setdefault(path, [None])

    def content(self, file: int, rng: random.Random | None, *, kept: float = 1.0) -> bytes:
        """Of a file: all that was asked, or a part of it at random."""
        found = bytearray(self.lasting[file])
        for at, written in self.pending[file]:
            if rng is not None and rng.random() >= kept:
                continue
            if written is None:
                found = found[:at] + bytes(max(0, at - len(found)))
                continue
            some = written
            if rng is not None and rng.random() < 0.3 * (kept < 1):
                some = written[: BLOCK * rng.randrange(len(written) // BLOCK + 1)]
            found += bytes(max(0, at - len(found)))
            found[at : at + len(some)] = some
        return bytes(found)

    def put(self, place: Path, rng: random.Random) -> None:
        """Make a state that may be there after power was lost now."""
        newest, kept = rng.choice((0.0, 0.5, 0.9, 1.0)), rng.choice((0.0, 0.5, 0.9, 1.0))
        place.mkdir(mode=0o700)
        for path in sorted(self.names):
            values = self.names[path]
            value = values[-1] if rng.random() < newest else rng.choice(values) if newest else values[0]
            here = place / Path(path).relative_to(self.root)
            if value is None or not here.parent.is_dir():
                continue
            if value == FOLDER:
                here.mkdir(mode=0o700)
            else:
                here.write_bytes(self.content(value, rng, kept=kept))


def traced(folder: Path, program: str) -> tuple[list[Call], str]:
    """Calls of a Python program that is told in ``sys.argv`` where to store, and where to acknowledge."""
    root, acknowledged, result = folder / "disk", folder / "acknowledged", folder / "told"
    root.mkdir()
    strace = ["strace", "-f", "-y", "-xx", "-s", "4000000", "-e", f"trace={CALLS}", "-o", str(result)]
    subprocess.run([*strace, sys.executable, "-c", program, str(root), str(acknowledged)], check=True, cwd=ROOT)
    return list(_calls(result)), str(root)


def _calls(told: Path) -> Iterator[Call]:
    begun: dict[str, str] = {}
    with told.open() as lines:
        for line in lines:
            whole = line.rstrip("\n")
            process = whole.split(maxsplit=1)[0]
            if whole.endswith("<unfinished ...>"):
                begun[process] = whole.removesuffix("<unfinished ...>")
                continue
            if "resumed>" in whole and process in begun:
                whole = begun.pop(process) + whole.split("resumed>", 1)[1]
            found = _LINE.match(whole)
            if found is not None and int(found[4]) >= 0:
                yield _call(found[2], found[3], int(found[4]))


def _call(name: str, arguments: str, result: int) -> Call:
    texts = [bytes.fromhex(each.replace("\\x", "")) for each in _TEXT.findall(arguments)]
    rest = _TEXT.sub("", arguments)
    handle = re.match(r"\d+", arguments)
    numbers = tuple(int(each) for each in re.findall(r"(?<=, )\d+(?=,|$)", rest))
    if name in ("write", "pwrite64"):
        return Call(
            name=name, handle=int(handle[0]) if handle else -1, content=texts[0], numbers=numbers, result=result
        )
    with suppress(UnicodeDecodeError):
        paths = tuple(each.decode() for each in texts)
        return Call(
            name=name, paths=paths, handle=int(handle[0]) if handle else -1, numbers=numbers, flags=rest, result=result
        )
    return Call(name="other")


def losses(
    calls: list[Call], root: str, place: str, *, seed: int, states: int, skipped: Collection[int] = ()
) -> tuple[int, list[str]]:
    """How many states were opened, and what was lost in them; ``place`` is that of the store below the root."""
    rng = random.Random(seed)
    first = next(number for number, call in enumerate(calls) if call.content.startswith(b'{"id"'))
    changing = [number for number, call in enumerate(calls) if number >= first and not call.name.startswith("open")]
    points = sorted(rng.choices(changing, k=states))
    disk, found, opened, at = Disk(root=root), [], 0, 0
    with tempfile.TemporaryDirectory(prefix="tsis-calls-") as folder:
        for point in points:
            for number in range(at, point + 1):
                disk.take(calls[number], skipped=number in skipped)
            at = max(at, point + 1)
            if disk.acknowledged:
                state = Path(folder) / str(opened)
                disk.put(state, rng)
                opened += 1
                found += [f"{opened}, call {point}: {each}" for each in _missing(state / place, disk)]
    return opened, found


def syncs(calls: list[Call], root: str) -> dict[str, list[int]]:
    """Numbers of the syncs by what is synced: ``log``, ``database``, ``draft``, ``folder``, else how it ends."""
    disk, found = Disk(root=root), dict[str, list[int]]()
    kinds = {"": "folder", ".unfinished": "draft", ".sqlite3": "database", ".sqlite3-wal": "log"}
    for number, call in enumerate(calls):
        disk.take(call)
        if call.name in ("fsync", "fdatasync") and call.handle in disk.handles:
            path, file = disk.handles[call.handle]
            kind = kinds.get(Path(path).suffix, Path(path).suffix) if file is not None else "folder"
            found.setdefault(kind, []).append(number)
    return found


def _missing(place: Path, disk: Disk) -> list[str]:
    anchored = (place / ANCHOR).exists()
    try:
        with open_store(place, create=False, actor="after") as store:
            verified = verify_store(store)
            with store.database.reading() as connection:
                query = "SELECT id FROM presses UNION SELECT id FROM estimates UNION SELECT id FROM targets"
                here = set(connection.exec_driver_sql(query).scalars())
            store.add_press(store.add_target(), image(9), taken=WHEN)
    except RecordsError as error:
        return [str(error)]
    # An anchor can be lost only while it is being replaced, on disks that do not even promise that renaming is atomic.
    excused = not anchored and disk.under_way
    faults = [each for each in verified.faults if not (excused and "anchor" in each)]
    return faults + [f"{each['id']} is lost" for each in disk.acknowledged if each["id"] not in here]


PROGRAM = """
import json, os, sys
from pathlib import Path
from tests.records.power_loss import image
from tests.records.sample import WHEN, sample_calibration, sample_estimate
from tsis.records.store import open_store
told = os.open(sys.argv[2], os.O_WRONLY | os.O_CREAT)
def keep(record):
    os.write(told, json.dumps({"id": record.id}).encode() + b"\\n")
    return record
for _ in range(2):
    with open_store(Path(sys.argv[1]) / "records" / "phantoms") as store:
        target = keep(store.add_target())
        presses = [keep(store.add_press(target, image(seed), taken=WHEN)) for seed in (1, 2, 1)]
        keep(store.edit_press(presses[0], note="edited"))
        keep(store.add_estimate(target, sample_estimate(), kind="inclusion", presses=presses, probe="p",
                                calibration=sample_calibration()))
"""
PLACE = "records/phantoms"
