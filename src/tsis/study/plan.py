"""The plan of a study, its codes, readings and true targets."""

from __future__ import annotations

import re
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from datetime import datetime
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from tsis.__about__ import LARGEST_SEED, RESEARCH_USE_ONLY
from tsis.catalog.probes import list_probes
from tsis.errors import FileInputError, InputError, RecordsError
from tsis.files.canonical_json import SHA256, json_bytes
from tsis.files.json_values import from_json_value, to_json_value
from tsis.files.reading import parse_object
from tsis.model.content import ContentValue
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.require import (
    freeze_mappings,
    require_integer,
    require_number,
    require_one_of,
    require_pair,
    require_type,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence


QUANTITIES = ("diameter_mm", "depth_mm", "young_kpa")
LONGEST = 120
LARGEST_SCORE, MOST_REPEATS = 1e12, 1000
LARGEST_VALUE = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceReading(ContentValue):
    """One reading of a target by a device.

    Raises `InputError` when a value lies outside its range.
    """

    code: str  #: of the target
    #: device, operator: the device and its operator
    device: str
    operator: str
    repeat: int  #: number of this operator's readings of the target with this device, this one included
    #: Higher values mean a likelier inclusion; for the virtual probe its probability. None for an undecided reading,
    #: without any substitute.
    score: float | None
    #: Order of readings of the same device where their scores are rounded: for the virtual probe the natural logarithm
    #: of the Bayes factor. None where the score itself gives the order.
    rank: float | None = None
    reason: str = ""  #: why it is undecided
    #: diameter, depth and modulus, as far as measured; names of `QUANTITIES`
    values: Mapping[str, float] = field(default_factory=dict)
    #: sd, interval_90: their standard deviations, and 90 % intervals, where the device gives them
    sd: Mapping[str, float] = field(default_factory=dict)
    interval_90: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    flags: tuple[str, ...] = ()  #: short names of caveats
    #: provenance: hash of the frames, calibration, prior, seed, version
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
    """The reading in the JSON values of a log entry; `InputError` when they are no reading."""
    return from_json_value(DeviceReading, document, "reading")


def first_readings(readings: Iterable[DeviceReading]) -> tuple[DeviceReading, ...]:
    """Of each target, device and operator the reading with the lowest repeat, in whatever order they were entered.

    The result has the order in which targets, devices and operators first occur.
    """
    first: dict[tuple[str, str, str], DeviceReading] = {}
    for reading in readings:
        key = reading.code, reading.device, reading.operator
        if key not in first or reading.repeat < first[key].repeat:
            first[key] = reading
    return tuple(first.values())


def require_short_name(what: str, name: object) -> str:
    """Return a short printable name, or refuse it."""
    if not isinstance(name, str) or not 0 < len(name) <= LONGEST or not name.isprintable() or name != name.strip():
        requirement = f"must be 1 to {LONGEST} printable letters without spaces around them"
        raise InputError(name=what, requirement=requirement, value=f"{name!r:.80}")
    return name


TISSUE = ("young_kpa", "poisson", "thickness_mm")
LUMP = ("diameter_mm", "depth_mm", "young_kpa", "poisson")


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetTruth:
    """A target with its true values, secret before the unblinding.

    Raises `InputError` when the label is no short text, or the phantom has several inclusions or one that is no sphere.
    """

    label: str  #: its name in the list of targets
    phantom: Phantom  #: tissue, with one spherical inclusion or none

    def __post_init__(self) -> None:
        require_type("label", self.label, str)
        require_type("phantom", self.phantom, Phantom)
        if not 0 < len(self.label) <= LONGEST or not self.label.isprintable():
            raise InputError(f"label must be 1 to {LONGEST} printable letters; got {self.label!r:.80}")
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


LETTERS = "23456789ABCDEFGHJKLMNPQRSTUVWXYZ"  # without letters that look similar
LENGTH = 4
CODES, ORDER, TARGETS = 1, 2, 3  # independent streams of a seed

Target = TypeVar("Target")


def coded(targets: Sequence[Target], seed: int) -> dict[str, Target]:
    """Targets by a code, in the order of reading; both follow from the seed and the number of targets alone.

    `InputError` when the seed is no whole number from 0.

    Examples
    --------
    >>> list(coded(["a", "b", "c"], seed=1)) == list(coded(["x", "y", "z"], seed=1))
    True
    """
    require_integer("seed", seed, 0, LARGEST_SEED)
    order = np.random.default_rng([seed, ORDER]).permutation(len(targets))
    return {code: targets[position] for code, position in zip(_codes(len(targets), seed), order.tolist(), strict=True)}


def _codes(count: int, seed: int) -> list[str]:
    rng, codes = np.random.default_rng([seed, CODES]), dict[str, None]()
    while len(codes) < count:
        codes["T-" + "".join(LETTERS[position] for position in rng.integers(len(LETTERS), size=LENGTH))] = None
    return list(codes)


FORMAT, VERSION = "tsis-study", 1
MOST_FORCES = 16
LARGEST_THRESHOLD = 1e12
CODE = re.compile(r"T-[2-9A-HJ-NP-Z]{4}")
ANALYSED_READING = "the first reading of each target by each device"
UNDECIDED = "counted apart, and also as the wrong answer"


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyPlan:
    """The plan of a study, without its truth; `InputError` when a value lies outside its range."""

    name: str
    seed: int | None  # of codes, order and drawn targets; None where the seal contains it
    probe: str  # name of the virtual probe in the catalog
    forces_n: tuple[float, ...]  # on every target
    with_reference: bool  # whether it also presses tissue without inclusion nearby
    repeats: int  # readings of every target by an operator
    threshold: float  # least score of a target that is called one with an inclusion; fixed before any reading
    codes: tuple[str, ...]  # in the order of reading
    commitment: str  # SHA-256 of the sealed truth
    made: datetime
    tsis: str  # version that created it

    def __post_init__(self) -> None:
        for name in ("name", "tsis"):
            text = getattr(self, name)
            require_type(name, text, str)
            if not 0 < len(text) <= LONGEST or not text.isprintable():
                raise InputError(f"{name} must be 1 to {LONGEST} printable letters; got {text!r:.80}")
        if self.seed is not None:
            require_integer("seed", self.seed, 0, LARGEST_SEED)
        require_one_of("probe", self.probe, list_probes())
        forces = tuple(require_number("forces_n", force, 1e-4, 20.0, hint="newtons") for force in self.forces_n)
        if not 0 < len(forces) <= MOST_FORCES or len(set(forces)) < len(forces):
            raise InputError(f"forces_n must be 1 to {MOST_FORCES} different forces; got {list(self.forces_n)!r:.80}")
        object.__setattr__(self, "forces_n", forces)
        require_type("with_reference", self.with_reference, bool)
        require_integer("repeats", self.repeats, 1, MOST_REPEATS)
        require_number("threshold", self.threshold, -LARGEST_THRESHOLD, LARGEST_THRESHOLD)
        object.__setattr__(self, "codes", tuple(self.codes))
        bad = [code for code in self.codes if not isinstance(code, str) or not CODE.fullmatch(code)]
        if bad or not self.codes or len(set(self.codes)) < len(self.codes):
            raise InputError(
                f"codes must be different codes such as T-7F3K, at least one; got {bad or self.codes!r:.80}"
            )
        if not isinstance(self.commitment, str) or not SHA256.fullmatch(self.commitment):
            raise InputError(f"commitment must be a SHA-256 in hexadecimal digits; got {self.commitment!r:.80}")
        require_type("made", self.made, datetime)

    @property
    def device(self) -> str:
        """Device name of its virtual probe."""
        return f"virtual {self.probe}"

    def content(self) -> bytes:
        """Content of the file."""
        protocol = ("seed", "probe", "forces_n", "with_reference", "repeats", "threshold")
        head = {"format": FORMAT, "version": VERSION, "notice": RESEARCH_USE_ONLY, "tsis": self.tsis, "name": self.name}
        rules = {"judged_by": ANALYSED_READING, "undecided": UNDECIDED}
        return json_bytes(
            {**head, "made": self.made.isoformat()}
            | {name: getattr(self, name) for name in protocol}
            | {**rules, "codes": self.codes, "truth_sha256": self.commitment}
        )


def parse_study_plan(content: bytes, name: str) -> StudyPlan:
    """Parse the content of a ``study.json``; ``name`` identifies it in errors.

    `RecordsError` when it is no plan of this version.
    """
    with study_file_errors(name, "every part of a study's plan"):
        document = parse_object(content, name, values=2_000_000)
        require_study_format(document, FORMAT, VERSION)
        document["commitment"] = document["truth_sha256"]
        return from_json_value(StudyPlan, {field.name: document[field.name] for field in fields(StudyPlan)}, "study")


@contextmanager
def study_file_errors(name: str, parts: str) -> Iterator[None]:
    """Convert errors of the content of a file to `RecordsError` with its name."""
    try:
        yield
    except FileInputError as error:  # it names the file
        raise RecordsError(str(error)) from error
    except InputError as error:
        raise RecordsError(f"{name}: {error}") from error
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise RecordsError(f"{name} must hold {parts}; wrong or missing: {error!s:.80}") from error


def require_study_format(document: Mapping[str, Any], form: str, version: int) -> None:
    """Refuse a file of another kind or version."""
    if document.get("format") != form:
        raise InputError(f"format must be {form!r}; got {document.get('format')!r:.60}")
    if document.get("version") != version:
        raise InputError(f"version must be {version}; got {document.get('version')!r:.60} (use the tsis that made it)")
