"""Files that are larger inside than outside: what refuses them, how fast, and with how much memory.

Run ``python -m tests.hostile.bombs quick`` (or ``large``, those that take long to make). Each is loaded in a process of
its own; memory is its largest above what it had before. The exit code is 1 where one is accepted that may not be, or
takes more than 200 MB; the time is printed and not judged.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tests.hostile.bomb_files import bombs
from tests.hostile.every_loader import every_loader

from tsis.errors import TsisError

if TYPE_CHECKING:
    from tests.hostile.bomb_files import Bomb
    from tests.hostile.loader import Loader

MOST_MB = 200.0
MOST_MEMORY = 8 * 2**30


@dataclass(frozen=True, slots=True, kw_only=True)
class Blast:
    """What a bomb did: the sentence of its refusal, or how it was not refused."""

    refused: bool
    said: str
    seconds: float
    memory_mb: float


def peak_mb() -> float:
    """Largest memory of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def blast(bomb: Bomb, loader: Loader) -> Blast:
    """Load a bomb in a fork and measure."""
    with tempfile.TemporaryDirectory() as place:
        path = loader.laid(Path(place))
        path.write_bytes(bomb.make())
        if bomb.longest:
            os.truncate(path, bomb.longest)
        elif loader.settle is not None:
            loader.settle(Path(place))
        reading, writing = os.pipe()
        process = os.fork()
        if process == 0:
            _measure(loader, path, writing)
        os.close(writing)
        with os.fdopen(reading, "rb") as answers:
            said = answers.read()
        _, status = os.waitpid(process, 0)
    if not said:
        return Blast(refused=False, said=f"the process ended with status {status}", seconds=0.0, memory_mb=0.0)
    return Blast(**json.loads(said))


def _measure(loader: Loader, path: Path, writing: int) -> None:
    try:
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
        before, began, refused = peak_mb(), time.process_time(), False
        try:
            loader.load(path)
            said = "read"
        except TsisError as error:
            refused, said = True, str(error).replace(str(path), path.name)
        except Exception as error:  # told, and judged by whoever reads it
            said = f"{type(error).__name__}: {error!s:.200}"
        found = {
            "refused": refused,
            "said": said,
            "seconds": time.process_time() - began,
            "memory_mb": peak_mb() - before,
        }
        os.write(writing, json.dumps(found).encode())
    finally:
        os._exit(0)


def main(kind: str) -> int:
    """Load the bombs that are ``quick`` to make, or the ``large`` ones; 1 where one does harm."""
    loaders, bad = {loader.name: loader for loader in every_loader()}, 0
    for bomb in bombs():
        if bomb.large != (kind == "large"):
            continue
        found = blast(bomb, loaders[bomb.loader])
        sound = (found.refused or (bomb.harmless and found.said == "read")) and found.memory_mb < MOST_MB
        bad += not sound
        mark = "" if sound else "BAD: "
        line = f"{bomb.loader}, {bomb.name}: {found.seconds:.2f} s, {found.memory_mb:.0f} MB, {mark}{found.said[:160]}"
        sys.stdout.write(line + "\n")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
