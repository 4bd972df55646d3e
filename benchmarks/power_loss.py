"""Power lost at every point of what programs do with a store, and what is missing then of what was acknowledged.

Run ``python -m benchmarks.power_loss --states 100000 --seed 1``. First as many different states of the disk as wanted,
judged by their files' hashes and rows, some also put on a real disk, opened, read, verified and added to. Then every
sync of the program is left out, one after another, which must lose something somewhere: else it, or this model, is not
needed. ``tests/records/power_loss.py`` says what a disk is believed to promise. The exit code is 1 where something was
lost, or a sync that was left out was not missed.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections import Counter
from typing import TYPE_CHECKING

from benchmarks.tables import show
from rich.console import Console
from rich.progress import track
from tests.records.power_loss import SYNCS
from tests.records.power_loss_judgement import explored, label, points, reopened, without
from tests.records.power_loss_scenarios import runs

if TYPE_CHECKING:
    from tests.records.power_loss_scenarios import Run

WEAKER = ("synchronous=NORMAL", "synchronous=OFF")


def sweep(recorded: list[Run], wanted: int, seed: int, every: int) -> tuple[int, Counter[str], int, list[str]]:
    """Distinct states, what was lost in how many, how many were opened, and what went wrong with these."""
    rng = random.Random(seed)
    seen: set[bytes] = set()
    lost: Counter[str] = Counter()
    opened, wrong = 0, []
    remaining = sum(len(run.trace.steps) for run in recorded)
    for run in track(recorded, console=Console(stderr=True), description="states"):
        for disk, judge in points(run):
            # Points at which everything is synced have few states; those at which a file is half written, any number.
            most = 12 * (wanted - len(seen)) // remaining
            remaining -= 1
            for state in explored(disk, rng, seen, f"{run.name} {len(judge.kept)}".encode(), max(most, 100)):
                found = judge.losses(state)
                lost.update(set(found))
                if len(seen) % every == 0:
                    opened += 1
                    wrong += [f"{run.name}: {each}" for each in reopened(state, run, judge.kept)]
    return len(seen), lost, opened, wrong


def left_out(recorded: list[Run]) -> dict[str, tuple[int, int, int, int]]:
    """By sync of the program: how often it was taken, how often leaving it out lost something, of how many states."""
    found: dict[str, list[int]] = {}
    for run in track(recorded, console=Console(stderr=True), description="syncs left out"):
        for number, step in enumerate(run.trace.steps):
            if step.kind in SYNCS and step.site:
                states, bad = without(run, number)
                sums = found.setdefault(label(step), [0, 0, 0, 0])
                for i, more in enumerate((1, bad > 0, states, bad)):
                    sums[i] += more
    return {name: (sums[0], sums[1], sums[2], sums[3]) for name, sums in found.items()}


def weaker(seed: int) -> dict[str, tuple[int, int]]:
    """States, and those that lose something, of stores whose SQLite syncs less."""
    found = {}
    for pragma in WEAKER:
        states = bad = 0
        for run in runs(seed=seed, kills=0, mixtures=0, pragma=pragma):
            for disk, judge in points(run):
                for state in disk.systematic():
                    states += 1
                    bad += bool(judge.losses(state))
        found[pragma] = states, bad
    return found


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--states", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--open-every", type=int, default=100, help="one of so many states is opened for real")
    parser.add_argument("--mixtures", type=int, default=12, help="how many runs of two writers")
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    began = time.monotonic()
    recorded = list(runs(seed=options.seed, kills=None, mixtures=options.mixtures))
    states, lost, opened, wrong = sweep(recorded, options.states, options.seed, options.open_every)
    rows = [
        ("scenarios", str(len(recorded))),
        ("points at which power was lost", str(sum(len(run.trace.steps) for run in recorded))),
        ("different states", str(states)),
        ("states in which something acknowledged was lost", ", ".join(f"{n} {of}" for of, n in lost.items()) or "0"),
        ("states opened, read, verified, added to", str(opened)),
        ("of these wrong", str(len(wrong))),
        ("time", f"{time.monotonic() - began:.0f} s"),
    ]
    show("Power lost", ("quantity", "value"), rows, markdown=options.markdown)
    for each in wrong[:20]:
        print(each)
    missed = left_out(recorded)
    show(
        "Each sync left out",
        ("sync", "left out", "missed", "states until then", "of these lost"),
        [(name, *map(str, values)) for name, values in sorted(missed.items())],
        markdown=options.markdown,
    )
    weak = weaker(options.seed)
    show(
        "SQLite that syncs less",
        ("setting", "states", "of these lost"),
        [(name, str(states), str(bad)) for name, (states, bad) in weak.items()],
        markdown=options.markdown,
    )
    needless = [name for name, values in missed.items() if not values[1]] + [name for name in weak if not weak[name][1]]
    return int(bool(lost or wrong or needless))


if __name__ == "__main__":
    sys.exit(main())
