"""What a press does to probe and tissue: closed forms, finite elements, and a fast surrogate."""

from tsis.mechanics.bodies import Resolution
from tsis.mechanics.small_strain import press

__all__ = ["Resolution", "press"]
