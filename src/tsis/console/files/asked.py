"""What an address names."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from tsis.console.statuses import AbsentError
from tsis.instrument.naming import LARGEST_TARGET
from tsis.model.check import require_one_of
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from tsis.records import Store, StoredPress, Target

MOST_DIGITS = 20  # that are turned into a number at all


def target_of(store: Store, text: str) -> Target:
    """The target whose number stands in an address; `AbsentError` when there is none."""
    if not (text.isascii() and text.isdigit() and len(text) <= MOST_DIGITS):
        raise AbsentError(f"target must be a number from 1 to {LARGEST_TARGET}; got {text!r:.40}")
    with _in_the_address():
        return store.target(int(text))


def press_of(store: Store, target: str, press: str) -> StoredPress:
    """The press whose identity stands in an address; `AbsentError` when there is none."""
    found = target_of(store, target)
    with _in_the_address():
        return store.press(found, press)


def form_of(name: str, text: str, forms: Collection[str]) -> str:
    """The form that stands in an address; `AbsentError` when there is none of that name."""
    with _in_the_address():
        return require_one_of(name, text, forms)


@contextmanager
def _in_the_address() -> Iterator[None]:
    """What an address names wrongly is not there."""
    try:
        yield
    except InputError as error:
        raise AbsentError(str(error)) from error
