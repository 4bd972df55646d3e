"""States of a disk that may be there after power was lost, made of the steps that were recorded."""

from __future__ import annotations

import hashlib
import random
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from tests.records.power_loss import Trace

BLOCK = 512
FOLDER = -1  # what a name stands for besides files, which are numbered


@lru_cache(maxsize=100_000)
def sha256(content: bytes) -> str:
    """Hash of what a file holds, worked out once."""
    return hashlib.sha256(content).hexdigest()


@cache
def _parent(path: str) -> str:
    return str(Path(path).parent)


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """What a disk may hold: bytes by path, folders, and which commit the database is at (-1: it is not there)."""

    files: dict[str, bytes]
    folders: frozenset[str]
    commit: int

    def key(self) -> bytes:
        """Equal for equal states only."""
        files = sorted((path, sha256(content)) for path, content in self.files.items())
        return hashlib.sha256(repr((sorted(self.folders), self.commit, files)).encode()).digest()


class Playback:
    """The disk after the first steps of a trace, of which some syncs did nothing.

    Parameters
    ----------
    trace
        What was recorded.
    skipped
        Numbers of the syncs that did nothing.
    database
        Folder that the database lies in.
    """

    def __init__(self, trace: Trace, *, skipped: Collection[int] = (), database: str) -> None:
        self._trace, self._skipped, self._database = trace, skipped, database
        self.names: dict[str, list[int | None]] = {}  # what each may stand for: what lasts, then the pending ones
        self._written: dict[int, bytes] = {}
        self._synced: dict[int, bytes] = {}
        self._lasting_commit, self._commit, self.taken = 0, 0, 0
        self._known: dict[tuple[int, int], bytes] = {}

    def step(self) -> None:
        """Take the next step of the trace."""
        step = self._trace.steps[self.taken]
        skipped = self.taken in self._skipped
        self.taken += 1
        if step.kind == "create":
            self._written[step.file] = b""
            self._name(step.path).append(step.file)
        elif step.kind == "write":
            self._written[step.file] += step.content
        elif step.kind == "sync" and not skipped:
            self._synced[step.file] = self._written[step.file]
        elif step.kind == "rename":
            self._name(step.path).append(None)
            over = self._name(step.to)
            over += [None, step.file] if over[-1] is not None else [step.file]
        elif step.kind == "name":
            self._name(step.path).append(None)
            self._name(step.to).append(step.file)
        elif step.kind == "make_folder":
            self._name(step.path).append(FOLDER)
        elif step.kind == "remove":
            self._name(step.path).append(None)
        elif step.kind == "sync_folder" and not skipped:
            for path, values in self.names.items():
                if _parent(path) == step.path:
                    del values[:-1]
        elif step.kind == "commit":
            self._commit += 1
            if step.value:
                self._lasting_commit = self._commit

    def _name(self, path: str) -> list[int | None]:
        return self.names.setdefault(path, [None])

    def systematic(self) -> Iterator[State]:
        """All pending there, none, and each single one otherwise than the rest."""
        unsure = sorted({path for path, values in self.names.items() if len(values) > 1})
        for rest in (-1, 0):
            yield self._state({}, rest, None, rest)
            for path in unsure:
                for which in range(len(self.names[path])):
                    yield self._state({path: which}, rest, None, -1)
        for damage in range(4):
            yield self._state({}, -1, damage, -1)
        yield self._state({}, -1, None, 0)

    def drawn(self, rng: random.Random) -> State:
        """One at random."""
        few = rng.random() < 0.5  # most of the rest there: what is lost alone hurts most
        chosen = {
            path: rng.randrange(len(values))
            for path, values in self.names.items()
            if len(values) > 1 and (not few or rng.random() < 0.2)
        }
        return self._state(chosen, -1, rng.randrange(1, 2**20), rng.choice((-1, 0)))

    def _state(self, chosen: dict[str, int], rest: int, damage: int | None, commit: int) -> State:
        folders: set[str] = set()
        files: dict[str, bytes] = {}
        for path in sorted(self.names):  # folders come before what is in them
            value = self.names[path][chosen.get(path, rest)]
            parent = _parent(path)
            if value is None or (parent != "." and parent not in folders):
                continue
            if value == FOLDER:
                folders.add(path)
            else:
                files[path] = self._content(value, damage)
        at = -1
        if self._database == "." or self._database in folders:
            following = self._trace.steps[self.taken].kind if self.taken < len(self._trace.steps) else ""
            last = self._commit + (following == "commit")  # it may have reached the disk before it returned
            at = last if commit == -1 else self._lasting_commit
        return State(files=files, folders=frozenset(folders), commit=at)

    def _content(self, file: int, damage: int | None) -> bytes:
        written = self._written[file]
        if self._synced.get(file) == written or damage is None:
            return written
        if (file, damage) not in self._known:
            self._known[file, damage] = damaged(written, damage, file)
        return self._known[file, damage]


def damaged(content: bytes, damage: int, salt: int) -> bytes:
    """What may be on the disk of a file that was not synced: 0 nothing, 1 half, 2 zeros, 3 garbage, above at random."""
    rng = random.Random(1_000_003 * salt + damage)
    if damage <= 1:
        return content[: damage * len(content) // 2]
    blocks = [content[i : i + BLOCK] for i in range(0, len(content), BLOCK)]
    if damage == 2:
        return bytes(len(content))
    if damage == 3:
        return rng.randbytes(len(content))
    kind = rng.randrange(4)
    if kind == 0:
        return content
    if kind == 1:
        return content[: rng.randrange(len(content) + 1)]
    odd = bytes if kind == 2 else rng.randbytes
    return b"".join(odd(len(block)) if rng.random() < 0.4 else block for block in blocks)
