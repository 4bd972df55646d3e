"""The press guard, live: one step a frame, from a state to flags and the next state."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration.guard.blocks import FrameShape
from tsis.calibration.guard.flags import findings
from tsis.calibration.guard.flicker import FRAMES, flicker_amplitude
from tsis.calibration.guard.history import PressHistory
from tsis.calibration.guard.limits import GuardLimits
from tsis.calibration.guard.reading import prepared, read_guard_frame
from tsis.calibration.guard.reference import GuardReference
from tsis.calibration.guard.stillness import RepeatedFrames
from tsis.calibration.settling.verdict import LONGEST_S, assess_history
from tsis.model.check import require_number, require_type

if TYPE_CHECKING:
    from tsis.calibration.guard.flags import GuardFlag
    from tsis.calibration.guard.reading import GuardReading
    from tsis.calibration.guard.reference import Prepared
    from tsis.calibration.settling.verdict import Settling
    from tsis.instrument import Frame


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchState:
    """What a watch remembers from frame to frame, of bounded size.

    Attributes
    ----------
    raised
        Names of the flags that are up.
    history
        Light of the present press.
    outside
        Time and level where no press reaches, of the newest frames.
    stillness
        How often in a row the newest picture came.
    reading, settling
        Of the newest frame; None before the first, and ``settling`` without contact or times.
    """

    raised: frozenset[str] = frozenset()
    history: PressHistory = field(default_factory=PressHistory)
    outside: tuple[tuple[float, float], ...] = ()
    stillness: RepeatedFrames = field(default_factory=RepeatedFrames)
    reading: GuardReading | None = None
    settling: Settling | None = None


class PressWatch:
    """A press guard for the frames of one camera in one mode.

    A flag goes up when its value passes the limit, and comes down when the value has come back to the part ``release``
    of it: between the two nothing changes, so that noise at a limit does not make flags flicker.

    Parameters
    ----------
    shape
        Of the frames: ``FrameShape.of(image)``.
    reference
        What presses are compared with; see `GuardReference`.
    limits
        The thresholds.
    longest_s
        Longest time constant of the tissue to be reckoned with, s: see `tsis.calibration.settling.judge_settling`.

    Raises
    ------
    InputError
        When an argument is of the wrong kind.
    ImageMismatchError
        When the reference is of another size or depth than the frames.

    Examples
    --------
    >>> from tsis.instrument import Frame
    >>> from tsis.model import TactileImage
    >>> untouched = TactileImage(grey=np.full((120, 160), 8.0))
    >>> watch = PressWatch(FrameShape.of(untouched), reference=GuardReference(untouched=untouched))
    >>> flags, state = watch.step(WatchState(), Frame(pixels=untouched.grey, sequence=0, time_s=0.0))
    >>> [flag.name for flag in flags]
    ['no-contact']
    """

    def __init__(
        self,
        shape: FrameShape,
        *,
        reference: GuardReference | None = None,
        limits: GuardLimits | None = None,
        longest_s: float = LONGEST_S,
    ) -> None:
        require_type("shape", shape, FrameShape)
        reference = GuardReference() if reference is None else reference
        require_type("reference", reference, GuardReference)
        self.limits = GuardLimits() if limits is None else limits
        require_type("limits", self.limits, GuardLimits)
        self._longest_s = require_number("longest_s", longest_s, 1e-2, 1e5, hint="seconds")
        self._prepared: Prepared = prepared(reference, shape)

    def step(
        self, state: WatchState, frame: Frame, force_n: float | None = None
    ) -> tuple[tuple[GuardFlag, ...], WatchState]:
        """Look at the next frame.

        Parameters
        ----------
        state
            What the step before returned; ``WatchState()`` at the start.
        frame
            As the camera delivered it. Without ``time_s`` neither settling nor flicker is checked; a time that runs
            back, after a camera was lost, begins a new press.
        force_n
            Force of the gauge at that time, N; None when unknown.

        Returns
        -------
        tuple of GuardFlag
            Those that are up.
        WatchState
            For the next step.

        Raises
        ------
        ImageMismatchError
            When the frame is of another size or depth.
        InputError
            When the force lies outside [0, 1000] N.
        """
        self._prepared.check_fits(frame.pixels, frame.full_scale)
        if force_n is not None:
            require_number("force_n", force_n, 0.0, 1000.0, hint="newtons")
        reading = read_guard_frame(frame.pixels, self._prepared, force_n=force_n)
        history, outside = self._remembered(state, frame.time_s, reading)
        # Between two closed bins the series is the same, and so is the verdict.
        settling = state.settling if history.time_s is state.history.time_s else self._judged(history)
        stillness = state.stillness.with_picture(frame.pixels)
        found = findings(
            reading,
            self.limits,
            settling=settling,
            flicker_grey=flicker_amplitude(*_columns(outside)),
            in_a_row=stillness.in_a_row,
        )
        up = tuple(
            one.flag for one in found if one.excess > (self.limits.release if one.flag.name in state.raised else 1.0)
        )
        raised = frozenset(flag.name for flag in up)
        return up, WatchState(
            raised=raised,
            history=history,
            outside=outside,
            stillness=stillness,
            reading=reading,
            settling=settling,
        )

    def _remembered(
        self, state: WatchState, time_s: float | None, reading: GuardReading
    ) -> tuple[PressHistory, tuple[tuple[float, float], ...]]:
        """Histories with the new frame; those of an earlier press or stream are dropped."""
        if time_s is None:
            return PressHistory(), ()
        touched = reading.contrast > max(self.limits.contact, reading.noise)
        history = state.history.with_sample(time_s, reading.light) if touched else PressHistory()
        if reading.outside_grey is None:
            return history, ()
        earlier = state.outside if not state.outside or state.outside[-1][0] < time_s else ()
        return history, (*earlier[1 - FRAMES :], (time_s, reading.outside_grey))

    def _judged(self, history: PressHistory) -> Settling | None:
        if history.last_s is None:  # no contact
            return None
        time, value = np.array(history.time_s), np.array(history.value)
        return assess_history(time, value, tolerance=self.limits.moving, longest_s=self._longest_s)


def _columns(outside: tuple[tuple[float, float], ...]) -> tuple[list[float], list[float]]:
    return [time for time, _ in outside], [level for _, level in outside]
