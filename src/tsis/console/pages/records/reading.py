"""What the page of a target shows, read at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.calibration.guard import FLAGS
from tsis.console.files.asked import target_of
from tsis.model.errors import TsisError
from tsis.report.subject import without_identity

if TYPE_CHECKING:
    from tsis.records import Store, StoredPress, Target, TargetRecord

AT_ONCE = 24  # presses of a sheet
UNKNOWN_FLAG = "a flag that tsis does not know"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetSeen:
    """A target as it is stored now.

    Attributes
    ----------
    target
        As it is stored.
    dossier
        Its estimates and calibrations as they may be shown, without presses: of a subject the pseudonym only.
    presses, offset, total
        A sheet of its presses, how many come before it, and how many there are.
    """

    target: Target
    dossier: TargetRecord
    presses: tuple[StoredPress, ...]
    offset: int
    total: int

    @property
    def private(self) -> bool:
        """Whether this is a subject, of whom notes and names are shown to nobody who did not ask for them."""
        return self.target.kind == "subject"

    @property
    def sheet(self) -> tuple[object, ...]:
        """What is told of the presses: two that are equal look alike."""
        return self.private, self.offset, self.total, self.presses

    @property
    def told(self) -> tuple[object, ...]:
        """What is told of all: two that are equal look alike."""
        known = self.dossier
        made = tuple(each.id for each in known.estimates)
        return self.target, self.sheet, made, tuple(known.calibrations), known.damaged


def read_target(store: Store, number: str, offset: int) -> TargetSeen:
    """Read a target; ``offset`` behind its presses becomes that of the last sheet.

    Raises
    ------
    InputError
        When there is no target of that number.
    RecordsError
        When the store cannot be read.
    """
    target = target_of(store, number)
    total = store.press_count(target)
    offset = min(offset, max(0, (total - 1) // AT_ONCE * AT_ONCE))
    return TargetSeen(
        target=target,
        dossier=without_identity(store.dossier(target, limit=0)),
        presses=store.presses(target, limit=AT_ONCE, offset=offset),
        offset=offset,
        total=total,
    )


def fault_of(store: Store, press: StoredPress) -> str:
    """Why the frame of a press cannot be read; empty when it can."""
    try:
        store.levels(press.frame)
    except TsisError as error:
        return str(error)
    return ""


def flags_of(press: StoredPress, *, private: bool) -> tuple[str, ...]:
    """Flags as they may be shown: of a subject only those that tsis raises."""
    return tuple(flag if not private or flag in FLAGS else UNKNOWN_FLAG for flag in press.flags)
