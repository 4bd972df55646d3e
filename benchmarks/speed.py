"""One table of the hot paths, each beside its peers in the same run, in turns.

    python -m benchmarks.speed [--only NAME] [--turns 5] [--peer-python PATH] [--folder FOLDER]

Linear algebra and OpenCV on one thread; rays on all cores. A ratio is the peer's time over ours: median of the turns,
and its range. Below 1 the peer is faster. A peer that is not installed is a row that says so:
``pip install pycpd probreg mitsuba PyMoosh scikit-fem galsim`` brings most of them, the extra fem3d NGSolve,
``apt-get install calculix-ccx`` CalculiX. The live view is measured by ``benchmarks.live_view``.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import cv2
from benchmarks.harness import Bench, Place, Several, duration, in_turns
from benchmarks.hot import answers, images, light, mechanics
from rich.console import Console
from rich.progress import Progress
from threadpoolctl import threadpool_limits

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from benchmarks.harness import Contest, Row


PATHS: dict[str, Callable[[Place], Iterator[Contest]]] = {
    "modes": light.modes,
    "waves": light.waves,
    "rays": light.rays,
    "press": mechanics.presses,
    "plain": mechanics.plain_tissue,
    "elements": mechanics.elements,
    "surrogate": mechanics.surrogate,
    "frame": images.frames,
    "reading": images.reading,
    "matching": answers.matching,
    "estimate": answers.estimate,
    "storing": answers.storing,
    "report": answers.report,
    "area": answers.area,
}
HEADS = ("path", "tsis", "peer", "its time", "peer over tsis", "answers")


def measured(
    paths: Mapping[str, Callable[[Place], Iterator[Contest]]],
    place: Place,
    *,
    turns: int,
    progress: Callable[[int, str], None],
) -> Iterator[Row]:
    """Every path's rows; ``progress`` hears how many paths are done, and what is next."""
    for done, (name, build) in enumerate(paths.items()):
        progress(done, name)
        for contest in build(place):
            progress(done, contest.task)
            yield from in_turns(contest, turns)


def cells(row: Row) -> tuple[str, ...]:
    """A row as text."""
    own, note = duration(median(row.own_s)), row.note
    if row.ratio is None:
        return row.task, own, row.peer, "-", "-", note
    shown = f"{_short(row.ratio)} ({_short(min(row.ratios))} to {_short(max(row.ratios))})"
    faster = ", **the peer is faster**" if row.ratio < 1 else ""
    return row.task, own, row.peer, duration(median(row.peer_s)), shown + faster, note


def _short(ratio: float) -> str:
    return f"{ratio:,.0f}" if ratio >= 100 else f"{ratio:.3g}"


def main() -> int:
    """Measure and print."""
    bench = Bench(__doc__, only=Several(PATHS), turns=5, peer_python=sys.executable, folder=Path)
    chosen = {name: PATHS[name] for name in bench.only or PATHS}
    cv2.setNumThreads(1)
    with (
        tempfile.TemporaryDirectory(prefix="tsis-speed-", dir=bench.folder) as folder,
        threadpool_limits(limits=1, user_api="blas"),
        Progress(console=Console(stderr=True), transient=True) as shown,
    ):
        place, bar = Place(folder=Path(folder), peer_python=bench.peer_python), shown.add_task("", total=len(chosen))

        def progress(done: int, what: str) -> None:
            shown.update(bar, completed=done, description=what)

        rows = list(measured(chosen, place, turns=bench.turns, progress=progress))
    bench.table(f"Medians of {bench.turns} turns, with the range of the ratio in brackets", HEADS, map(cells, rows))
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
