"""A map of several lumps in three dimensions, from presses at many places."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.mapping import estimation as estimation
    from tsis.mapping import flags as flags
    from tsis.mapping import lump_map as lump_map
    from tsis.mapping import prior as prior
    from tsis.mapping import scan as scan
    from tsis.mapping import scan_folder as scan_folder
    from tsis.mapping.estimation import estimate_map as estimate_map
    from tsis.mapping.lump_map import LumpMap as LumpMap
    from tsis.mapping.prior import MapPrior as MapPrior
    from tsis.mapping.scan import Scan as Scan
    from tsis.mapping.scan import ScanPress as ScanPress

if not TYPE_CHECKING:  # modules and names load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=["estimation", "flags", "lump_map", "prior", "scan", "scan_folder", "stiffness"],
        submod_attrs={
            "estimation": ["estimate_map"],
            "lump_map": ["LumpMap"],
            "prior": ["MapPrior"],
            "scan": ["Scan", "ScanPress"],
        },
    )
