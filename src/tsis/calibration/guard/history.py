"""The light of one press over time, in bounded memory: equal bins that double when there are too many."""

from __future__ import annotations

from dataclasses import dataclass, replace

from tsis.calibration.settling.verdict import BINS

STEP = 0.05  # a change between neighbouring bins that is no settling tail but another press


@dataclass(frozen=True, slots=True, kw_only=True)
class PressHistory:
    """Averages of a series since the press began to be held.

    Attributes
    ----------
    time_s, value
        Means of the full bins, oldest first, at most `BINS`.
    per_bin
        Samples in each of them, a power of two.
    open_time_s, open_value
        Sums over the samples that do not fill a bin yet.
    open_count
        Their number.
    last_s
        Time of the newest sample; None when there is none.
    """

    time_s: tuple[float, ...] = ()
    value: tuple[float, ...] = ()
    per_bin: int = 1
    open_time_s: float = 0.0
    open_value: float = 0.0
    open_count: int = 0
    last_s: float | None = None

    def with_sample(self, time_s: float, value: float) -> PressHistory:
        """The history with one sample more; a new one where time runs back or the value steps.

        Examples
        --------
        >>> history = PressHistory()
        >>> for number in range(1000):
        ...     history = history.with_sample(number / 30, 100.0)
        >>> len(history.value) <= 128, history.per_bin
        (True, 8)
        """
        if self.last_s is not None and time_s <= self.last_s:
            return PressHistory().with_sample(time_s, value)
        grown = replace(
            self,
            open_time_s=self.open_time_s + time_s,
            open_value=self.open_value + value,
            open_count=self.open_count + 1,
            last_s=time_s,
        )
        return grown._closed(time_s, value) if grown.open_count == self.per_bin else grown

    def _closed(self, time_s: float, value: float) -> PressHistory:
        mean_s, mean = self.open_time_s / self.open_count, self.open_value / self.open_count
        if self.value and abs(mean - self.value[-1]) > STEP * abs(mean):
            return PressHistory(time_s=(time_s,), value=(value,), last_s=time_s)
        times, values = (*self.time_s, mean_s), (*self.value, mean)
        if len(times) < BINS:
            return PressHistory(time_s=times, value=values, per_bin=self.per_bin, last_s=self.last_s)
        pairs = range(0, BINS, 2)
        return PressHistory(
            time_s=tuple((times[i] + times[i + 1]) / 2 for i in pairs),
            value=tuple((values[i] + values[i + 1]) / 2 for i in pairs),
            per_bin=2 * self.per_bin,
            last_s=self.last_s,
        )
