"""What became of every frame that the camera sent."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Interruption:
    """A time without frames that nobody asked for.

    Attributes
    ----------
    after_frames
        Frames received before it.
    at_s
        When the last frame before it came, or the stream was started where none had, seconds of the monotonic clock.
    noticed_after_s
        How long after that it was noticed.
    reason
        One sentence.
    back_after_s
        How long after ``at_s`` frames came again; None while they have not.
    """

    after_frames: int
    at_s: float
    noticed_after_s: float
    reason: str
    back_after_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Account:
    """What became of the frames: every one that the camera sent is either received or missed.

    Attributes
    ----------
    received
        Frames that came whole.
    missed
        Frames that the camera numbered but that never came whole, by the gaps in its numbers.
    disordered
        Frames whose number did not ascend; they are not counted as received, nor kept.
    connections
        How often a camera was connected and began to stream.
    frames_per_s
        Rate at which frames came in the last two seconds.
    interruptions
        Times without frames.
    """

    received: int
    missed: int
    disordered: int
    connections: int
    frames_per_s: float
    interruptions: tuple[Interruption, ...]
