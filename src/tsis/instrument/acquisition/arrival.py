"""A frame, and when it came."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.model.check import require_integer, require_number

if TYPE_CHECKING:
    from tsis.instrument.camera import Frame


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReceivedFrame:
    """A frame as it reached this computer.

    Parameters
    ----------
    frame
        The frame; its ``sequence`` counts from 0 anew in each connection.
    arrived_s
        When it came, seconds on this computer's monotonic clock, which force readings share.
    connection
        How often the camera had been connected anew before, from 0.
    """

    frame: Frame
    arrived_s: float
    connection: int = 0

    def __post_init__(self) -> None:
        require_number("arrived_s", self.arrived_s, -1e15, 1e15, hint="seconds")
        require_integer("connection", self.connection, 0, 2**31)
