"""A press that keeps a processor busy for 10 ms and says when: what a sweep adds lies between two of them."""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from tsis.model.press import PressField

if TYPE_CHECKING:
    from tsis.model.phantom import Phantom
    from tsis.model.probe import Probe

PRESS_S = 0.01
RADIUS_MM = np.linspace(0.0, 12.0, 241)


def busy(_probe: Probe, _phantom: Phantom, /, *, force_n: float, strain: str) -> PressField:
    """Keep a processor busy for 10 ms; the travel is the time of the beginning, the pressure that of the end, s."""
    began = perf_counter()
    until = began + (PRESS_S if force_n > 1e-3 else 0.0)
    while perf_counter() < until:
        pass
    return PressField(
        radius_mm=RADIUS_MM,
        face_displacement_mm=RADIUS_MM,
        pressure_kpa=np.full(len(RADIUS_MM), perf_counter()),
        approach_mm=began,
        force_n=force_n,
    )
