"""How times grow with the size of the work, and what a sweep of a million presses would cost on a cluster.

    python -m benchmarks.scaling [--only NAME] [--out FOLDER] [--json | --markdown]

Four curves, each over a size on logarithmic axes with the exponent that fits it: matching over points, a sweep over
workers, a surrogate over the width of its box, a store over its presses. With ``--out`` they are drawn as
``scaling.png``. The plan past one machine is computed from presses, overheads, memory and a scheduler measured here; no
cluster takes part.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.cluster_plan import cost_cells, overhead_cells, plan_cells
from benchmarks.curves.figure import draw
from benchmarks.curves.points import over_points
from benchmarks.curves.store import over_presses
from benchmarks.curves.surrogate import over_dimensions, over_width
from benchmarks.curves.workers import efficiency, over_workers
from benchmarks.hot.place import version
from benchmarks.machine import Machine
from benchmarks.sweep_costs import measured_costs
from benchmarks.tables import show
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from threadpoolctl import threadpool_limits

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.cluster_plan import ClusterPlan
    from benchmarks.curves.curve import Curve
    from benchmarks.curves.surrogate import Built

    Told = Callable[[str], None]

CURVES: dict[str, Callable[[Callable[[str], None]], Curve]] = {
    "points": over_points,
    "surrogate": over_width,
    "store": over_presses,
    "workers": over_workers,
}
PARTS = (*CURVES, "plan")
LIBRARIES = ("tsis", "numpy", "scipy", "numba", "pycpd", "sqlalchemy", "pyarrow", "distributed")


def print_curve(curve: Curve, *, markdown: bool) -> None:
    """One table a curve; of workers also how efficient they are."""
    heads, rows = curve.table()
    show(f"{curve.title}:", heads, rows, markdown=markdown)
    if curve.title == "Sweep":
        for line in curve.lines:
            shares = ", ".join(
                f"{size:g}: {share:.0%}" for size, share in zip(line.size, efficiency(line), strict=True)
            )
            print(f"efficiency of workers, {line.name}: {shares}\n")


def print_dimensions(found: list[tuple[str, Built]], *, markdown: bool) -> None:
    """What each quantity that varies adds to a surrogate."""
    heads = ("quantities that vary, and with them", "slabs", "presses", "building it, core-s", "error")
    rows = [
        [f"{number}, {name}", str(one.slabs), f"{one.presses:,}", f"{one.seconds:.2f}", f"{one.error:.3%}"]
        for number, (name, one) in enumerate(found, start=1)
    ]
    show("Surrogate of the default box, quantity by quantity:", heads, rows, markdown=markdown)


def print_plan(plan: ClusterPlan, *, markdown: bool) -> None:
    """What was measured, and the hours that follow."""
    heads = ("one core", "a press", "presses/s", "memory of a worker", "bytes a press")
    show("Presses:", heads, map(cost_cells, plan.costs), markdown=markdown)
    show("Beside them:", ("what", "measured"), overhead_cells(plan.overheads), markdown=markdown)
    hours = (
        *("press", "workers", "hours", "core-hours", "in presses", "batches/s", "MB/s to storage"),
        *("kB/s of network", "ruled by (most workers)"),
    )
    title = f"{plan.presses:,} presses, {plan.batch} a file:"
    show(title, hours, map(plan_cells, plan.rows()), markdown=markdown)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=PARTS, action="append", help="a part; repeat it for several")
    parser.add_argument("--out", type=Path, help="folder for the figure, scaling.png")
    parser.add_argument("--json", action="store_true", help="print everything as JSON")
    parser.add_argument("--markdown", action="store_true", help="print the tables as Markdown")
    options = parser.parse_args()
    parts, machine = options.only or PARTS, Machine.here({name: version(name) for name in LIBRARIES})
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with (
        threadpool_limits(limits=1, user_api="blas"),
        Progress(*columns, console=Console(stderr=True), transient=True) as shown,
    ):
        bar = shown.add_task("", total=None)

        def told(what: str) -> None:
            shown.update(bar, description=what)

        curves = [measure(told) for name, measure in CURVES.items() if name in parts]
        dimensions = over_dimensions(told) if "surrogate" in parts else []
        plan = measured_costs(told) if "plan" in parts else None
    machine = machine.afterwards()
    if options.out is not None and curves:
        options.out.mkdir(parents=True, exist_ok=True)
        draw(curves, options.out / "scaling.png")
    if options.json:
        print(json.dumps(_document(machine, curves, dimensions, plan), indent=1))
        return
    print(machine.sentence() + "\n")
    for curve in curves:
        print_curve(curve, markdown=options.markdown)
    if dimensions:
        print_dimensions(dimensions, markdown=options.markdown)
    if plan is not None:
        print_plan(plan, markdown=options.markdown)


def _document(
    machine: Machine, curves: list[Curve], dimensions: list[tuple[str, Built]], plan: ClusterPlan | None
) -> dict[str, Any]:
    return {
        "machine": machine.document(),
        "curves": [curve.document() for curve in curves],
        "dimensions": [
            {"quantity": name, "slabs": one.slabs, "presses": one.presses, "seconds": one.seconds, "error": one.error}
            for name, one in dimensions
        ],
        "plan": None if plan is None else plan.document(),
    }


if __name__ == "__main__":
    main()
