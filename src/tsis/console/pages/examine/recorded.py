"""What the store holds of the target under examination, read when it may have changed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.records.importing.present import numbered

if TYPE_CHECKING:
    from tsis.records import Store, StoredEstimate, StoredPress, Target

SHOWN = 8  # presses, the newest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recorded:
    """A target's number with what is kept of it.

    Attributes
    ----------
    number
        Of the target.
    target
        None while nothing is kept of it.
    count
        How many presses there are in all.
    presses
        The newest ones, the newest first.
    estimates
        Those in force.
    damaged
        A sentence for each thing that cannot be shown.
    """

    number: int
    target: Target | None = None
    count: int = 0
    presses: tuple[StoredPress, ...] = ()
    estimates: tuple[StoredEstimate, ...] = ()
    damaged: tuple[str, ...] = ()


def recorded(store: Store, number: int) -> Recorded:
    """Read the target; errors as of the store."""
    target = numbered(store, number)
    if target is None:
        return Recorded(number=number)
    count = store.press_count(target)
    dossier = store.dossier(target, limit=SHOWN, offset=max(0, count - SHOWN))
    return Recorded(
        number=number,
        target=target,
        count=count,
        presses=dossier.presses[::-1],
        estimates=dossier.in_force,
        damaged=dossier.damaged,
    )
