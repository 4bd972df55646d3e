"""What is wrong with a field, in the words that stand beside it and not in those of the program."""

from __future__ import annotations

import re
from contextlib import contextmanager
from typing import TYPE_CHECKING

from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

FORCE = {"force_n": "force"}


def in_words(sentence: str, words: Mapping[str, str]) -> str:
    """A sentence with a page's words for the parameters that it names.

    Examples
    --------
    >>> in_words("radius_mm must lie in [1, 50]; got 0 (millimetres)", {"radius_mm": "radius of the object"})
    'radius of the object must lie in [1, 50]; got 0 (millimetres)'
    """
    return re.sub(r"\w+", lambda found: words.get(found[0], found[0]), sentence)


@contextmanager
def field_words(words: Mapping[str, str]) -> Iterator[None]:
    """Say an `InputError` about these parameters in these words."""
    try:
        yield
    except InputError as error:
        raise InputError(in_words(str(error), words)) from error
