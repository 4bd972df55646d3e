"""Who an export says it is of: a pseudonym without dates, or number, label and the true times."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC
from typing import TYPE_CHECKING

from tsis.errors import RecordsError
from tsis.records._deidentify import deidentified, public_identity

if TYPE_CHECKING:
    from datetime import datetime

    from tsis.records._target_record import TargetRecord
    from tsis.records._values import Target


LONGEST = 64  # of the value representations LO and PN


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportIdentity:
    """What may be said of one target in one export.

    Parameters
    ----------
    identified
        Whether number, label and true times are told.
    target
        Whose data they are; of a de-identified export as `tsis.records._deidentify` gives it.
    """

    identified: bool
    target: Target

    @property
    def key(self) -> str:
        """What UIDs start from: those of a de-identified export tell nothing of the identified one's."""
        return f"{'identified' if self.identified else 'de-identified'} {self.target.id}"

    @property
    def patient_name(self) -> str:
        """Label of the target as a DICOM name, in which some characters have meanings of their own."""
        label = dicom_line(re.sub(r"[\^=]", " ", self.target.name), LONGEST - 1) or f"target {self.target.number}"
        return f"{label if self.identified else self.target.id}^"  # the caret says that it is one word on purpose

    @property
    def patient_id(self) -> str:
        """Kind and number of the target, or the pseudonym; never its identity, which stays in the store."""
        return public_identity(self.target) if self.identified else self.target.id

    @property
    def file_stem(self) -> str:
        """How the names of all files start."""
        return f"tsis-{self.target.number:05d}" if self.identified else self.target.id.lower()

    def moment(self, when: datetime) -> tuple[str, str] | None:
        """Date and time in UTC as DICOM writes them; None where they may not be told."""
        if not self.identified:
            return None
        when = when.astimezone(UTC)
        return f"{when.year:04d}" + when.strftime("%m%d"), when.strftime("%H%M%S.%f")


def export_identity(record: TargetRecord, *, identified: bool) -> tuple[TargetRecord, ExportIdentity]:
    """What is told of a dossier, and what it is said to be of.

    Raises
    ------
    RecordsError
        When the target has no identity, from which pseudonym and UIDs follow.
    """
    if not record.target.id:
        raise RecordsError("the target must have an identity, which a store gives it; got a target without id")
    reported = record if identified else deidentified(record)
    return reported, ExportIdentity(identified=identified, target=reported.target)


def dicom_line(text: str, longest: int = LONGEST) -> str:
    """Text as a short DICOM value: one line, no backslash, which separates values, and not too long in bytes."""
    words = " ".join("".join(letter if letter.isprintable() else " " for letter in text.replace("\\", "/")).split())
    return words.encode()[:longest].decode(errors="ignore").strip()
