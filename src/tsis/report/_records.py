"""Messages, tables and documents on recomputations, verifications and imports."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from tsis.files import free_to_json
from tsis.report._page import Table
from tsis.report.target import count_of

if TYPE_CHECKING:
    from tsis.records import Recomputation, Target
    from tsis.records.store import ImportedTarget, StoreVerification


SHORT = 8  # shown digits of an identity


def recomputation_notes(recomputation: Recomputation) -> tuple[str, ...]:
    """Notes beside the main message of a recomputation."""
    messages = [f"Note: {note}." for note in recomputation.notes]
    for what, flags in (("gained", recomputation.flags_gained), ("lost", recomputation.flags_lost)):
        if flags:
            messages.append(f"Flags {what}: {', '.join(flags)}.")
    if recomputation.before.estimate.trusted != recomputation.after.estimate.trusted:
        messages.append(f"It is {'now' if recomputation.after.estimate.trusted else 'no longer'} to be trusted.")
    return tuple(messages)


def recomputation_message(recomputation: Recomputation) -> str:
    """Where the new estimate is stored; empty where nothing changed."""
    if recomputation.stored:
        return f"Stored as {recomputation.after.id[:SHORT]}."
    return "" if recomputation.same else "Nothing was stored: this was a dry run."


def shift_table(recomputation: Recomputation) -> Table:
    """The shift of each parameter."""
    headings = ("", "before", "after", "moved (old sd)", "90 % interval before", "90 % interval after")
    rows: list[tuple[str, ...]] = []
    for shift in recomputation.shifts:
        (low, high), (now_low, now_high) = shift.interval_before, shift.interval_after
        means = (_text(shift.before), _text(shift.after), _text(shift.moved, "+.2g"))
        rows.append((shift.name, *means, f"{low:.3g} to {high:.3g}", f"{now_low:.3g} to {now_high:.3g}"))
    return Table(title="What moved", headings=headings, rows=tuple(rows))


def _text(value: float | None, form: str = ".3g") -> str:
    return "not identified" if value is None else format(value, form)


def recomputation_document(target: Target, recomputation: Recomputation) -> dict[str, Any]:
    """A recomputation as a JSON document."""
    return {
        "target": target.number,
        "kind": recomputation.before.kind,
        "same": recomputation.same,
        "sentence": recomputation.message,
        "causes": list(recomputation.causes),
        "notes": list(recomputation.notes),
        "shifts": [free_to_json(asdict(shift), "shift") for shift in recomputation.shifts],
        "flags_gained": list(recomputation.flags_gained),
        "flags_lost": list(recomputation.flags_lost),
        "trusted": {"before": recomputation.before.estimate.trusted, "after": recomputation.after.estimate.trusted},
        "before": recomputation.before.id,
        "stored_as": recomputation.after.id if recomputation.stored else None,
    }


def verdict(store_verification: StoreVerification) -> str:
    """Whether the store is sound."""
    fault = f"NOT as it was stored: {count_of(len(store_verification.faults), 'fault')}"
    state = "as it was stored" if store_verification.sound else fault
    return f"The store is {state}: {store_verification.rows} rows and {store_verification.files} files were read."


def verification_notes(store_verification: StoreVerification) -> tuple[str, ...]:
    """Notes on a store beside its faults."""
    messages = [f"Note: {note}." for note in store_verification.notes]
    if store_verification.unnamed:
        messages.append(
            f"{store_verification.unnamed} files belong to saves that were cut short; nobody was told they were kept."
        )
    if store_verification.unanchored:
        messages.append(
            f"The anchor does not vouch for the last {store_verification.unanchored} entries of the audit; the next "
            "record brings it up to date."
        )
    return (*messages, f"Audit: entry {store_verification.head.number}, {store_verification.head.hash}")


def store_verification_document(store_verification: StoreVerification) -> dict[str, Any]:
    """A verification as a JSON document."""
    return {
        "sound": store_verification.sound,
        "faults": list(store_verification.faults),
        "notes": list(store_verification.notes),
        "audit": {"number": store_verification.head.number, "hash": store_verification.head.hash},
        "rows": store_verification.rows,
        "files": store_verification.files,
        "unnamed": store_verification.unnamed,
        "unanchored": store_verification.unanchored,
    }


def entered_text(target: Target, *, new: bool, added: int, present: int, estimates: int) -> str:
    """The target of imported presses, and how many are new."""
    parts = [f"{count_of(added, 'press')} added"]
    parts += [f"{present} there already"] if present else []
    parts += [f"{count_of(estimates, 'estimate')} added"] if estimates else []
    return f"target {target.number}{' (new)' if new else ''}; {', '.join(parts)}"


def import_message(taken: ImportedTarget) -> str:
    """Result of the import of a bundle."""
    text = entered_text(
        taken.target, new=taken.new, added=taken.presses, present=taken.present, estimates=taken.estimates
    )
    differing = f"; {count_of(taken.differing, 'press')} here differ from it and stay" if taken.differing else ""
    return f"Taken in as {text}{differing}."
