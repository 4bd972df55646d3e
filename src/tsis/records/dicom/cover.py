"""Who an export says it is of: a pseudonym without dates, or the label and the true times."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from datetime import UTC
from typing import TYPE_CHECKING

from tsis.model import list_probes
from tsis.model.errors import RecordsError

if TYPE_CHECKING:
    from datetime import datetime

    from tsis.records import Dossier, Target

LONGEST = 64  # of the value representations LO and PN
PLAIN_FLAG = re.compile(r"[a-z][a-z0-9_-]{0,63}")
WITHHELD = "(left out, because it names what is not to be named)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Cover:
    """What may be said of one target in one export.

    Parameters
    ----------
    identified
        Whether label and true times are told.
    target
        Whose data they are.
    names
        Strings that a de-identified export may not hold.
    """

    identified: bool
    target: Target
    names: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """What UIDs start from: those of a de-identified export tell nothing of the identified one's."""
        return f"{'identified' if self.identified else 'de-identified'} {self.target.id}"

    @property
    def pseudonym(self) -> str:
        """The same for a target for ever; nobody gets from it to the identity, which is random."""
        return "TSIS-" + hashlib.sha256(f"tsis pseudonym {self.target.id}".encode()).hexdigest()[:12].upper()

    @property
    def patient_name(self) -> str:
        """Label of the target as a DICOM name, in which some characters have meanings of their own."""
        label = one_line(re.sub(r"[\^=]", " ", self.target.name), LONGEST - 1) or f"target {self.target.number}"
        return f"{label if self.identified else self.pseudonym}^"  # the caret says that it is one word on purpose

    @property
    def patient_id(self) -> str:
        """The identity of the target in its store, or the pseudonym."""
        return one_line(self.target.id) if self.identified else self.pseudonym

    @property
    def file_stem(self) -> str:
        """How the names of all files start."""
        return f"tsis-{self.target.number:05d}" if self.identified else self.pseudonym.lower()

    def moment(self, when: datetime) -> tuple[str, str] | None:
        """Date and time in UTC as DICOM writes them; None where they may not be told."""
        if not self.identified:
            return None
        when = when.astimezone(UTC)
        return f"{when.year:04d}" + when.strftime("%m%d"), when.strftime("%H%M%S.%f")

    def flags(self, flags: tuple[str, ...]) -> tuple[str, ...]:
        """Flags that this program gives; others are free text, which only an identified export holds."""
        return flags if self.identified else tuple(flag for flag in flags if PLAIN_FLAG.fullmatch(flag))

    def probe(self, name: str) -> str:
        """Name of a probe; one that is in no catalog is free text, which only an identified export holds."""
        return one_line(name) if self.identified or name in list_probes() else ""

    def text(self, text: str) -> str:
        """A sentence; withheld where it says one of the names."""
        found = not self.identified and any(name.casefold() in text.casefold() for name in self.names)
        return WITHHELD if found else text


def cover_of(dossier: Dossier, *, identified: bool) -> Cover:
    """What an export of a dossier may say.

    Raises
    ------
    RecordsError
        When the target has no identity, from which pseudonym and UIDs follow.
    """
    target = dossier.target
    if not target.id:
        raise RecordsError("the target must have an identity, which a store gives it; got a target without id")
    names = [
        target.name,
        target.note,
        target.id,
        *(word for press in dossier.presses for word in (press.name, press.note)),
    ]
    return Cover(identified=identified, target=target, names=tuple(name for name in names if len(name) > 1))


def one_line(text: str, longest: int = LONGEST) -> str:
    """Text as a short DICOM value: one line, no backslash, which separates values, and not too long in bytes."""
    words = " ".join("".join(letter if letter.isprintable() else " " for letter in text.replace("\\", "/")).split())
    return words.encode()[:longest].decode(errors="ignore").strip()
