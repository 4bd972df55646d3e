"""Texts of the page of a target, and the de-identified record of a subject for it."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from datetime import UTC
from typing import TYPE_CHECKING

from tsis.calibration.guard import GUARD_FLAGS
from tsis.report._hardness import estimate_messages_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import datetime

    from tsis.records import StoredEstimate, StoredPress, TargetRecord


IDENTITY_NOTE = (
    "Notes, settings, names of files, and probes and flags that tsis does not know are left out, since this is a "
    "subject: the page shows the pseudonym only."
)


def without_identity(record: TargetRecord) -> TargetRecord:
    """The record of a phantom, or the de-identified record of a subject with label, number and times."""
    if record.target.kind != "subject":
        return record
    from tsis.records import deidentified  # slow to import

    result = deidentified(record)
    presses = {press.id: f"press {number}" for number, press in enumerate(result.presses, 1)}
    estimates = {stored.id: f"estimate {number}" for number, stored in enumerate(result.estimates, 1)}
    return replace(
        result,
        target=replace(result.target, id="not told", name=record.target.name),
        presses=tuple(replace(press, id=presses[press.id]) for press in result.presses),
        estimates=tuple(_renamed(stored, presses, estimates) for stored in result.estimates),
    )


def _renamed(stored: StoredEstimate, presses: dict[str, str], estimates: dict[str, str]) -> StoredEstimate:
    return replace(
        stored,
        id=estimates[stored.id],
        supersedes=estimates.get(stored.supersedes, "another") if stored.supersedes else None,
        presses=tuple(presses.get(press, "another press") for press in stored.presses),
    )


MOST_NAMED = 12  # presses in a message
SHORT = 12  # shown digits of a SHA-256 or an identity


def time_text(when: datetime) -> str:
    """Text of a time in UTC."""
    return f"{when.astimezone(UTC):%Y-%m-%d %H:%M:%S}"


def count_of(number: int, what: str) -> str:
    """``"1 press"``, ``"2 presses"``."""
    plural = f"{what}es" if what.endswith("s") else f"{what}s"
    return f"{number} {what if number == 1 else plural}"


def roles(presses: Sequence[StoredPress]) -> str:
    """Number of presses of each role."""
    from tsis.records import ROLE_NAMES  # slow to import

    counts = Counter(press.role for press in presses)
    return ", ".join(f"{counts[role]} {text}" for role, text in ROLE_NAMES.items() if counts[role])


def newest_first(record: TargetRecord) -> tuple[StoredEstimate, ...]:
    """The active estimates, the newest first."""
    return tuple(sorted(record.active_estimates, key=lambda stored: stored.made, reverse=True))


def heading(record: TargetRecord, stored: StoredEstimate, title: str) -> str:
    """A title, with the kind of the estimate where there are several active ones."""
    return f"{title} ({stored.kind})" if len(record.active_estimates) > 1 else title


def target_notes(record: TargetRecord) -> tuple[str, ...]:
    """All messages, those of the active estimates first."""
    return (
        *_estimate_notes(record),
        *_flag_notes(record),
        *_gap_notes(record),
        *(f"Left out: {message}." for message in record.damaged),
        *((f"Note: {record.target.note}",) if record.target.note else ()),
        *((IDENTITY_NOTE,) if record.target.kind == "subject" else ()),
    )


def _estimate_notes(record: TargetRecord) -> tuple[str, ...]:
    result = newest_first(record)
    if not result:
        return ("Nothing was estimated from these presses yet.",) if record.presses else ("Nothing was recorded yet.",)
    messages = []
    for stored in result:
        reported = (*estimate_messages_of(stored), origin(stored), *_coverage(record, stored))
        messages += [f"Of the {stored.kind}: {message}" if len(result) > 1 else message for message in reported]
    return tuple(messages)


def origin(stored: StoredEstimate) -> str:
    """Inputs, time and code of an estimate."""
    version = f"tsis {stored.environment['tsis']}" if "tsis" in stored.environment else "an unknown version of tsis"
    again = f" It takes the place of {stored.supersedes[:SHORT]}." if stored.supersedes else ""
    return (
        f"Estimated {time_text(stored.made)} UTC by {version} from {count_of(len(stored.presses), 'press')} of probe "
        f"{stored.probe or 'not named'} with calibration {stored.calibration[:SHORT]}.{again}"
    )


def _coverage(record: TargetRecord, stored: StoredEstimate) -> tuple[str, ...]:
    given = {press.id for press in record.presses}
    left, gone = len(given.difference(stored.presses)), len(set(stored.presses).difference(given))
    message = [f"The estimate does not rest on {count_of(left, 'other press')} of this target."] if left else []
    if gone:
        message.append(f"The store no longer shows {count_of(gone, 'press')} that the estimate rests on.")
    return tuple(message)


def _flag_notes(record: TargetRecord) -> tuple[str, ...]:
    """A message for each flag of the press guard, with its presses and its meaning."""
    raised: dict[str, list[int]] = {}
    for number, press in enumerate(record.presses, 1):
        for flag in press.flags:
            raised.setdefault(flag, []).append(number)
    return tuple(
        f"{_numbered(numbers)} flagged {flag}: "
        f"{GUARD_FLAGS[flag].means if flag in GUARD_FLAGS else 'no flag of the press guard; somebody wrote it down'}."
        for flag, numbers in raised.items()
    )


def _gap_notes(record: TargetRecord) -> tuple[str, ...]:
    """Messages on missing measurements."""
    numbered = list(enumerate(record.presses, 1))
    pressed = [(number, press) for number, press in numbered if press.role != "untouched"]
    gaps = {
        "without a measured force": [number for number, press in pressed if press.force_n is None],
        "without a scale, so that lengths are in pixels": [n for n, press in numbered if press.mm_per_pixel is None],
        "without a calibration": [number for number, press in numbered if press.calibration is None],
    }
    return tuple(f"{_numbered(numbers)} {what}." for what, numbers in gaps.items() if numbers)


def _numbered(numbers: Sequence[int]) -> str:
    if len(numbers) == 1:
        return f"Press {numbers[0]} is"
    if len(numbers) > MOST_NAMED:
        return f"{len(numbers)} presses, the first of them {numbers[0]}, are"
    return f"Presses {', '.join(map(str, numbers[:-1]))} and {numbers[-1]} are"
