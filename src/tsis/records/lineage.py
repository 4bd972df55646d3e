"""The order of estimates: by when they were made, and each after the one that it supersedes."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import datetime

    from tsis.records.values import StoredEstimate


def in_lineage(estimates: Sequence[StoredEstimate]) -> tuple[StoredEstimate, ...]:
    """Estimates in the order in which they were made, as far as clocks tell.

    A clock can be set back. What supersedes another was made after it all the same, so it counts as made then at least.

    Parameters
    ----------
    estimates
        Of one target.

    Returns
    -------
    tuple
        All of them; the last is the one in force.
    """
    known = {stored.id: stored for stored in estimates}

    def made(stored: StoredEstimate) -> tuple[datetime, int, str]:
        latest, generation, seen = stored.made, 0, {stored.id}
        before = stored
        while before.supersedes in known and before.supersedes not in seen:  # seen: somebody tampered with it
            before = known[before.supersedes]
            seen.add(before.id)
            latest, generation = max(latest, before.made), generation + 1
        return latest, generation, stored.id

    return tuple(sorted(estimates, key=made))
