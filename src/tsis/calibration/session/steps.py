"""What is done in a calibration, in order, in words for the person at the bench."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.calibration.force.loading import LARGEST_N, STEP_N, TIPS_MM
from tsis.model.check import require_integer, require_number

if TYPE_CHECKING:
    from collections.abc import Sequence

DARK, UNTOUCHED, FLAT, BOARD_UNTOUCHED, BOARD, EDGE = "dark", "untouched", "flat", "board-untouched", "board", "edge"
STILL_FRAMES, FLAT_FRAMES, BOARD_FRAMES, EDGE_FRAMES = 16, 8, 4, 4
FLAT_LEVELS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationStep:
    """One thing to do.

    Parameters
    ----------
    name
        Folder that its frames are kept in.
    instruction
        What the person does.
    frames
        How many frames to take; 0 for a loading, which takes frames until it is over.
    optional
        Whether a calibration can be made without it.
    tip_mm
        Radius of the tip of a loading, mm.
    run
        Number of the loading among those of its tip, from 1.
    """

    name: str
    instruction: str
    frames: int = 0
    optional: bool = False
    tip_mm: float | None = None
    run: int = 1

    @property
    def is_loading(self) -> bool:
        """Whether forces belong to its frames."""
        return self.tip_mm is not None


def plan_steps(tips_mm: Sequence[float] = TIPS_MM, *, repeats: int = 1) -> tuple[CalibrationStep, ...]:
    """The steps of a whole calibration.

    Parameters
    ----------
    tips_mm
        Radii of the tips of the loading machine, each in [0.1, 1000] mm.
    repeats
        Loadings of each tip, in [1, 20].

    Raises
    ------
    InputError
        When a radius or the number of loadings lies outside its range.

    Examples
    --------
    >>> [step.name for step in plan_steps((2.0, 10.0))]
    ['dark', 'untouched', 'flat-1', 'flat-2', 'flat-3', 'board-untouched', 'board', 'edge', 'tip-2mm-1', 'tip-10mm-1']
    """
    require_integer("repeats", repeats, 1, 20)
    radii = [require_number("tip_radius_mm", tip, 0.1, 1000.0, hint="millimetres") for tip in tips_mm]
    flats = [
        CalibrationStep(
            name=f"{FLAT}-{level}",
            instruction=f"Press the whole face evenly on a soft flat pad, {how} (evens out the light)",
            frames=FLAT_FRAMES,
            optional=True,
        )
        for level, how in enumerate(("lightly", "harder", "as hard as it goes without white spots"), start=1)
    ]
    loadings = [
        CalibrationStep(
            name=f"{tip_name(tip)}-{run}",
            instruction=(
                f"Mount the tip of {tip:g} mm radius, not yet touching; then load from 0 to {LARGEST_N:g} N in steps "
                f"of {STEP_N:g} N and back to 0"
            ),
            tip_mm=tip,
            run=run,
        )
        for run in range(1, repeats + 1)
        for tip in radii
    ]
    return (
        CalibrationStep(name=DARK, instruction="Switch the lamps off, or cover the lens", frames=STILL_FRAMES),
        CalibrationStep(name=UNTOUCHED, instruction="Switch the lamps on, touch nothing", frames=STILL_FRAMES),
        *flats,
        CalibrationStep(
            name=BOARD_UNTOUCHED,
            instruction="Light the probe as for the dot board (white light where it needs some), touch nothing",
            frames=BOARD_FRAMES,
        ),
        CalibrationStep(name=BOARD, instruction="Press the dot board on the face", frames=BOARD_FRAMES),
        CalibrationStep(
            name=EDGE,
            instruction="Press a block with a straight edge on one half of the face, a little askew",
            frames=EDGE_FRAMES,
            optional=True,
        ),
        *loadings,
    )


def tip_name(radius_mm: float) -> str:
    """Name of a tip in folders, e.g. ``tip-2mm``."""
    return f"tip-{radius_mm:g}mm"
