"""What exports call a target: a pseudonym that only its store can tell whose it is, or number and kind."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from tsis.records.secret import derived

if TYPE_CHECKING:
    from tsis.records.dossier import TargetRecord
    from tsis.records.values import Target

DIGITS = 12


def pseudonym(dossier: TargetRecord) -> str:
    """The same for a target of a store for ever; without the store's secret nobody gets from it to the target.

    Examples
    --------
    >>> from datetime import UTC, datetime
    >>> from tsis.records import TargetRecord, Target
    >>> target = Target(number=3, kind="subject", made=datetime(2026, 11, 22, tzinfo=UTC), id="a")
    >>> pseudonym(TargetRecord(target=target, presses=(), read={}.__getitem__, secret="5a" * 32))
    'TSIS-077785083242'
    """
    return "TSIS-" + hidden(dossier, "pseudonym", dossier.target.id)[:DIGITS].upper()


def hidden(dossier: TargetRecord, what: str, identity: str) -> str:
    """What stands for an identity in a de-identified export: as lasting, and as hidden, as the pseudonym."""
    return derived(dossier.secret, what, identity)[:32]


def shown_identity(target: Target) -> str:
    """Kind and number of a target, which people know it by, and what tells it from that of another store.

    The identity itself stays in the store, and in what is handed from store to store.
    """
    apart = hashlib.sha256(f"tsis target {target.id}".encode()).hexdigest()[:8]
    return f"{target.kind}-{target.number:05d}-{apart}"
