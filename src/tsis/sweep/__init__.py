"""Simulation sweeps: many presses as one data set that survives whatever dies on the way."""

from tsis.sweep.plan import Plan
from tsis.sweep.plan_file import EXAMPLE, load_plan, parse_plan
from tsis.sweep.quantity import Range
from tsis.sweep.read import read, verify
from tsis.sweep.run import Summary, run_sweep, seconds_per_press, worker_count

__all__ = [
    "EXAMPLE",
    "Plan",
    "Range",
    "Summary",
    "load_plan",
    "parse_plan",
    "read",
    "run_sweep",
    "seconds_per_press",
    "verify",
    "worker_count",
]
