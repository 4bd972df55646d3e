"""Results as plain values for a JSON file: the same names and units as in Python."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.model import INTERVAL_LEVEL

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.imaging import Contact, Features, RadialProfile
    from tsis.model import Estimate


NEARLY = 1e-3  # probabilities closer than this to 0 or 1 are not told apart from them
NOT_TRUSTED = "Diameter, depth and modulus are not to be trusted, for a reason named below."
NOT_SCALAR = ("profile", "patch")


def envelope(command: str, **content: Any) -> dict[str, Any]:
    """What every result file starts with."""
    return {"notice": RESEARCH_USE_ONLY, "tsis": __version__, "command": command, **content}


def estimate_document(estimate: Estimate, truth: Mapping[str, float] | None = None) -> dict[str, Any]:
    """An estimate, with the truth beside each parameter where it is known."""
    interval = estimate.interval(INTERVAL_LEVEL)
    parameters = {
        name: {
            "mean": estimate.mean[name],
            "sd": estimate.sd[name],
            "interval_90": list(interval[name]),
            "prior_sd": estimate.prior_sd[name],
            "narrowing": estimate.narrowing[name],
            "cramer_rao_sd": _finite(estimate.cramer_rao_sd.get(name)),
        }
        | ({} if truth is None else {"truth": truth[name]})
        for name in estimate.samples
    }
    return {
        "parameters": parameters,
        "presence": estimate.presence,
        "log_bayes_factor": estimate.log_bayes_factor,
        "identifiability": estimate.identifiability,
        "prior": estimate.prior,
        "trusted": estimate.trusted,
        "flags": list(estimate.flags),
        "notes": list(estimate.notes),
        "provenance": dict(estimate.provenance),
    }


def _finite(value: float | None) -> float | None:
    """JSON has no infinity: null says that nothing bounds it."""
    return value if value is not None and np.isfinite(value) else None


def withheld_reason(estimate: Estimate, name: str) -> str:
    """Why a parameter's mean should not be read as a number; empty when it may be."""
    if not estimate.trusted:
        return "not to be trusted"
    return "" if estimate.identified(name) else "not identified"


def estimate_messages(estimate: Estimate) -> tuple[str, ...]:
    """What a reader must know besides the numbers, the most important first."""
    message = (
        "" if estimate.presence is None else f"Probability of an inclusion: {probability_text(estimate.presence)}.",
        estimate.identifiability if estimate.trusted else NOT_TRUSTED,
        *estimate.notes,
        f"Prior: {estimate.prior}." if estimate.prior else "",
    )
    return tuple(message for message in message if message)


def probability_text(value: float) -> str:
    """A probability in words that does not claim certainty."""
    if value > 1 - NEARLY:
        return f"above {1 - NEARLY:g}"
    return f"below {NEARLY:g}" if value < NEARLY else f"{value:.3g}"


def sd_text(value: float) -> str:
    """A standard deviation to two digits, none of them as a power of ten until it is huge."""
    return f"{value:.0f}" if 99.5 <= value < 99_999 else f"{value:.2g}"


def features_document(features: Features, contact: Contact | None) -> dict[str, Any]:
    """Features of one image, and its round contact."""
    document = {item.name: getattr(features, item.name) for item in fields(features) if item.name not in NOT_SCALAR}
    document["round_contact"] = None if contact is None else asdict(contact)
    document["profile"] = None if features.profile is None else profile_document(features.profile)
    return document


def profile_document(profile: RadialProfile) -> dict[str, Any]:
    """A ring profile; rings without pixels hold null."""
    mean = [float(value) if np.isfinite(value) else None for value in profile.mean_grey]
    return {
        "radius_mm": profile.radius_mm.tolist(),
        "mean_grey": mean,
        "count": profile.count.tolist(),
        "clipped_count": profile.clipped_count.tolist(),
    }


def json_bytes(document: Mapping[str, Any]) -> bytes:
    """UTF-8 JSON that any parser reads: no NaN."""
    return (json.dumps(document, indent=2, allow_nan=False, default=_json_value) + "\n").encode()


def _json_value(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if hasattr(value, "__dataclass_fields__"):
        return asdict(value)
    return dict(value)  # read-only mappings
