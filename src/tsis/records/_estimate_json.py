"""A stored estimate as JSON values, and back; its samples have a file of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.errors import InputError
from tsis.files import from_json_value, to_json_value
from tsis.records._values import StoredEstimate

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray


def estimate_to_json(stored: StoredEstimate) -> dict[str, Any]:
    """JSON values of a stored estimate without its samples, which `samples_bytes` writes.

    Raises
    ------
    InputError
        When its options, environment or provenance have no JSON form.
    """
    result = to_json_value(stored.estimate, without=("samples", "log_bayes_factor"))
    if stored.estimate.log_bayes_factor is not None:  # earlier estimates lack it; their hash must not change
        result["log_bayes_factor"] = float(stored.estimate.log_bayes_factor)
    return to_json_value(stored, without=("estimate",)) | {"estimate": result}


def estimate_from_json(
    document: Any, samples: Mapping[str, NDArray[np.float64]], where: str = "estimate"
) -> StoredEstimate:
    """The stored estimate that `estimate_to_json` wrote, with its samples: name -> shape (n,).

    `InputError` when ``document`` is no estimate or does not fit the samples; ``where`` names it in the message.
    """
    if isinstance(document, dict) and isinstance(result := document.get("estimate"), dict):
        if "samples" in result:
            raise InputError(f"{where}.estimate must hold no samples, which have a file of their own")
        document = document | {"estimate": {"log_bayes_factor": None} | result | {"samples": dict(samples)}}
    return from_json_value(StoredEstimate, document, where, complete=True)
