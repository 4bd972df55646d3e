"""Simulation sweeps: many presses as one data set that survives whatever dies on the way."""

from tsis.sweep.plan import Plan
from tsis.sweep.plan_file import EXAMPLE, load_plan, parse_plan_text
from tsis.sweep.quantity import Range
from tsis.sweep.read import read_data_set, verify_data_set
from tsis.sweep.run import SweepSummary, run_sweep, seconds_per_press, worker_count

__all__ = [
    "EXAMPLE",
    "Plan",
    "Range",
    "SweepSummary",
    "load_plan",
    "parse_plan_text",
    "read_data_set",
    "run_sweep",
    "seconds_per_press",
    "verify_data_set",
    "worker_count",
]
