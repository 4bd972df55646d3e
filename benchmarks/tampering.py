"""Tampering with stores of records behind the program's back: how much of it `tsis.records.store.verify_store` finds.

Run ``python -m benchmarks.tampering --trials 1000 --seed 1``. Every trial takes a copy of an honest store, changes one
thing in it with SQLite and files alone (`tests.records.tamperings` says which), and opens and verifies it. Honest
stores are verified as well: no fault may be told of them. The exit code is 1 where a tampering was missed, an honest
store was suspected, or anything but one sentence came back.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from benchmarks.tables import show
from rich.console import Console
from rich.progress import Progress
from tests.records.honest import HONEST
from tests.records.tampered import Judgement, judged, make_stores, tampered
from tests.records.tamperings import KINDS


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=260)
    parser.add_argument("--honest", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="tsis-tampering-") as name:
        bad = _tamper(Path(name), options.trials, options.seed, markdown=options.markdown)
        bad += _trust(Path(name), options.honest, options.seed, markdown=options.markdown)
    seconds = time.monotonic() - began
    print(f"{options.trials} tamperings, {options.honest} honest stores, seed {options.seed}, {seconds:.0f} s")
    for line in bad:
        print(line)
    return int(bool(bad))


def _tamper(folder: Path, trials: int, seed: int, *, markdown: bool) -> list[str]:
    template, names = make_stores(folder), list(KINDS)
    counts: dict[str, Counter[str]] = {name: Counter() for name in names}
    bad = []
    with Progress(console=Console(stderr=True)) as bar:
        for trial in bar.track(range(trials), description="tampering"):
            name = names[trial % len(names)]
            tampered(template, folder / "trial", KINDS[name], random.Random(f"{seed}-{trial}"))
            found = judged(folder / "trial")
            counts[name]["trials"] += 1
            counts[name]["told" if found.faults else "refused" if found.refusal else "missed"] += 1
            if not found.found or not _sentences(found):
                bad.append(f"trial {trial}, {name}: {found}")
    counts["all"] = sum(counts.values(), Counter())
    heads = ("trials", "told", "refused", "missed")
    rows = [[name, *(str(count[head]) for head in heads)] for name, count in counts.items()]
    titles = ["tampering", "trials", "told by verify", "refused", "missed"]
    show("Tampering with a store of records", titles, rows, markdown=markdown)
    return bad


def _trust(folder: Path, stores: int, seed: int, *, markdown: bool) -> list[str]:
    names, counts, bad = list(HONEST), Counter[str](), []
    suspected = Counter[str]()
    for at in range(stores):
        name = names[at % len(names)]
        place = folder / f"honest-{at}"
        HONEST[name](place, random.Random(f"{seed}-{at}"))
        found = judged(place)
        counts[name] += 1
        suspected[name] += int(found != Judgement())
        if found != Judgement():
            bad.append(f"honest store {at}, {name}: {found}")
    rows = [[name, str(counts[name]), str(suspected[name])] for name in names]
    rows.append(["all", str(stores), str(suspected.total())])
    show("Honest stores", ["history", "stores", "suspected"], rows, markdown=markdown)
    return bad


def _sentences(found: Judgement) -> bool:
    return all("\n" not in said and len(said) < 1000 for said in (*found.faults, found.refusal))


if __name__ == "__main__":
    sys.exit(main())
