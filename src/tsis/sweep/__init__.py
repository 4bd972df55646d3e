"""Simulation sweeps: many presses as one data set."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.sweep import data_set as data_set
    from tsis.sweep import plan as plan
    from tsis.sweep import run as run
    from tsis.sweep import shards as shards
    from tsis.sweep import workers as workers
else:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(__name__, submodules=["data_set", "plan", "run", "shards", "workers"])
