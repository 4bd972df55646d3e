"""Expected accuracy of a planned probe and protocol."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.inclusion.design import alternatives as alternatives
    from tsis.inclusion.design import information as information
    from tsis.inclusion.design import limits as limits
    from tsis.inclusion.design import protocol as protocol
    from tsis.inclusion.design import search as search

if not TYPE_CHECKING:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__, submodules=["alternatives", "information", "limits", "protocol", "search"]
    )
