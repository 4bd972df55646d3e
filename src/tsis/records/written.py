"""What people write of a record, as values."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.model.check import require_number
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable

LARGEST_FORCE_N = 100.0


def parse_truth(lines: Iterable[str], *, called: str = "truth") -> dict[str, float]:
    """True values of a phantom, each written as ``diameter_mm=10``.

    Raises
    ------
    InputError
        When one is no name with a number; the message says what it is ``called``.

    Examples
    --------
    >>> parse_truth(["diameter_mm=10", "depth_mm = 4.5"])
    {'diameter_mm': 10.0, 'depth_mm': 4.5}
    """
    found: dict[str, float] = {}
    for each in lines:
        name, _, value = each.partition("=")
        try:
            found[name.strip()] = float(value)
        except ValueError as error:
            raise InputError(f"{called} must be a name and a number as diameter_mm=10; got {each!r:.60}") from error
    return found


def parse_force(text: str, *, called: str = "force_n", nothing: str = "none") -> float | None:
    """A force in newtons in [0, 100]; None where ``nothing`` is written, for nobody knows it.

    Raises
    ------
    InputError
        When it is neither.

    Examples
    --------
    >>> parse_force("0.72"), parse_force("none")
    (0.72, None)
    """
    if text == nothing:
        return None
    try:
        value = float(text)
    except ValueError as error:
        instead = nothing or "nothing"
        raise InputError(f"{called} must be a number of newtons, or {instead}; got {text!r:.40}") from error
    return require_number(called, value, 0.0, LARGEST_FORCE_N)
