"""Does the time of a refused login tell whether the name is known?

    python -m benchmarks.login_timing [--tries 200] [--seed 1]

Wrong passwords for a known and for unknown names in random order, in processor time of one thread. Printed are both
medians and the probability that a try with a known name takes longer than one with an unknown name, with its 95 %
interval. The exit code is 1 where that interval does not hold one half, or the medians differ by more than 2 %.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from benchmarks.tables import show

from tsis.console.auth import Logins
from tsis.study.roc import Roc

LARGEST_DIFFERENCE = 0.02


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tries", type=int, default=200, help="of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    known = np.random.default_rng(options.seed).permutation(np.repeat([True, False], options.tries))
    seconds = []
    with tempfile.TemporaryDirectory() as folder:
        logins = Logins(Path(folder))
        logins.add("anna", "the right password")
        for number, each in enumerate(known):
            name = "anna" if each else f"nobody{number}"
            began = time.process_time()
            assert logins.check(name, f"wrong password {number}") is None
            seconds.append(time.process_time() - began)
    times = np.array(seconds)
    medians = 1e3 * np.array([np.median(times[known]), np.median(times[~known])])
    curve = Roc.of(times, known)
    low, high = curve.auc_interval()
    row = (f"{options.tries}", *(f"{each:.2f} ms" for each in medians), f"{curve.auc:.3f}", f"{low:.3f} to {high:.3f}")
    heads = ("tries of each", "known name", "unknown names", "known takes longer", "95 % interval")
    show("Processor time of a refused login", heads, [row], markdown=options.markdown)
    return int(not low <= 0.5 <= high or abs(medians[0] / medians[1] - 1) > LARGEST_DIFFERENCE)


if __name__ == "__main__":
    sys.exit(main())
