"""Rays from the lamps through the probe: a fast tracer, and a readable reference."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.optics.rays import geometry as geometry
    from tsis.optics.rays import kernel as kernel
    from tsis.optics.rays import reference as reference
    from tsis.optics.rays import tracing as tracing

if not TYPE_CHECKING:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(__name__, submodules=["geometry", "kernel", "reference", "tracing"])
