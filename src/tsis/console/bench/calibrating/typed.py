"""Loadings whose forces a person types, until they are kept: several steps may be under way, each with its presses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.model.check import require_integer
from tsis.model.errors import CalibrationError

if TYPE_CHECKING:
    from tsis.calibration.session import CalibrationFrame

MOST_TYPED = 100  # presses of one loading
MOST_TYPED_BYTES = 2**30  # of the frames of all loadings that were typed and not kept, which wait in memory


class TypedLoadings:
    """The presses of each loading, by the name of its step; changed by one thread at a time, read by any.

    Parameters
    ----------
    most_bytes
        Of all frames together.
    """

    def __init__(self, *, most_bytes: int = MOST_TYPED_BYTES) -> None:
        self._most_bytes = most_bytes
        self._shots: dict[str, list[CalibrationFrame]] = {}

    @property
    def is_empty(self) -> bool:
        """Whether nothing waits to be kept."""
        return not self._shots

    def shots(self, step: str) -> tuple[CalibrationFrame, ...]:
        """The presses of a step so far, in the order in which they were taken."""
        return tuple(self._shots.get(step, ()))

    def forces_n(self, step: str) -> tuple[float, ...]:
        """Their forces, newtons."""
        return tuple(shot.force_n or 0.0 for shot in self.shots(step))

    def require_room(self, step: str) -> None:
        """Refuse, with `InputError`, a press more than a loading may have."""
        require_integer("presses of a loading", len(self.shots(step)) + 1, 1, MOST_TYPED, hint="keep what there is")

    def add(self, step: str, shot: CalibrationFrame) -> int:
        """Add a press, and say how many there are.

        Raises
        ------
        InputError
            When the loading has too many.
        CalibrationError
            When the frames would take too much memory.
        """
        self.require_room(step)
        held = sum(each.image.grey.nbytes for shots in self._shots.values() for each in shots)
        if held + shot.image.grey.nbytes > self._most_bytes:
            raise CalibrationError(
                f"presses that are not kept yet may take at most {self._most_bytes / 2**20:.0f} MiB; this one would "
                "take more (keep the loadings that are complete)"
            )
        self._shots.setdefault(step, []).append(shot)
        return len(self._shots[step])

    def forget_last(self, step: str) -> None:
        """Forget the last press of a step; without one nothing happens."""
        shots = self._shots.get(step, [])
        if shots:
            shots.pop()
        if not shots:
            self.forget(step)

    def forget(self, step: str) -> None:
        """Forget a step's presses."""
        self._shots.pop(step, None)
