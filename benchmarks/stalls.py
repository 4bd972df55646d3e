"""Where do presses at finite strain end, and why? A grid of tissue moduli and forces on uniform tissue.

python -m benchmarks.stalls

A press that fails must name its cause: tissue that wraps around the rim, strains beyond the model, a contact smaller
than the mesh. One without a cause is a stall of Newton's method, and makes the exit code 1.
"""

from __future__ import annotations

import sys

from benchmarks.harness import Bench, Goal

import tsis
from tsis.errors import MechanicsError
from tsis.mechanics.finite_strain.neo_hookean_press import PressSeries

MODULI_KPA = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
FORCES_N = (0.1, 0.2, 0.5, 1.0, 2.0)
CAUSES = {
    "wraps": "wraps around the probe's rim",
    "strain": "the limit of this model",
    "contact": "contact is smaller",
    "collapse": "compressed to",
    "unresolved": "pressure is not resolved",
}


def outcome(series: PressSeries, young_kpa: float, force_n: float) -> str:
    """Travel in mm, or the name of the cause of a failure, or ``stall``."""
    tissue = tsis.Phantom(young_kpa=young_kpa, poisson=0.49, thickness_mm=30.0)
    try:
        return f"{series.press(tissue, force_n=force_n).approach_mm:.2f} mm"
    except MechanicsError as error:
        return next((name for name, words in CAUSES.items() if words in str(error)), "stall")


def main() -> int:
    """Print a table for each probe; the exit code is 1 when a press fails without a cause."""
    bench, stalls = Bench(__doc__), 0
    for name in ("tsis-2011", "tsis-domed"):
        series, rows = PressSeries(tsis.load_probe(name)), []
        for young in MODULI_KPA:
            rows.append([f"{young:g} kPa", *(outcome(series, young, force) for force in FORCES_N)])
            print(name, *rows[-1], file=sys.stderr, flush=True)
        stalls += sum(row.count("stall") for row in rows)
        bench.table(f"{name}, 30 mm of tissue", ["tissue", *(f"{force:g} N" for force in FORCES_N)], rows)
    return bench.end([Goal(name="presses that end without a cause", value=stalls, most=0, form="{:.0f}")])


if __name__ == "__main__":
    sys.exit(main())
