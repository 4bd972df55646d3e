"""Frames counted by the numbers that the device gave them, so that what was lost on the way leaves a gap."""

from __future__ import annotations

WRAP = 65535  # GigE Vision counts 1 to 65535 and begins again at 1; newer cameras count in 64 bits
FURTHEST = WRAP // 2


class Numbering:
    """Sequence numbers from 0, from a device's numbers, which begin anywhere.

    Examples
    --------
    >>> count = Numbering()
    >>> [count.of(number) for number in (65533, 65535, 1, 2, 4)]
    [0, 2, 3, 4, 6]
    """

    def __init__(self) -> None:
        self._last: int | None = None
        self._sequence = 0

    def of(self, number: int) -> int:
        """Sequence number of a whole frame; a device that begins its count again goes on without a gap."""
        if self._last is None:
            self.begin(number)
            return 0
        step = number - self._last
        if step <= 0 and self._last <= WRAP:
            step += WRAP if number else WRAP + 1  # some count from 0
        self._sequence += step if 0 < step <= FURTHEST else 1
        self._last = number
        return self._sequence

    def begin(self, number: int) -> None:
        """The first frame of which anything came, whole or not."""
        if self._last is None:
            self._last = number
