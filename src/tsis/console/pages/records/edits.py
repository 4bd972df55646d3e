"""A change of a record as it was read, and what is there instead when somebody else was faster."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from tsis.model.errors import StaleRecordError
from tsis.records.editing import EDITABLE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.records import Store, StoredPress, Target

MOST_SHOWN = 120  # letters of a value
Record = TypeVar("Record")


@dataclass(frozen=True, slots=True, kw_only=True)
class Edited(Generic[Record]):
    """What became of a change.

    Attributes
    ----------
    record
        As it is stored now, with the change or with that of somebody else.
    refused
        Why it was not changed; empty when it was.
    differences
        One sentence for each field that somebody else has changed.
    """

    record: Record
    refused: str = ""
    differences: tuple[str, ...] = ()


def edit_target(store: Store, target: Target, changes: Mapping[str, Any]) -> Edited[Target]:
    """Change a target as it was read; errors as `tsis.records.Store.edit_target`, but for that of being late."""
    try:
        return Edited(record=store.edit_target(target, **changes))
    except StaleRecordError as error:
        now = store.target(target.number)
        return Edited(record=now, refused=str(error), differences=differences(target, now, EDITABLE["target"]))


def edit_press(store: Store, target: Target, press: StoredPress, changes: Mapping[str, Any]) -> Edited[StoredPress]:
    """Change a press as it was read; errors as `edit_target`."""
    try:
        return Edited(record=store.edit_press(press, **changes))
    except StaleRecordError as error:
        now = store.press(target, press.id)
        return Edited(record=now, refused=str(error), differences=differences(press, now, EDITABLE["press"]))


def differences(before: object, now: object, names: tuple[str, ...]) -> tuple[str, ...]:
    """What was changed between two versions of a record, one sentence a field."""
    changed = ((name, getattr(before, name), getattr(now, name)) for name in names)
    return tuple(f"{_words(name)}: was {_said(was)}, is {_said(new)} now." for name, was, new in changed if was != new)


def changed(record: object, wanted: Mapping[str, Any]) -> dict[str, Any]:
    """Those of the wanted values that a record does not have already."""
    return {name: value for name, value in wanted.items() if getattr(record, name) != value}


def _words(name: str) -> str:
    return {"force_n": "Force"}.get(name, name.capitalize())


def _said(value: Any) -> str:
    if value is None:
        return "not measured"
    if isinstance(value, tuple):
        value = ", ".join(value)
    elif not isinstance(value, (str, float)):
        value = truth_text(value).replace("\n", ", ")
    text = f"{value:g} N" if isinstance(value, float) else value
    return f"“{text[:MOST_SHOWN]}”" if text else "empty"


def truth_text(truth: Mapping[str, float]) -> str:
    """True values as people write them, one on a line; read again they are the same to the last digit."""
    return "\n".join(f"{name}={number_text(value)}" for name, value in truth.items())


def number_text(value: float) -> str:
    """A number with all its digits, and no more."""
    return repr(value).removesuffix(".0")
