"""What became of an estimate that was made again: sentences, a table, plain values."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from tsis.report._page import Table
from tsis.report.target import count_of

if TYPE_CHECKING:
    from tsis.records import Recomputation, Target
    from tsis.records.store import ImportedTarget, StoreVerification


SHORT = 8  # letters of an identity that tell it from others


def recomputation_notes(found: Recomputation) -> tuple[str, ...]:
    """What to know besides the sentence that says whether it came out the same."""
    said = [f"Note: {note}." for note in found.notes]
    for what, flags in (("gained", found.flags_gained), ("lost", found.flags_lost)):
        if flags:
            said.append(f"Flags {what}: {', '.join(flags)}.")
    if found.before.estimate.trusted != found.after.estimate.trusted:
        said.append(f"It is {'now' if found.after.estimate.trusted else 'no longer'} to be trusted.")
    return tuple(said)


def stored_sentence(found: Recomputation) -> str:
    """Where the new estimate is; empty where it is the old one."""
    if found.same:
        return ""
    return f"Stored as {found.after.id[:SHORT]}." if found.stored else "Nothing was stored: this was a dry run."


def shift_table(found: Recomputation) -> Table:
    """How far each parameter moved."""
    headings = ("", "before", "after", "moved (old sd)", "90 % interval before", "90 % interval after")
    return Table(title="What moved", headings=headings, rows=tuple(_shift_rows(found)))


def _shift_rows(found: Recomputation) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for shift in found.shifts:
        (low, high), (now_low, now_high) = shift.interval_before, shift.interval_after
        means = (f"{shift.before:.3g}", f"{shift.after:.3g}", f"{shift.moved:+.2g}")
        rows.append((shift.name, *means, f"{low:.3g} to {high:.3g}", f"{now_low:.3g} to {now_high:.3g}"))
    return rows


def recomputation_document(target: Target, found: Recomputation) -> dict[str, Any]:
    """The same as plain values for JSON."""
    from tsis.records import free_to_plain  # loads the libraries of records, which have loaded by then

    return {
        "target": target.number,
        "kind": found.before.kind,
        "same": found.same,
        "sentence": found.sentence,
        "causes": list(found.causes),
        "notes": list(found.notes),
        "shifts": [free_to_plain(asdict(shift), "shift") for shift in found.shifts],  # moved by so many old sd
        "flags_gained": list(found.flags_gained),
        "flags_lost": list(found.flags_lost),
        "trusted": {"before": found.before.estimate.trusted, "after": found.after.estimate.trusted},
        "before": found.before.id,
        "stored_as": found.after.id if found.stored else None,
    }


def verdict(found: StoreVerification) -> str:
    """Whether the store can be believed."""
    state = "as it was stored" if found.sound else f"NOT as it was stored: {count_of(len(found.faults), 'fault')}"
    return f"The store is {state}: {found.rows} rows and {found.files} files were read."


def verification_notes(found: StoreVerification) -> tuple[str, ...]:
    """What to know of a store besides its faults."""
    said = [f"Note: {note}." for note in found.notes]
    if found.unnamed:
        said.append(f"{found.unnamed} files belong to saves that were cut short; nobody was told they were kept.")
    if found.unanchored:
        said.append(
            f"The anchor does not vouch for the last {found.unanchored} entries of the audit; the next record brings "
            "it up to date."
        )
    return (*said, f"Audit: entry {found.head.number}, {found.head.hash}")


def store_verification_document(found: StoreVerification) -> dict[str, Any]:
    """The same as plain values for JSON."""
    return {
        "sound": found.sound,
        "faults": list(found.faults),
        "notes": list(found.notes),
        "audit": {"number": found.head.number, "hash": found.head.hash},
        "rows": found.rows,
        "files": found.files,
        "unnamed": found.unnamed,
        "unanchored": found.unanchored,
    }


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
