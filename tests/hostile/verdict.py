"""What a loader made of one hostile file.

A *silent acceptance* is this and nothing else: the file carries a checksum or hash that the loader promises to check
(`Loader.integrity`), its bytes were changed without making that checksum right again, and the loader returned a value
that differs from the original's. A changed JPEG, BMP, TIFF, CSV, NPY or PLY file whose changed value is returned is
*other*: those formats hold no checksum, and the SHA-256 of a picture's bytes goes into its settings and so into every
result. A file whose checksums were made right again (*forged*) is *other* too: a hash without a key proves that nothing
was damaged, not who wrote it.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

from tsis.errors import TsisError

if TYPE_CHECKING:
    from collections.abc import Hashable
    from pathlib import Path

    from tests.hostile.loader import Loader

LONGEST_SENTENCE = 1000


class Verdict(Enum):
    """What happened."""

    REFUSED = "refused"
    EQUAL = "equal"
    OTHER = "other"
    SILENT = "silent"
    UNTYPED = "untyped"


@dataclass(frozen=True, slots=True)
class Outcome:
    """A verdict, and what was said where it is a bad one."""

    verdict: Verdict
    said: str = ""


@dataclass(slots=True, kw_only=True)
class Tally:
    """Counts by verdict, and what was said by the first bad ones."""

    counts: Counter[Verdict] = field(default_factory=Counter)
    said: list[str] = field(default_factory=list)

    def add(self, outcome: Outcome, name: str) -> None:
        """Count one file more."""
        self.counts[outcome.verdict] += 1
        if outcome.said and len(self.said) < 20:
            self.said.append(f"{name}: {outcome.said}")


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
