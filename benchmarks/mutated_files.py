"""Hostile files over every loader: what is refused, what is accepted, and whether anything else ever happens.

Run ``python -m benchmarks.mutated_files --files 1000000 --seed 1 --processes 2``. Each loader gets small whole files,
damaged in bytes, in values, in lines, and with checksums made right again. `benchmarks.hostile.verdict` says what a
*silent acceptance* is. The exit code is 1 where there is any, an exception that is no `TsisError` of one sentence, or a
crash.
"""

from __future__ import annotations

import argparse
import sys
import time
from typing import TYPE_CHECKING

import cv2
from benchmarks.hostile.detection_loaders import detection_loaders
from benchmarks.hostile.picture_loaders import picture_loaders
from benchmarks.hostile.point_loaders import point_loaders
from benchmarks.hostile.record_loaders import record_loaders
from benchmarks.hostile.store_loaders import store_loaders
from benchmarks.hostile.study_loaders import study_loaders
from benchmarks.hostile.verdict import Tally, Verdict
from benchmarks.hostile.workers import run
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from benchmarks.hostile.loader import Loader

BAD = (Verdict.SILENT, Verdict.UNTYPED, Verdict.CRASHED)


def every_loader() -> tuple[Loader, ...]:
    """All of them."""
    return (
        *picture_loaders(),
        *record_loaders(),
        *point_loaders(),
        *store_loaders(),
        *detection_loaders(),
        *study_loaders(),
    )


def shared_out(files: int, loaders: Sequence[Loader]) -> list[int]:
    """How many files each loader gets, so many in all."""
    whole = sum(loader.share for loader in loaders)
    counts = [int(files * loader.share / whole) for loader in loaders]
    counts[0] += files - sum(counts)
    return counts


def main() -> int:
    """Print the table; the exit code is 1 where something bad was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--loader", default="", help="only loaders whose names hold this text")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    loaders = [loader for loader in every_loader() if options.loader in loader.name]
    files, began = shared_out(options.files, loaders), time.monotonic()
    console = Console(width=150)
    with Progress(console=Console(stderr=True)) as bar:
        task = bar.add_task("files", total=options.files)
        tallies = run(
            loaders,
            files,
            seed=options.seed,
            processes=options.processes,
            progress=lambda done: bar.update(task, advance=done),
        )
    seconds = time.monotonic() - began
    console.print(table_of(loaders, tallies))
    for loader, tally in zip(loaders, tallies, strict=True):
        for said in tally.said:
            console.print(f"{loader.name} {said}", markup=False, highlight=False)
    console.print(
        f"{options.files} files, seed {options.seed}, {options.files / seconds / options.processes:.0f} files/s/process"
    )
    return int(any(tally.of(verdict) for tally in tallies for verdict in BAD))


def table_of(loaders: Sequence[Loader], tallies: Sequence[Tally]) -> Table:
    """One row a loader."""
    table = Table("loader", "files", *(verdict.value for verdict in Verdict), "slowest / ms", "memory / MB")
    whole = Tally()
    for loader, tally in zip(loaders, tallies, strict=True):
        table.add_row(loader.name, *_cells(tally))
        whole = whole.with_all(tally)
    table.add_row("all", *_cells(whole))
    return table


def _cells(tally: Tally) -> list[str]:
    counts = [str(tally.of(verdict)) for verdict in Verdict]
    return [str(tally.files), *counts, f"{tally.slowest_ms:.0f}", f"{tally.memory_mb:.0f}"]


if __name__ == "__main__":
    sys.exit(main())
