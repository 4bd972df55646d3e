"""A disk that fails at every step of storing, a database that is full at every page, and a real disk that is full.

Run ``python -m benchmarks.full_disk``. A failing point is a step of a call at which the disk says that it is full,
damaged, read-only or over quota, once or from then on. Wrong is what is lost, said otherwise than in a sentence, left
behind, or fails again when there is room. Real disks are file systems in memory, which only root may mount. The exit
code is 1 where anything was wrong.
"""

from __future__ import annotations

import argparse
import errno
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.tables import show
from tests.records.full_disk import CALLS, REASONS, Tally, failing_openings, failing_steps, filled, full_databases

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

SIZES_KB = range(600, 1000, 20)


def real_disks() -> tuple[Tally, int]:
    """Points and faults of small file systems in memory, and how many presses were acknowledged in all."""
    found, acknowledged = Tally(), 0
    for size in SIZES_KB:
        with tempfile.TemporaryDirectory(prefix="tsis-full-") as folder:
            inside = f"{sys.executable} -m benchmarks.full_disk --inside {folder}"
            command = f"mount -t tmpfs -o size={size}k tmpfs {folder} && {inside}"
            done = subprocess.run(["unshare", "-m", "sh", "-c", command], capture_output=True, text=True, check=False)
        if done.returncode:
            found.wrong.append(done.stderr.strip()[-300:])
            continue
        result = json.loads(done.stdout)
        found.points += result["points"]
        found.refused += result["refused"]
        found.wrong += result["wrong"]
        acknowledged += result["acknowledged"][-1]
    return found, acknowledged


def failing_at_every_step(reason: int) -> Iterator[Tally]:
    """Of every call, and of making a store."""
    for lasting in (True, False):
        with tempfile.TemporaryDirectory(prefix="tsis-full-") as folder:
            yield failing_openings(Path(folder), reason, lasting=lasting)
            for call in CALLS:
                yield failing_steps(Path(folder) / call.__name__, call, reason, lasting=lasting)


def full_at_every_page() -> Iterator[Tally]:
    """Of every call."""
    for call in CALLS:
        with tempfile.TemporaryDirectory(prefix="tsis-full-") as folder:
            yield full_databases(Path(folder), call)


def summed(parts: Iterable[Tally]) -> Tally:
    """All together."""
    total = Tally()
    for part in parts:
        total.points += part.points
        total.refused += part.refused
        total.wrong += part.wrong
    return total


def inside(folder: Path) -> None:
    """Fill the file system of ``folder``."""
    result = list(filled(folder, 100_000))
    print(json.dumps({"acknowledged": [number for number, _ in result], **asdict(result[-1][1])}))


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inside", type=Path, help="only fill this small file system, and tell in JSON")
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    if options.inside is not None:
        inside(options.inside)
        return 0
    tallies: dict[str, Tally] = {}
    for reason in REASONS:
        name = f"a step fails: {os.strerror(reason)} ({errno.errorcode[reason]})"
        tallies[name] = summed(failing_at_every_step(reason))
    tallies["the database is full"] = summed(full_at_every_page())
    if os.geteuid() == 0:
        total, acknowledged = real_disks()
        tallies[f"{len(SIZES_KB)} real disks of {SIZES_KB[0]} to {SIZES_KB[-1]} kB, {acknowledged} presses"] = total
    rows = [(name, str(each.points), str(each.refused), str(len(each.wrong))) for name, each in tallies.items()]
    show("Full disks", ("what", "failing points", "refused in a sentence", "wrong"), rows, markdown=options.markdown)
    wrong = [each for tally in tallies.values() for each in tally.wrong]
    for each in wrong[:20]:
        print(each)
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
