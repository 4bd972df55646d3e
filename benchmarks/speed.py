"""One table of the hot paths, each beside its peers in the same run, in turns.

    python -m benchmarks.speed [--only NAME] [--turns 5] [--json | --markdown] [--peer-python PATH] [--folder FOLDER]

Linear algebra and OpenCV on one thread; rays on all cores. A ratio is the peer's time over ours: median of the turns,
and its range. Below 1 the peer is faster. A peer that is not installed is a row that says so:
``pip install pycpd probreg mitsuba PyMoosh scikit-fem galsim`` brings most of them, the extra fem3d NGSolve,
``apt-get install calculix-ccx`` CalculiX. The live view is measured by ``benchmarks.live_view``.
"""

from __future__ import annotations

import argparse
import json
import sqlite3
import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import cv2
from benchmarks.hot import answers, images, light, mechanics
from benchmarks.hot.place import Place, version
from benchmarks.machine import Machine
from benchmarks.mechanics import duration
from benchmarks.tables import show
from benchmarks.turns import in_turns
from rich.console import Console
from rich.progress import Progress
from threadpoolctl import threadpool_limits

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from benchmarks.turns import Contest, Row

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
    "area": answers.area,
}
LIBRARIES = (
    *("tsis", "numpy", "scipy", "numba", "opencv-python-headless", "pillow", "scikit-learn", "sqlalchemy"),
    *("ngsolve", "scikit-fem", "PyMoosh", "tidy3d", "mitsuba", "galsim", "pycpd", "probreg"),
)
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


def document(rows: Sequence[Row], machine: Machine) -> dict[str, Any]:
    """Everything that was measured, every turn of it."""
    listed = [
        {
            "task": row.task,
            "tsis_s": row.own_s,
            "peer": row.peer,
            "peer_s": row.peer_s,
            "ratio": row.ratio,
            "note": row.note,
        }
        for row in rows
    ]
    return {"machine": machine.document(), "rows": listed}


def _short(ratio: float) -> str:
    return f"{ratio:,.0f}" if ratio >= 100 else f"{ratio:.3g}"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=PATHS, action="append", help="a path; repeat it for several")
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--json", action="store_true", help="print every time as JSON")
    parser.add_argument("--markdown", action="store_true", help="print the table as Markdown")
    parser.add_argument("--peer-python", default=sys.executable, help="Python of the environment of PyMoosh and tidy3d")
    parser.add_argument("--folder", type=Path, help="on which disk; by default that of temporary files")
    options = parser.parse_args()
    chosen = {name: PATHS[name] for name in options.only or PATHS}
    cv2.setNumThreads(1)
    machine = Machine.here({name: version(name) for name in LIBRARIES} | {"SQLite": sqlite3.sqlite_version})
    with (
        tempfile.TemporaryDirectory(prefix="tsis-speed-", dir=options.folder) as folder,
        threadpool_limits(limits=1, user_api="blas"),
        Progress(console=Console(stderr=True), transient=True) as shown,
    ):
        place, bar = Place(folder=Path(folder), peer_python=options.peer_python), shown.add_task("", total=len(chosen))

        def progress(done: int, what: str) -> None:
            shown.update(bar, completed=done, description=what)

        rows = list(measured(chosen, place, turns=options.turns, progress=progress))
    machine = machine.afterwards()
    if options.json:
        print(json.dumps(document(rows, machine), indent=1))
        return
    title = f"{machine.sentence()} Medians of {options.turns} turns, with the range of the ratio in brackets."
    show(title, HEADS, map(cells, rows), markdown=options.markdown)


if __name__ == "__main__":
    main()
