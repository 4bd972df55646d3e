"""What a loader made of one hostile file.

A *silent acceptance* is this and nothing else: the file carries a checksum or hash that the loader promises to check
(`Loader.integrity`), its bytes were changed without making that checksum right again, and the loader returned a value
that differs from the original's. A changed JPEG, BMP, TIFF, CSV, NPY or PLY file whose changed value is returned is
*other*: those formats hold no checksum, and the SHA-256 of a picture's bytes goes into its settings and so into every
result. A file whose checksums were made right again (*forged*) is *other* too: a hash without a key proves that nothing
was damaged, not who wrote it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum
from typing import TYPE_CHECKING

from tsis.errors import TsisError

if TYPE_CHECKING:
    from collections.abc import Hashable
    from pathlib import Path

    from benchmarks.hostile.loader import Loader

LONGEST_SENTENCE = 1000


class Verdict(Enum):
    """What happened."""

    REFUSED = "refused"
    EQUAL = "equal"
    OTHER = "other"
    SILENT = "silent"
    UNTYPED = "untyped"
    CRASHED = "crashed"


@dataclass(frozen=True, slots=True)
class Outcome:
    """A verdict, and what was said where it is a bad one."""

    verdict: Verdict
    said: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """Counts by verdict, with the slowest file and the most memory."""

    counts: dict[str, int] = field(default_factory=dict)
    slowest_ms: float = 0.0
    memory_mb: float = 0.0
    said: tuple[str, ...] = ()

    @property
    def files(self) -> int:
        """How many there were."""
        return sum(self.counts.values())

    def of(self, verdict: Verdict) -> int:
        """How many had this verdict."""
        return self.counts.get(verdict.value, 0)

    def with_one(self, outcome: Outcome, ms: float = 0.0) -> Tally:
        """With one file more."""
        counts = self.counts | {outcome.verdict.value: self.of(outcome.verdict) + 1}
        said = (*self.said, outcome.said) if outcome.said and len(self.said) < 20 else self.said
        return replace(self, counts=counts, slowest_ms=max(self.slowest_ms, ms), said=said)

    def with_all(self, other: Tally) -> Tally:
        """With those of another tally."""
        counts = {name: self.counts.get(name, 0) + other.counts.get(name, 0) for name in self.counts | other.counts}
        return Tally(
            counts=counts,
            slowest_ms=max(self.slowest_ms, other.slowest_ms),
            memory_mb=max(self.memory_mb, other.memory_mb),
            said=(*self.said, *other.said)[:20],
        )


def judged(loader: Loader, path: Path, original: Hashable, *, forged: bool) -> Outcome:
    """Load a file and judge what came of it; what is no `Exception` goes through."""
    try:
        value = loader.load(path)
    except TsisError as error:
        sentence = str(error)
        if not sentence.isprintable() or not sentence or "Traceback" in sentence or len(sentence) > LONGEST_SENTENCE:
            return Outcome(Verdict.UNTYPED, f"no one sentence: {type(error).__name__}: {sentence!r:.300}")
        return Outcome(Verdict.REFUSED)
    except Exception as error:  # exactly what must not happen, counted
        return Outcome(Verdict.UNTYPED, f"{type(error).__module__}.{type(error).__name__}: {error!s:.200}")
    if value == original:
        return Outcome(Verdict.EQUAL)
    return Outcome(Verdict.SILENT, f"{value!r:.200}") if loader.integrity and not forged else Outcome(Verdict.OTHER)
