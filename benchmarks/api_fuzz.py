"""Calls of a running console made up by the thousand from its own description, and what it answers.

Run ``python -m benchmarks.api_fuzz --cases 10000``. A console is started with the virtual probe and a store of its
own; cases are made up as its description allows, as it forbids, and as nobody would write (NaN, endless numbers, halves
of letters, nesting, other types), by who holds the camera and by who does not. A fault is an answer from 500 on that is
not documented, an answer that the description does not tell of, or a refusal of what the description allows. The exit
code is 1 where there is one.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from benchmarks.calls.made_up import WAYS, MadeUpCalls
from benchmarks.calls.tally import KEPT, Tally
from rich.console import Console
from rich.table import Table
from tests.console.running import running_console

if TYPE_CHECKING:
    from collections.abc import Callable


def made_up(
    address: str,
    key: dict[str, str],
    *,
    cases: int,
    each: int = 3,
    seed: int = 1,
    progress: Callable[[Tally], None] = lambda tally: None,
) -> Tally:
    """At least so many cases against a console that runs.

    Parameters
    ----------
    address, key
        Where it listens, and the header that lets in.
    cases
        How many at least.
    each
        How many for each call and way in a round.
    seed
        Of everything that is made up.
    progress
        Told after each round.
    """
    calls = MadeUpCalls(address, key)
    try:
        number = seed * 1000
        while calls.tally.cases < cases:
            calls.round(number, each=each)
            progress(calls.tally)
            number += 1
    finally:
        calls.close()
    return calls.tally


def show(tally: Tally, console: Console) -> None:
    """Print counts by status, then the faults."""
    found = sorted({status for _, status in tally.statuses})
    table = Table("cases", *(str(status) for status in found), "in all", title="Answers by status")
    for way in WAYS:
        counts = [tally.statuses[way, status] for status in found]
        table.add_row(way, *(str(count) for count in counts), str(sum(counts)))
    console.print(table)
    calls = Table("call", *(str(status) for status in found), "median (ms)", "slowest", title="Answers by call")
    for call in sorted({call for call, _ in tally.calls}):
        took = sorted(1000.0 * each for each in tally.seconds[call])
        times = f"{median(took):.0f}", f"{took[-1]:.0f}"
        calls.add_row(call, *(str(tally.calls[call, status] or "") for status in found), *times)
    console.print(calls)
    for fault, count in tally.faults.most_common(KEPT):
        console.print(f"{count} x {fault}", markup=False, soft_wrap=True)


def main() -> int:
    """Print the tables; the exit code is 1 where there is a fault."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--each", type=int, default=3, help="cases of each way for each call in a round")
    parser.add_argument(
        "--seed", type=int, default=1, choices=range(1, 90), metavar="1..89", help="targets are numbered by it"
    )
    options = parser.parse_args()
    began = time.monotonic()
    people = Console(stderr=True)

    def told(tally: Tally) -> None:
        for fault, count in tally.faults.most_common(KEPT):
            people.print(f"{count} x {fault}", markup=False, soft_wrap=True)
        people.print(f"{tally.cases} cases, {sum(tally.faults.values())} faults, {time.monotonic() - began:.0f} s")

    with tempfile.TemporaryDirectory() as folder, running_console(Path(folder)) as running:
        tally = made_up(
            running.address, running.key, cases=options.cases, each=options.each, seed=options.seed, progress=told
        )
        lines = (Path(folder) / "console.log").read_text().splitlines()
    console = Console(width=150)
    show(tally, console)
    console.print(
        f"{tally.cases} cases in {time.monotonic() - began:.0f} s, {tally.server_errors} server errors, "
        f"{sum(tally.faults.values())} faults in all, {len(lines)} lines in the console's log"
    )
    for line in lines[-KEPT:]:
        console.print(line, markup=False, soft_wrap=True)
    return 1 if tally.faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
