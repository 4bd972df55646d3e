"""Readings of devices, and true targets."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from tsis.errors import InputError
from tsis.files import from_json_value, to_json_value
from tsis.model import (
    NOT_IDENTIFIED_FLAG,
    ContentValue,
    Inclusion,
    Phantom,
    freeze_mappings,
    require_integer,
    require_number,
    require_one_of,
    require_pair,
    require_type,
)

if TYPE_CHECKING:
    from collections.abc import Mapping


QUANTITIES = ("diameter_mm", "depth_mm", "young_kpa")
LONGEST = 120
LARGEST_SCORE, MOST_REPEATS = 1e12, 1000
LARGEST_VALUE = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceReading(ContentValue):
    """One reading of a target by a device.

    Parameters
    ----------
    code
        Of the target.
    device, operator
        The device and its operator.
    repeat
        Number of this operator's readings of the target with this device, this one included.
    score
        Higher values mean a likelier inclusion; for the virtual probe its probability. None for an undecided reading,
        without any substitute.
    rank
        Order of readings of the same device where their scores are rounded: for the virtual probe the natural
        logarithm of the Bayes factor. None where the score itself gives the order.
    reason
        Why it is undecided.
    values
        Diameter, depth and modulus, as far as measured; names of `QUANTITIES`.
    sd, interval_90
        Their standard deviations, and 90 % intervals, where the device gives them.
    flags
        Short names of caveats.
    evidence
        Provenance: hash of the frames, calibration, prior, seed, version.

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
        for name in ("score", "rank"):
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, require_number(name, value, -LARGEST_SCORE, LARGEST_SCORE))
        for name in ("values", "sd"):
            by_name = {
                require_one_of("quantity", name, QUANTITIES): require_number(name, value, 0.0, LARGEST_VALUE)
                for name, value in getattr(self, name).items()
            }
            object.__setattr__(self, name, by_name)
        ends = {
            require_one_of("quantity", name, QUANTITIES): require_pair(name, tuple(float(end) for end in pair))
            for name, pair in self.interval_90.items()
        }
        object.__setattr__(self, "interval_90", ends)
        object.__setattr__(self, "flags", tuple(self.flags))
        for text in (self.reason, *self.flags):
            if not isinstance(text, str) or not text.isprintable():
                raise InputError(f"reason and flags must be printable text; got {text!r:.80}")
        freeze_mappings(self, "values", "sd", "interval_90", "evidence")

    @property
    def undecided(self) -> bool:
        """Whether the device gave no result."""
        return self.score is None

    @property
    def key(self) -> tuple[str, str, str, int]:
        """Unique key within a study."""
        return self.code, self.device, self.operator, self.repeat

    def json_values(self) -> dict[str, Any]:
        """JSON values for the log."""
        return to_json_value(self)


def parse_reading(document: Mapping[str, Any]) -> DeviceReading:
    """The reading in the JSON values of a log entry; `InputError` when they are no reading.

    Earlier programs logged mean and deviation of quantities that are not identified, too; those are left out.
    """
    reading = from_json_value(DeviceReading, document, "reading")
    withheld = {name for name in QUANTITIES if f"{name}{NOT_IDENTIFIED_FLAG}" in reading.flags}
    if withheld.isdisjoint(reading.values.keys() | reading.sd.keys()):
        return reading
    values, sd = (
        {name: value for name, value in part.items() if name not in withheld} for part in (reading.values, reading.sd)
    )
    return replace(reading, values=values, sd=sd)


def require_short_name(what: str, name: object) -> str:
    """Return a short printable name, or refuse it."""
    if not isinstance(name, str) or not 0 < len(name) <= LONGEST or not name.isprintable() or name != name.strip():
        raise InputError(
            f"{what} must be 1 to {LONGEST} printable letters without spaces around them; got {name!r:.80}"
        )
    return name


LONGEST_LABEL = 120
TISSUE = ("young_kpa", "poisson", "thickness_mm")
LUMP = ("diameter_mm", "depth_mm", "young_kpa", "poisson")


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetTruth:
    """A target with its true values, secret before the unblinding.

    Parameters
    ----------
    label
        Its name in the list of targets.
    phantom
        Tissue, with one spherical inclusion or none.

    Raises
    ------
    InputError
        When the label is no short text, or the phantom has several inclusions or one that is no sphere.
    """

    label: str
    phantom: Phantom

    def __post_init__(self) -> None:
        require_type("label", self.label, str)
        require_type("phantom", self.phantom, Phantom)
        if not 0 < len(self.label) <= LONGEST_LABEL or not self.label.isprintable():
            raise InputError(f"label must be 1 to {LONGEST_LABEL} printable letters; got {self.label!r:.80}")
        lump = self.phantom.inclusion
        if self.phantom.more_inclusions or (lump is not None and lump.semi_axes_mm is not None):
            raise InputError(f"phantom must hold one sphere or none; got {self.phantom.inclusions!r:.120}")

    @property
    def has_inclusion(self) -> bool:
        """Whether there is an inclusion."""
        return self.phantom.inclusion is not None

    @property
    def values(self) -> dict[str, float]:
        """Diameter, depth and modulus of the inclusion by the names of an estimate; empty where there is none."""
        lump = self.phantom.inclusion
        return {} if lump is None else {name: getattr(lump, name) for name in QUANTITIES}

    def json_values(self) -> dict[str, Any]:
        """JSON values for a file."""
        lump = self.phantom.inclusion
        inclusion = None
        if lump is not None:
            inclusion = {**{name: getattr(lump, name) for name in LUMP}, "offset_mm": list(lump.offset_mm)}
        return {
            "label": self.label,
            "tissue": {name: getattr(self.phantom, name) for name in TISSUE},
            "inclusion": inclusion,
        }


def parse_target_truth(document: Mapping[str, Any]) -> TargetTruth:
    """The target in the JSON values of a file; `InputError` when they are no target.

    Examples
    --------
    >>> blank = TargetTruth(label="gel", phantom=Phantom(young_kpa=5.0, thickness_mm=30.0))
    >>> parse_target_truth(blank.json_values()) == blank
    True
    """
    try:
        tissue, lump = document["tissue"], document["inclusion"]
        inclusion = None
        if lump is not None:
            inclusion = Inclusion(**{name: lump[name] for name in LUMP}, offset_mm=tuple(lump["offset_mm"]))
        phantom = Phantom(**{name: tissue[name] for name in TISSUE}, inclusion=inclusion)
        return TargetTruth(label=document["label"], phantom=phantom)
    except (KeyError, TypeError, IndexError) as error:
        raise InputError(
            f"a target must hold label, tissue and inclusion as a study writes them; got {document!r:.120}"
        ) from error
