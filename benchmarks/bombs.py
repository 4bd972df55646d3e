"""Files that are larger inside than outside: what refuses them, how fast, and with how much memory.

Run ``python -m benchmarks.bombs``. Each is loaded in a process of its own; memory is its largest above what it had
before. The exit code is 1 where one is accepted that may not be, or takes more than 200 MB; the time is printed and not
judged.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.hostile.bomb_files import bombs
from benchmarks.hostile.workers import peak_mb
from benchmarks.mutated_files import every_loader
from rich.console import Console
from rich.table import Table

from tsis.errors import TsisError

if TYPE_CHECKING:
    from benchmarks.hostile.bomb_files import Bomb
    from benchmarks.hostile.loader import Loader

MOST_MB = 200.0
MOST_MEMORY = 8 * 2**30


@dataclass(frozen=True, slots=True, kw_only=True)
class Blast:
    """What a bomb did: the sentence of its refusal, or how it was not refused."""

    refused: bool
    said: str
    seconds: float
    memory_mb: float


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


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    some = parser.add_mutually_exclusive_group()
    some.add_argument("--quick", action="store_true", help="leave out those that take long to make")
    some.add_argument("--large", action="store_true", help="only those that take long to make")
    options = parser.parse_args()
    loaders = {loader.name: loader for loader in every_loader()}
    table, bad = Table("loader", "bomb", "CPU s", "MB", "said"), 0
    for bomb in bombs():
        if (options.quick and bomb.large) or (options.large and not bomb.large):
            continue
        found = blast(bomb, loaders[bomb.loader])
        sound = (found.refused or (bomb.harmless and found.said == "read")) and found.memory_mb < MOST_MB
        bad += not sound
        mark = "" if sound else "BAD: "
        table.add_row(bomb.loader, bomb.name, f"{found.seconds:.2f}", f"{found.memory_mb:.0f}", mark + found.said[:160])
    Console(width=170).print(table)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
