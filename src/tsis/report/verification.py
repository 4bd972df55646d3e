"""What was found when a store was compared with its audit: sentences, plain values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.report.target_words import count_of

if TYPE_CHECKING:
    from tsis.records.verification import StoreVerification


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
