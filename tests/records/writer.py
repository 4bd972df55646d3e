"""A program that writes into a store and says what was acknowledged.

Run ``python -m tests.records.writer FOLDER URL SEED PRESSES``; the URL may be ``-`` for SQLite. For each press a line
with its identity is written when `add_press` has returned; it ends with the sentence of a `RecordsError` where one
arises.
"""

from __future__ import annotations

import sys
from datetime import UTC, datetime

import numpy as np

from tsis.errors import RecordsError
from tsis.model.image import TactileImage
from tsis.records.store import open_store


def say(what: str, of: object) -> None:
    sys.stdout.write(f"{what} {of}\n")
    sys.stdout.flush()


def main() -> int:
    folder, url, seed, presses = sys.argv[1:]
    rng = np.random.default_rng(int(seed))
    try:
        with open_store(folder, database=None if url == "-" else url, actor=f"writer {seed}") as store:
            target = store.add_target(name=f"of writer {seed}")
            say("number", target.number)
            for _ in range(int(presses)):
                image = TactileImage(grey=rng.integers(0, 256, (6, 8)).astype(float), full_scale=255.0)
                say("press", store.add_press(target, image, taken=datetime.now(UTC)).id)
    except RecordsError as error:
        say("refused", error)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
