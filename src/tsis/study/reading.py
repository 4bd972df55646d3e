"""What a device said of a target."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from tsis.model.check import require_integer, require_number, require_one_of, require_pair
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

QUANTITIES = ("diameter_mm", "depth_mm", "young_kpa")
LONGEST = 120
LARGEST_SCORE, MOST_REPEATS = 1e12, 1000
LARGEST_VALUE = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceReading:
    """One reading.

    Parameters
    ----------
    code
        Of the target.
    device, operator
        What read it, and who held it.
    repeat
        How many times this operator has read the target with this device, this one included.
    score
        Higher means that an inclusion is likelier; of the virtual probe its probability. None where the device gave no
        answer: the reading is undecided, and no guess stands in for it.
    rank
        What orders readings of the same device where their scores are rounded: of the virtual probe the natural
        logarithm of the Bayes factor. None where the score itself does.
    reason
        Why it is undecided.
    values
        Diameter, depth and modulus that were read, those of `QUANTITIES` that there are.
    sd, interval_90
        Their standard deviations, and 90 % intervals, where the device tells them.
    flags
        Short names of what the reader must know.
    evidence
        Where it came from: hash of the frames, calibration, prior, seed, version.

    Raises
    ------
    InputError
        When a value lies outside its range.
    """

    code: str
    device: str
    operator: str
    repeat: int
    score: float | None
    rank: float | None = None
    reason: str = ""
    values: Mapping[str, float] = field(default_factory=dict)
    sd: Mapping[str, float] = field(default_factory=dict)
    interval_90: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    flags: tuple[str, ...] = ()
    evidence: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("code", "device", "operator"):
            require_short_name(name, getattr(self, name))
        require_integer("repeat", self.repeat, 1, MOST_REPEATS)
        if self.score is not None:
            score = require_number("score", self.score, -LARGEST_SCORE, LARGEST_SCORE)
            object.__setattr__(self, "score", score)
        if self.rank is not None:
            object.__setattr__(self, "rank", require_number("rank", self.rank, -LARGEST_SCORE, LARGEST_SCORE))
        for name in ("values", "sd"):
            held = {
                require_one_of("quantity", each, QUANTITIES): require_number(each, value, 0.0, LARGEST_VALUE)
                for each, value in getattr(self, name).items()
            }
            object.__setattr__(self, name, MappingProxyType(held))
        ends = {
            require_one_of("quantity", each, QUANTITIES): require_pair(each, tuple(float(end) for end in pair))
            for each, pair in self.interval_90.items()
        }
        object.__setattr__(self, "interval_90", MappingProxyType(ends))
        object.__setattr__(self, "flags", tuple(self.flags))
        for text in (self.reason, *self.flags):
            if not isinstance(text, str) or not text.isprintable():
                raise InputError(f"reason and flags must be printable text; got {text!r:.80}")
        object.__setattr__(self, "evidence", MappingProxyType(dict(self.evidence)))

    @property
    def undecided(self) -> bool:
        """Whether the device gave no answer."""
        return self.score is None

    @property
    def key(self) -> tuple[str, str, str, int]:
        """What no two readings of a study share."""
        return self.code, self.device, self.operator, self.repeat

    def plain(self) -> dict[str, Any]:
        """As plain values, for the log."""
        return {
            "code": self.code,
            "device": self.device,
            "operator": self.operator,
            "repeat": self.repeat,
            "score": self.score,
            "rank": self.rank,
            "reason": self.reason,
            "values": dict(self.values),
            "sd": dict(self.sd),
            "interval_90": {name: list(ends) for name, ends in self.interval_90.items()},
            "flags": list(self.flags),
            "evidence": dict(self.evidence),
        }


def parse_reading(plain: Mapping[str, Any]) -> DeviceReading:
    """The reading that `DeviceReading.plain` wrote.

    Raises
    ------
    InputError
        When it holds something else.
    """
    try:
        return DeviceReading(**plain)
    except (TypeError, AttributeError, ValueError, OverflowError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"a reading must hold what a study writes of it; wrong or missing: {error!s:.80}") from error


def require_short_name(what: str, name: object) -> str:
    """Return a short printable name, or say that it is none."""
    if not isinstance(name, str) or not 0 < len(name) <= LONGEST or not name.isprintable() or name != name.strip():
        raise InputError(
            f"{what} must be 1 to {LONGEST} printable letters without spaces around them; got {name!r:.80}"
        )
    return name


__all__ = ["QUANTITIES", "DeviceReading", "parse_reading", "require_short_name"]
