"""The calibration in force as a page shows it: asked for anew only when it is another one."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tsis.calibration.cited import UsableCalibration
    from tsis.console.bench import Bench, BenchState


class CalibrationSeen:
    """Remembers the calibration of the last state, because the bench judges it by the camera whenever it is asked.

    Parameters
    ----------
    bench
        Where it is in force.
    """

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._known: UsableCalibration | None = None

    def of(self, state: BenchState) -> UsableCalibration | None:
        """The calibration that the state names; None without one, and when another came in force since."""
        if self._known is None or self._known.identity != state.calibration_identity:
            self._known = self._bench.calibration if state.calibration_identity else None
        known = self._known
        return known if known is not None and known.identity == state.calibration_identity else None
