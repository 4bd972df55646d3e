"""Identity of the target in a DICOM export: a pseudonym without dates, or number, label and times."""

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
    """The target of an export, de-identified unless ``identified``."""

    identified: bool
    target: Target

    @property
    def key(self) -> str:
        """The source of UIDs, independent for identified and de-identified exports."""
        return f"{'identified' if self.identified else 'de-identified'} {self.target.id}"

    @property
    def patient_name(self) -> str:
        """Label of the target as a DICOM name, without its special characters."""
        label = dicom_line(re.sub(r"[\^=]", " ", self.target.name), LONGEST - 1) or f"target {self.target.number}"
        return f"{label if self.identified else self.target.id}^"  # the caret marks an intentional single component

    @property
    def patient_id(self) -> str:
        """Kind and number of the target, or the pseudonym; never its identity."""
        return public_identity(self.target) if self.identified else self.target.id

    @property
    def file_stem(self) -> str:
        """Start of the file names."""
        return f"tsis-{self.target.number:05d}" if self.identified else self.target.id.lower()

    def moment(self, when: datetime) -> tuple[str, str] | None:
        """Date and time in UTC as DICOM text; None for a de-identified export."""
        if not self.identified:
            return None
        when = when.astimezone(UTC)
        return f"{when.year:04d}" + when.strftime("%m%d"), when.strftime("%H%M%S.%f")


def export_identity(record: TargetRecord, *, identified: bool) -> tuple[TargetRecord, ExportIdentity]:
    """The record to export and its identity; `RecordsError` when the target has no id."""
    if not record.target.id:
        raise RecordsError("the target must have an identity, which a store gives it; got a target without id")
    exported = record if identified else deidentified(record)
    return exported, ExportIdentity(identified=identified, target=exported.target)


def dicom_line(text: str, longest: int = LONGEST) -> str:
    """Text as a short DICOM value: one line without backslashes, of limited length in bytes."""
    line = " ".join("".join(letter if letter.isprintable() else " " for letter in text.replace("\\", "/")).split())
    return line.encode()[:longest].decode(errors="ignore").strip()
