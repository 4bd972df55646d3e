"""Checks of the frames before an estimate: contact, clipping, tilt, roundness and position of the inclusion."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.inclusion.checks import images as images
    from tsis.inclusion.checks import position as position
    from tsis.inclusion.checks import roundness as roundness
    from tsis.inclusion.checks import sectors as sectors
    from tsis.inclusion.checks import unevenness as unevenness

if not TYPE_CHECKING:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__, submodules=["images", "position", "roundness", "sectors", "unevenness"]
    )
