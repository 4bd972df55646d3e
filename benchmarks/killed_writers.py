"""Programs that store presses, killed at random moments by SIGKILL, and what was lost of what they acknowledged.

Run ``python -m benchmarks.killed_writers --cycles 10000``. A cycle is a program that is forked, stores what it can, and
is killed; two at a time work on one store. Then another opens it and looks for everything that they acknowledged; every
500 cycles all is verified. A run on a disk that writes files under their final names at once shows that what is torn
would be seen. The exit code is 1 where something was lost, or the careless disk was not found out.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.tables import show
from tests.records.killed_writers import Careless, Found, killed_cycles

from tsis.files import DISK, Disk


def measured(cycles: int, seed: int, disk: Disk) -> tuple[Found, float]:
    """What was found, and how many seconds it took."""
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="tsis-killed-") as folder:
        return killed_cycles(Path(folder), cycles, seed=seed, disk=disk, every=max(2, min(500, cycles // 10 * 2))), (
            time.monotonic() - began
        )


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cycles", type=int, default=10_000)
    parser.add_argument("--careless", type=int, default=300, help="cycles on the careless disk")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    if min(options.cycles, options.careless) < 2:
        parser.error("--cycles and --careless must be 2 or more: two programs are killed at a time")
    runs = {
        "store": measured(options.cycles, options.seed, DISK),
        "careless disk": measured(options.careless, options.seed, Careless()),
    }
    rows = [
        (
            name,
            str(found.cycles),
            str(found.acknowledged),
            str(len(found.lost)),
            str(len(found.torn)),
            str(len(found.faults)),
            str(found.lagging),
            str(found.unnamed),
            f"{60 * found.cycles / seconds:.0f}",
        )
        for name, (found, seconds) in runs.items()
    ]
    heads = (
        "run",
        "cycles",
        "acknowledged",
        "lost",
        "torn",
        "faults",
        "anchor behind",
        "files of no row",
        "cycles/min",
    )
    show("Killed writers", heads, rows, markdown=options.markdown)
    found = runs["store"][0]
    for each in (*found.lost, *found.torn, *found.faults)[:20]:
        print(each)
    return int(bool(found.lost or found.torn or found.faults or not runs["careless disk"][0].torn))


if __name__ == "__main__":
    sys.exit(main())
