"""How long it takes from nothing to a saved report, in a real browser and without hardware.

Run ``python -m benchmarks.first_report``. The console is started as users start it, with a store of its own; a browser
opens the printed address, starts the virtual probe, presses target and plain tissue at two forces, estimates, and saves
the report as PDF. Timed from the start of the program to the saved file; less than two minutes are wanted. ``--cold``
begins without the mechanics and light that earlier runs have solved and kept.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.harness import Bench, Goal
from tests.console.browser import chromium
from tests.console.first_report import first_report
from tests.console.operator import tab
from tests.console.running import running_console

MOST_S = 120.0  # from nothing to the saved report, where mechanics and light are kept


def timed(folder: Path) -> tuple[float, float, int]:
    """Seconds until the console listened and until the report was saved, and its size in bytes."""
    with chromium() as browser:
        begun = time.monotonic()
        with running_console(folder) as console:
            listening = time.monotonic() - begun
            with tab(browser, console) as page:
                saved = first_report(page, folder)
                return listening, time.monotonic() - begun, saved.stat().st_size


def main() -> int:
    """Print the table; the exit code is 1 where it takes longer than wanted."""
    bench = Bench(__doc__, times=3, cold=False)
    rows, took = [], []
    for number in range(bench.times):
        with tempfile.TemporaryDirectory(prefix="tsis-first-report-") as folder:
            if bench.cold:
                os.environ["TSIS_CACHE_DIR"] = str(Path(folder) / "cache")
            listening, whole, size = timed(Path(folder))
        most_s = math.inf if bench.cold else MOST_S
        took.append(Goal(name=f"run {number + 1}, report saved", value=whole, most=most_s, form="{:.1f} s"))
        rows.append((str(number + 1), f"{listening:.1f} s", took[-1].shown, took[-1].goal, f"{size / 1000:.0f} kB"))
    heading = f"From nothing to a saved report, {'cold' if bench.cold else 'mechanics kept'}"
    bench.table(heading, ("run", "console listens", "report saved", "wanted", "PDF"), rows)
    return bench.end(took)


if __name__ == "__main__":
    sys.exit(main())
