"""How far the numbers of a figure or table scatter over seeds: what `repeats_within` of its values file must cover.

    python -m studies.seeds --only figure-6-5 --seeds 4

Prints the value of the gallery's seed, the ends over all seeds, and the greatest distance from the first; and the
value of the short run that tests make, where there is one.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

import numpy as np
from studies.catalogue import SHOWN
from studies.gallery import SEED

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.cli import progress_bar

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from studies.shown import Shown


def scatter(
    chosen: Sequence[Shown], seeds: int, *, progress: Callable[[int, int], None] | None = None
) -> dict[str, dict[str, list[float]]]:
    """By name and quantity: the values of each seed, and last that of the short run; NaN where it finds none."""
    turns = [(False, SEED + number) for number in range(seeds)] + [(True, SEED)]
    results: dict[Any, Any] = {}
    found: dict[str, dict[str, list[float]]] = {shown.name: {} for shown in chosen}
    for turn, (is_short, seed) in enumerate(turns):
        for done, shown in enumerate(chosen):
            if progress is not None:
                progress(turn * len(chosen) + done, len(turns) * len(chosen))
            study = (shown.short or shown.run) if is_short else shown.run
            if (study, seed) not in results:
                results[study, seed] = study(np.random.default_rng(seed))
            for quantity, value in shown.values(results[study, seed]).items():
                row = found[shown.name].setdefault(quantity, [float("nan")] * len(turns))
                row[turn] = value
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", required=True, choices=[shown.name for shown in SHOWN])
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    chosen = [shown for shown in SHOWN if shown.name in options.only]
    with progress_bar("seeds") as progress:
        found = scatter(chosen, options.seeds, progress=progress)
    for name, table in found.items():
        print(f"{name:<64} {'first':>10} {'least':>10} {'greatest':>10} {'farthest':>10} {'short':>10}")
        for quantity, row in table.items():
            values = np.array(row[:-1])
            far = float(np.nanmax(np.abs(values - values[0])))
            cells = (values[0], np.nanmin(values), np.nanmax(values), far, row[-1])
            print(f"  {quantity:<62} " + " ".join(f"{cell:10.4g}" for cell in cells))
    print(RESEARCH_USE_ONLY)


if __name__ == "__main__":
    main()
