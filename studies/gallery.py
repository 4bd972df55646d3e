"""Make every figure and table of the source anew, and set them beside the printed ones.

    python -m studies.gallery                    # all: checks the kept values, draws the pictures anew
    python -m studies.gallery --only figure-3-9  # some
    python -m studies.gallery --only figure-3-9 --write  # and keep what was found as our value

Ends with 1 when a fresh run does not find what the values files say. The page that shows them is `docs/figures.md`.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from studies.catalogue import SHOWN
from studies.shown import read_values, write_ours

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.cli import progress_bar

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from studies.shown import Shown

PICTURES = Path(__file__).parents[1] / "docs" / "images" / "figures"
SIZE = (8.0, 4.0)  # inches
SEED = 1


def make(
    chosen: Sequence[Shown], *, write: bool = False, progress: Callable[[int, int], None] | None = None
) -> list[str]:
    """Run studies, draw, and return sentences about what differs from the kept values.

    Parameters
    ----------
    chosen
        What to make.
    write
        Whether to keep what was found as our values.
    progress
        Called with (done, total) figures and tables.
    """
    results: dict[Any, Any] = {}
    differing = []
    for done, shown in enumerate(chosen):
        if progress is not None:
            progress(done, len(chosen))
        if shown.run not in results:
            results[shown.run] = shown.run(np.random.default_rng(SEED))
        fresh = shown.values(results[shown.run])
        if write:
            write_ours(shown.name, fresh)
        kept = read_values(shown.name)
        differing += kept.differing(fresh)
        differing += [
            f"{shown.name}: {each.quantity} was not found" for each in kept.values if each.quantity not in fresh
        ]
        draw(shown, results[shown.run])
    if progress is not None:
        progress(len(chosen), len(chosen))
    return differing


def draw(shown: Shown, result: Any) -> None:
    """Write the picture of a figure."""
    if shown.draw is None:
        return
    from matplotlib.figure import Figure

    figure = Figure(figsize=SIZE, layout="constrained")
    shown.draw(result, figure)
    figure.supxlabel("Research use only", fontsize=8)
    PICTURES.mkdir(parents=True, exist_ok=True)
    figure.savefig(PICTURES / f"{shown.name}.png", metadata={"Software": None})


def main() -> int:
    """Make what was asked for; 1 when something differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", choices=[shown.name for shown in SHOWN], help="name; repeatable")
    parser.add_argument("--write", action="store_true", help="keep what is found as our values")
    options = parser.parse_args()
    asked = [shown for shown in SHOWN if options.only is None or shown.name in options.only]
    chosen = [shown for shown in asked if not shown.absent()]
    with progress_bar("figures and tables") as progress:
        differing = make(chosen, write=options.write, progress=progress)
    for sentence in (*differing, *(f"Left out: {shown.absent()}." for shown in asked if shown.absent())):
        print(sentence)
    print(f"{len(chosen)} figures and tables made, {len(differing)} values differ. {RESEARCH_USE_ONLY}")
    return int(bool(differing))


if __name__ == "__main__":
    sys.exit(main())
