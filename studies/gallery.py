"""Make every figure and table of the source anew, and set them beside the printed ones.

    python -m studies.gallery                    # all: checks the kept values, draws the pictures anew
    python -m studies.gallery --only figure-3-9  # some
    python -m studies.gallery --only figure-3-9 --write  # and keep what was found as our value
    python -m studies.gallery --only figure-6-5 --seeds 4  # how far the numbers scatter, which `repeats_within` covers

Ends with 1 when a fresh run does not find what the values files say. The page that shows them is `docs/figures.md`.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from studies.shown import VALUES, read_values, write_ours

from studies import (
    figure_4_7,
    figure_5_21,
    figure_6_23,
    figures_3_4_to_3_6,
    figures_3_9_and_3_10,
    figures_5_14_to_5_18,
    figures_5_19_and_5_20,
    figures_6_4_to_6_15,
    figures_6_18_to_6_22,
    force_line,
    hardness_printed,
    section_6_4,
    table_4_1,
    table_6_2,
)
from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.cli.progress import progress_bar

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from studies.shown import Beside, Shown, Value

# Every figure and table of the source that shows a result, in its order.
SHOWN: tuple[Shown, ...] = (
    *section_6_4.SHOWN,
    *figures_3_4_to_3_6.SHOWN,
    *figures_3_9_and_3_10.SHOWN,
    *figure_4_7.SHOWN,
    *table_4_1.SHOWN,
    *force_line.SHOWN,
    *figures_5_14_to_5_18.SHOWN,
    *figures_5_19_and_5_20.SHOWN,
    *figure_5_21.SHOWN,
    *hardness_printed.SHOWN,
    *figures_6_4_to_6_15.SHOWN,
    *figures_6_18_to_6_22.SHOWN,
    *table_6_2.SHOWN,
    *figure_6_23.SHOWN,
)

IN_DOCS = "images/figures"
PICTURES = Path(__file__).parents[1] / "docs" / IN_DOCS
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


HEADINGS = "| | printed | here | |\n| --- | --- | --- | --- |"


def page(root: Path) -> str:
    """All of it, in Markdown.

    Parameters
    ----------
    root
        Of the repository, in which pictures are looked for.
    """
    return "\n\n".join(_part(read_values(shown.name), root) for shown in SHOWN) + "\n"


def sources() -> list[Path]:
    """Files that the page is made of."""
    return sorted(VALUES.glob("*.json"))


def _part(one: Beside, root: Path) -> str:
    parts = [f"## {one.title}", f"*Section {one.section}.* The source: {one.says}", f"Here: {one.found}"]
    if (root / "docs" / IN_DOCS / f"{one.name}.png").exists():
        parts.append(f"```{{image}} {IN_DOCS}/{one.name}.png\n:alt: {one.title}, made here\n```")
    parts.append("\n".join([HEADINGS, *(_row(value) for value in one.values)]))
    return "\n\n".join(parts)


def _row(value: Value) -> str:
    printed = "" if value.printed is None else _number(value.printed, value.unit)
    within = f" ± {value.repeats_within:.2g}" if value.repeats_within else ""
    said = value.reason if value.tolerance is None else f"within {_number(value.tolerance, value.unit)}"
    return f"| {value.quantity} | {printed} | {_number(value.ours, value.unit)}{within} | {said} |"


def _number(number: float, unit: str) -> str:
    return f"{number:.4g} {unit}".rstrip()


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


def print_scatter(found: dict[str, dict[str, list[float]]]) -> None:
    """Print the value of the gallery's seed, the ends over all seeds, the farthest from the first, the short run's."""
    for name, table in found.items():
        print(f"{name:<64} {'first':>10} {'least':>10} {'greatest':>10} {'farthest':>10} {'short':>10}")
        for quantity, row in table.items():
            values = np.array(row[:-1])
            far = float(np.nanmax(np.abs(values - values[0])))
            cells = (values[0], np.nanmin(values), np.nanmax(values), far, row[-1])
            print(f"  {quantity:<62} " + " ".join(f"{cell:10.4g}" for cell in cells))
    print(RESEARCH_USE_ONLY)


def main() -> int:
    """Make what was asked for; 1 when something differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", choices=[shown.name for shown in SHOWN], help="name; repeatable")
    parser.add_argument("--write", action="store_true", help="keep what is found as our values")
    parser.add_argument("--seeds", type=int, default=0, help="print how far the numbers scatter over so many seeds")
    options = parser.parse_args()
    asked = [shown for shown in SHOWN if options.only is None or shown.name in options.only]
    chosen = [shown for shown in asked if not shown.absent()]
    if options.seeds:
        with progress_bar("seeds") as progress:
            print_scatter(scatter(chosen, options.seeds, progress=progress))
        return 0
    with progress_bar("figures and tables") as progress:
        differing = make(chosen, write=options.write, progress=progress)
    for sentence in (*differing, *(f"Left out: {shown.absent()}." for shown in asked if shown.absent())):
        print(sentence)
    print(f"{len(chosen)} figures and tables made, {len(differing)} values differ. {RESEARCH_USE_ONLY}")
    return int(bool(differing))


if __name__ == "__main__":
    sys.exit(main())
