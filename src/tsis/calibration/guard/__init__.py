"""The press guard: named flags on one frame or live."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.calibration.guard import limits as limits
    from tsis.calibration.guard import reading as reading
    from tsis.calibration.guard import watch as watch

if not TYPE_CHECKING:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(__name__, submodules=["limits", "reading", "watch"])
