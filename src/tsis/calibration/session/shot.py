"""A frame of a calibration, with what the force gauge read."""

from __future__ import annotations

from dataclasses import dataclass

from tsis.model import TactileImage
from tsis.model.check import require_number, require_type


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CalibrationFrame:
    """One frame.

    Parameters
    ----------
    image
        As the camera delivered it.
    force_n
        What the gauge read then, newtons; None where no force belongs to the step.
    time_s
        When it came, seconds on the camera's or the computer's clock; None when nobody knows.
    """

    image: TactileImage
    force_n: float | None = None
    time_s: float | None = None

    def __post_init__(self) -> None:
        require_type("image", self.image, TactileImage)
        if self.force_n is not None:
            require_number("force_n", self.force_n, -100.0, 100.0, hint="newtons")
        if self.time_s is not None:
            require_number("time_s", self.time_s, -1e15, 1e15, hint="seconds")
