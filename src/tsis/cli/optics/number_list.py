"""Several numbers in one option."""

from __future__ import annotations

from tsis.model.errors import InputError


def numbers(name: str, text: str) -> list[float]:
    """Read what was given to the option ``name``: numbers with commas between."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise InputError(f"{name} must be numbers with commas between, as 1.41,1.515; got {text!r}") from error
