"""How much thicker a stack must be before it guides anything."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tsis.optics.slab_layers import SlabLayers


def thickness_factor(layers: SlabLayers) -> float:
    """The least factor on all thicknesses at which the stack guides a mode, to six digits; at most 1 when it does.

    Between unequal surroundings a thin stack guides nothing: it is below cut-off. A layer must exceed the surroundings.
    """
    high = 1.0
    while not _guides(layers, high):
        high *= 2
    low = 0.0
    while high - low > 1e-6 * high:
        middle = (low + high) / 2
        low, high = (low, middle) if _guides(layers, middle) else (middle, high)
    return high


def _guides(layers: SlabLayers, factor: float) -> bool:
    thicker = replace(layers, thickness_um=factor * layers.thickness_um)
    return thicker.modes_above(layers.surroundings, 0.0) > 0
