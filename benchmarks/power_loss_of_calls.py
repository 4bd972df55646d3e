"""Power lost between any two calls of the system that a program and its SQLite made, as strace told them.

Run ``python -m benchmarks.power_loss_of_calls --states 1000``. Each state is put on a real disk, opened, verified,
compared with what was acknowledged, and added to. Then all syncs of a kind are left out, which must lose something;
files that are synced a second time, and the journal from before there is anything to lose, are left aside. The exit
code is 1 where something was lost, or syncs that were left out were not missed.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from benchmarks.tables import show
from tests.records.system_calls import PLACE, PROGRAM, losses, syncs, traced


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--states", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="tsis-calls-") as folder:
        calls, root = traced(Path(folder), PROGRAM)
    opened, found = losses(calls, root, PLACE, seed=options.seed, states=options.states)
    rows = [("none", "0", str(opened), str(len(found)))]
    kinds = syncs(calls, root)
    missed = True
    for kind in ("log", "database", "draft", "folder"):
        numbers = kinds[kind]
        some, lost = losses(calls, root, PLACE, seed=options.seed, states=options.states // 5, skipped=numbers)
        rows.append((kind, str(len(numbers)), str(some), str(len(lost))))
        missed &= bool(lost)
    show("Calls of the system", ("left out", "syncs", "states", "losses"), rows, markdown=options.markdown)
    for each in found[:20]:
        print(each)
    return int(bool(found) or not missed)


if __name__ == "__main__":
    sys.exit(main())
