"""What became of records that came from elsewhere, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.report.target_words import count_of

if TYPE_CHECKING:
    from tsis.records import Target
    from tsis.records.taking_in import ImportedTarget


def entered_text(target: Target, *, new: bool, added: int, present: int, estimates: int) -> str:
    """Where presses went, and how many of them were there."""
    parts = [f"{count_of(added, 'press')} added"]
    parts += [f"{present} there already"] if present else []
    parts += [f"{count_of(estimates, 'estimate')} added"] if estimates else []
    return f"target {target.number}{' (new)' if new else ''}; {', '.join(parts)}"


def import_message(taken: ImportedTarget) -> str:
    """What became of a bundle."""
    words = entered_text(
        taken.target, new=taken.new, added=taken.presses, present=taken.present, estimates=taken.estimates
    )
    differing = f"; {count_of(taken.differing, 'press')} here differ from it and stay" if taken.differing else ""
    return f"Taken in as {words}{differing}."
