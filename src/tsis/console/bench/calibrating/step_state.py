"""How far a step of a calibration is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tsis.calibration.session import CalibrationStep

OPEN, UNDER_WAY, DONE, LEFT_OUT = "open", "under way", "done", "left out"


@dataclass(frozen=True, slots=True, kw_only=True)
class StepState:
    """A step as people see it.

    Attributes
    ----------
    step
        What is done.
    status
        ``"open"``, ``"under way"``, ``"done"`` or ``"left out"``.
    frames
        How many are kept.
    forces_n
        Forces that were typed so far in a loading which is not done, newtons.
    """

    step: CalibrationStep
    status: str
    frames: int = 0
    forces_n: tuple[float, ...] = ()
