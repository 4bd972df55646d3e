"""Targets, presses and estimates as JSON values, and back; samples of an estimate have a file of their own.

Times keep their offset from UTC, numbers every bit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.errors import InputError
from tsis.files import from_plain, to_plain
from tsis.records._values import StoredEstimate, StoredPress, Target

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray


def target_to_plain(target: Target) -> dict[str, Any]:
    """JSON values of a target.

    Examples
    --------
    >>> from datetime import UTC, datetime
    >>> plain = target_to_plain(Target(number=3, kind="phantom", made=datetime(2026, 11, 22, tzinfo=UTC)))
    >>> plain["made"], target_of_plain(plain).number
    ('2026-11-22T00:00:00+00:00', 3)
    """
    return to_plain(target)


def target_of_plain(document: Any, where: str = "target") -> Target:
    """The target of which `target_to_plain` made ``document``; ``where`` names it in errors.

    Raises
    ------
    InputError
        When it is no target.
    """
    return from_plain(Target, document, where, complete=True)


def press_to_plain(press: StoredPress) -> dict[str, Any]:
    """JSON values of a press.

    Raises
    ------
    InputError
        When its settings contain something that is neither a number, text, nor lists and mappings of them.
    """
    return to_plain(press)


def press_of_plain(document: Any, where: str = "press") -> StoredPress:
    """The press of which `press_to_plain` made ``document``; ``where`` names it in errors.

    Raises
    ------
    InputError
        When it is no press.
    """
    return from_plain(StoredPress, document, where, complete=True)


def estimate_to_plain(stored: StoredEstimate) -> dict[str, Any]:
    """JSON values of a stored estimate without its samples, which `samples_bytes` writes.

    Raises
    ------
    InputError
        When its options, environment or provenance have no JSON form.
    """
    result = to_plain(stored.estimate, without=("samples", "log_bayes_factor"))
    if stored.estimate.log_bayes_factor is not None:  # stored estimates without it must read and hash as they did
        result["log_bayes_factor"] = float(stored.estimate.log_bayes_factor)
    return to_plain(stored, without=("estimate",)) | {"estimate": result}


def estimate_of_plain(
    document: Any, samples: Mapping[str, NDArray[np.float64]], where: str = "estimate"
) -> StoredEstimate:
    """The stored estimate of which `estimate_to_plain` made ``document``, with its samples: name -> shape (n,).

    Raises
    ------
    InputError
        When it is no estimate, or not of these samples.
    """
    if isinstance(document, dict) and isinstance(result := document.get("estimate"), dict):
        if "samples" in result:
            raise InputError(f"{where}.estimate must hold no samples, which have a file of their own")
        document = document | {"estimate": {"log_bayes_factor": None} | result | {"samples": dict(samples)}}
    return from_plain(StoredEstimate, document, where, complete=True)
