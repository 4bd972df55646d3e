"""The plan of a study, and its codes in random order, which reveal nothing about the targets."""

from __future__ import annotations

import re
from contextlib import contextmanager
from dataclasses import dataclass, fields
from datetime import datetime
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from tsis.__about__ import LARGEST_SEED, RESEARCH_USE_ONLY
from tsis.catalog import list_probes
from tsis.errors import FileInputError, InputError, RecordsError
from tsis.files import SHA256, from_json_value, json_bytes, parse_object
from tsis.model import require_integer, require_number, require_one_of, require_type

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence


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
LONGEST_NAME, MOST_FORCES, MOST_REPEATS = 120, 16, 1000
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
            if not 0 < len(text) <= LONGEST_NAME or not text.isprintable():
                raise InputError(f"{name} must be 1 to {LONGEST_NAME} printable letters; got {text!r:.80}")
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
