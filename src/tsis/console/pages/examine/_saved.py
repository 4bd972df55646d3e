"""What the store has of the target that is examined, read and drawn at once, outside the event loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.records.importing import target_by_number
from tsis.report import address, estimate_pictures

if TYPE_CHECKING:
    from tsis.model import Estimate
    from tsis.records import StoredEstimate, StoredPress, Target
    from tsis.records.store import Store
    from tsis.report import Picture

SHOWN = 8  # presses, the newest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SavedTarget:
    """A target's number and its stored record."""

    number: int
    target: Target | None = None  # None while nothing is stored
    count: int = 0  # of all presses
    presses: tuple[StoredPress, ...] = ()  # the newest ones, the newest first
    estimates: tuple[StoredEstimate, ...] = ()  # the current ones
    damaged: tuple[str, ...] = ()  # a message for each record that cannot be shown


def saved_target(store: Store, number: int) -> SavedTarget:
    """Read the target; errors as of the store."""
    if (target := target_by_number(store, number)) is None:
        return SavedTarget(number=number)
    count = store.press_count(target)
    record = store.record(target, limit=SHOWN, offset=max(0, count - SHOWN))
    return SavedTarget(
        number=number,
        target=target,
        count=count,
        presses=record.presses[::-1],
        estimates=record.active_estimates,
        damaged=record.damaged,
    )


def drawn(estimate: Estimate) -> tuple[tuple[Picture, str], ...]:
    """Posterior and section of an estimate with their data addresses; a withheld one says why instead of a number."""
    return tuple((picture, address(picture)) for picture in estimate_pictures(estimate))
