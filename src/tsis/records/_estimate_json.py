"""A stored estimate as JSON values, and back; its samples have a file of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.errors import InputError
from tsis.files import from_json_value, to_json_value
from tsis.inclusion import presence_caveats
from tsis.model import ABSENCE_FLAG
from tsis.records._values import StoredEstimate

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray


LATER = ("log_bayes_factor", "presence_trusted")  # fields that the first estimates did not have


def estimate_to_json(stored: StoredEstimate) -> dict[str, Any]:
    """JSON values of a stored estimate without its samples, which `samples_bytes` writes.

    Raises
    ------
    InputError
        When its options, environment or provenance have no JSON form.
    """
    estimate = stored.estimate
    prior_sd = {name: float(sd) for name, sd in estimate.prior_sd.items()}
    result = {"prior_sd": prior_sd} | to_json_value(estimate, without=("untrusted", *LATER))
    # Earlier estimates lack these; their hash must not change.
    if estimate.log_bayes_factor is not None:
        result["log_bayes_factor"] = float(estimate.log_bayes_factor)
    if estimate.presence_trusted != _presence_trusted(estimate.trusted, estimate.flags):
        result["presence_trusted"] = estimate.presence_trusted
    return to_json_value(stored, without=("estimate",)) | {"estimate": result}


def _presence_trusted(trusted: Any, flags: Any) -> Any:
    """Whether the presence of an estimate may be used that does not say so: "no inclusion" alone is an answer."""
    listed = flags if isinstance(flags, (list, tuple)) else ()  # whoever forged them is refused when they are read
    return trusted or (ABSENCE_FLAG in listed and not presence_caveats(map(str, listed)))


def estimate_from_json(
    document: Any, samples: Mapping[str, NDArray[np.float64]], where: str = "estimate"
) -> StoredEstimate:
    """The stored estimate that `estimate_to_json` wrote, with its samples: name -> shape (n,).

    `InputError` when ``document`` is no estimate or does not fit the samples; ``where`` names it in the message.
    """
    if isinstance(document, dict) and isinstance(result := document.get("estimate"), dict):
        if "samples" in result:
            raise InputError(f"{where}.estimate must hold no samples, which have a file of their own")
        later = {
            "log_bayes_factor": None,
            "presence_trusted": _presence_trusted(result.get("trusted"), result.get("flags")),
        }
        posterior = {"samples": dict(samples), "prior_sd": result.get("prior_sd")}
        others = {name: value for name, value in result.items() if name != "prior_sd"}
        document = document | {"estimate": later | others | {"untrusted": posterior}}
    return from_json_value(StoredEstimate, document, where, complete=True)
