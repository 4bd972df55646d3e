"""Waves in the pressed guide: beam propagation beside the frequency domain, in one run.

    python -m benchmarks.propagation [--preset dissertation] [--modes 12]

One thread. A point is one depth of the dent with all modes together. The march's time is the least of five, after the
modes of the flat guide are known, as in a sweep; finding them is timed once. The frequency domain is timed once.
"""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

from benchmarks.harness import Bench
from threadpoolctl import threadpool_limits

from tsis.optics.propagation import Dent, Propagation, propagate, thin_guide

if TYPE_CHECKING:
    from collections.abc import Callable

DEPTHS_UM = (0.0, 2.0, 4.0, 6.0)
HEADINGS = ("dent / µm", "method", "guided", "top", "bottom", "largest balance error", "time / s", "times as fast")


def timed(call: Callable[[], Propagation], repeats: int) -> tuple[Propagation, float]:
    """The answer, and the least wall time in s."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        found = call()
        times.append(time.perf_counter() - start)
    return found, min(times)


def main() -> int:
    """Measure and print."""
    bench = Bench(__doc__, preset="dissertation", modes=12)
    guide, rows, off = thin_guide(bench.preset), [], []
    with threadpool_limits(limits=1, user_api="blas"):
        _, first = timed(lambda: propagate(guide, modes=bench.modes), 1)
        for depth in DEPTHS_UM:
            dent = Dent(depth_um=depth)
            marched, quick = timed(lambda dent=dent: propagate(guide, dent, modes=bench.modes), 5)  # type: ignore[misc]
            solved, slow = timed(
                lambda dent=dent: propagate(guide, dent, method="fdfd", modes=bench.modes),  # type: ignore[misc]
                1,
            )
            rows += [row(marched, quick, slow), row(solved, slow, slow)]
            off.append(abs(marched.powers.guided.mean() - solved.powers.guided.mean()))
    below = (
        f"Guided power, bpm against fdfd: at most {max(off):.4f} apart. First march of a guide, its modes included:"
        f" {first:.2f} s."
    )
    bench.table("Waves under a dent", HEADINGS, rows)
    print(below)
    return bench.end()


def row(found: Propagation, seconds: float, referee: float) -> tuple[str, ...]:
    """One line of the table."""
    powers = found.powers
    shares = (f"{abs(share.mean()):.4f}" for share in (powers.guided, powers.top, powers.bottom))
    error = powers.balance_error[found.clear].max()
    return (
        f"{found.dent.depth_um:g}",
        found.method,
        *shares,
        f"{error:.1e}",
        f"{seconds:.3g}",
        f"{referee / seconds:.0f}",
    )


if __name__ == "__main__":
    sys.exit(main())
