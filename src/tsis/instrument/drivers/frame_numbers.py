"""Sequence numbers of frames, with gaps for lost ones."""

from __future__ import annotations

_LARGEST_16_BIT = 65535


class BlockCount:
    """Counts frames by the camera's numbers, so that a lost frame leaves a gap.

    GigE Vision numbers frames from 1 to 65535 and then from 1 again; other links count on in 64 bits. Any other step
    back means that the camera restarted: counting continues without a gap, because the loss is unknown.

    Examples
    --------
    >>> count = BlockCount()
    >>> [count.at(number) for number in (65533, 65535, 1, 2, 7)]
    [0, 2, 3, 4, 9]
    """

    def __init__(self) -> None:
        self._last: int | None = None
        self._sequence = -1

    def begin(self, number: int) -> None:
        """Count from this incomplete frame, unless counting has begun; one whose first packet is lost has number 0."""
        if self._last is None and number > 0:
            self._last, self._sequence = number, 0

    def at(self, number: int | None) -> int:
        """Sequence number of the frame with that ``number``; the next one without a number."""
        step = 1
        if number is not None:
            if self._last is not None:
                step = _steps(self._last, number)
            self._last = number
        self._sequence += step
        return self._sequence


def _steps(last: int, number: int) -> int:
    forward = number - last
    if forward > 0:
        return forward
    wrapped = forward + _LARGEST_16_BIT
    return wrapped if last <= _LARGEST_16_BIT and 0 < wrapped < _LARGEST_16_BIT // 2 and number > 0 else 1


FULL_SCALE = {"Mono8": 255.0, "Mono10": 1023.0, "Mono12": 4095.0, "Mono14": 16383.0, "Mono16": 65535.0}
