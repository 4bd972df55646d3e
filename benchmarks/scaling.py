"""How times grow with the size of the work, and what a sweep of a million presses would cost on a cluster.

    python -m benchmarks.scaling [--only NAME] [--out FOLDER] [--json |

Four curves, each over a size on logarithmic axes with the exponent that fits it: matching over points, a sweep over
workers, a surrogate over the width of its box, a store over its presses. With ``--out`` they are drawn as
``scaling.png``. The plan past one machine is computed from presses, overheads, memory and a scheduler measured here; no
cluster takes part.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from benchmarks.cluster_plan import cost_cells, overhead_cells, plan_cells
from benchmarks.curves.figure import draw
from benchmarks.curves.points import over_points
from benchmarks.curves.store import over_presses
from benchmarks.curves.surrogate import over_dimensions, over_width
from benchmarks.curves.workers import efficiency, over_workers
from benchmarks.harness import Bench, Several
from benchmarks.sweep_costs import measured_costs
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


def print_curve(bench: Bench, curve: Curve) -> None:
    """One table a curve; of workers also how efficient they are."""
    heads, rows = curve.table()
    bench.table(f"{curve.title}:", heads, rows)
    if curve.title == "Sweep":
        for line in curve.lines:
            shares = ", ".join(
                f"{size:g}: {share:.0%}" for size, share in zip(line.size, efficiency(line), strict=True)
            )
            print(f"efficiency of workers, {line.name}: {shares}\n")


def print_dimensions(bench: Bench, found: list[tuple[str, Built]]) -> None:
    """What each quantity that varies adds to a surrogate."""
    heads = ("quantities that vary, and with them", "slabs", "presses", "building it, core-s", "error")
    rows = [
        [f"{number}, {name}", str(one.slabs), f"{one.presses:,}", f"{one.seconds:.2f}", f"{one.error:.3%}"]
        for number, (name, one) in enumerate(found, start=1)
    ]
    bench.table("Surrogate of the default box, quantity by quantity:", heads, rows)


def print_plan(bench: Bench, plan: ClusterPlan) -> None:
    """What was measured, and the hours that follow."""
    heads = ("one core", "a press", "presses/s", "memory of a worker", "bytes a press")
    bench.table("Presses:", heads, map(cost_cells, plan.costs))
    bench.table("Beside them:", ("what", "measured"), overhead_cells(plan.overheads))
    hours = (
        *("press", "workers", "hours", "core-hours", "in presses", "batches/s", "MB/s to storage"),
        *("kB/s of network", "ruled by (most workers)"),
    )
    title = f"{plan.presses:,} presses, {plan.batch} a file:"
    bench.table(title, hours, map(plan_cells, plan.rows()))


def main() -> int:
    """Measure and print."""
    bench = Bench(__doc__, only=Several(PARTS))
    parts = bench.only or PARTS
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
    if bench.options.out is not None and curves:
        bench.options.out.mkdir(parents=True, exist_ok=True)
        draw(curves, bench.options.out / "scaling.png")
    for curve in curves:
        print_curve(bench, curve)
    if dimensions:
        print_dimensions(bench, dimensions)
    if plan is not None:
        print_plan(bench, plan)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
