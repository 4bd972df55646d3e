"""Results as JSON documents, with the names and units of Python."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.files.result_schemas import RESULT_SCHEMAS
from tsis.model.estimate import INTERVAL_LEVEL, probability_text

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.imaging import Features
    from tsis.imaging.contact import Contact
    from tsis.imaging.profile import RadialProfile
    from tsis.inclusion.budget import UncertaintyBudget
    from tsis.model.budget import QuantityBudget
    from tsis.model.estimate import Estimate
    from tsis.records.values import StoredEstimate


NOT_SCALAR = ("profile", "patch")


def envelope(command: str, part: str = "", /, **content: Any) -> dict[str, Any]:
    """A JSON result: its schema with the version, the notice, the version of tsis and the command, then its content.

    ``part`` names the result of a command, such as ``"records list"``, that has several.

    Examples
    --------
    >>> envelope("records list", targets=[])["schema"]
    {'name': 'tsis-records-list', 'version': 1}
    """
    name = "-".join(["tsis", *command.split(), *([part] if part else [])])
    schema = {"name": name, "version": RESULT_SCHEMAS[name]}
    return {"schema": schema, "notice": RESEARCH_USE_ONLY, "tsis": __version__, "command": command, **content}


def estimate_document(estimate: Estimate, truth: Mapping[str, float] | None = None) -> dict[str, Any]:
    """An estimate as a JSON document, with the truth of each parameter where known."""
    parameters = {
        name: _parameter(estimate, name) | ({} if truth is None else {"truth": truth[name]}) for name in estimate.names
    }
    return {
        "parameters": parameters,
        "presence": estimate.printed_presence,
        "presence_trusted": estimate.presence_trusted,
        "log_bayes_factor": estimate.log_bayes_factor if estimate.presence_trusted else None,
        "identifiability": estimate.printed_identifiability,
        "prior": estimate.prior,
        "trusted": estimate.trusted,
        "flags": list(estimate.flags),
        "notes": list(estimate.printed_notes),
        "provenance": dict(estimate.provenance),
    }


def stored_document(stored: StoredEstimate, truth: Mapping[str, float]) -> dict[str, Any]:
    """A stored estimate as a JSON document, with the truth beside its parameters where all of them are known."""
    from tsis.records.values import estimate_to_json  # loads the libraries of records

    fields = estimate_to_json(stored)
    provenance = fields.pop("estimate")["provenance"]
    known = truth if set(stored.estimate.names) <= set(truth) else None
    return {**fields, **estimate_document(stored.estimate, known), "provenance": provenance}


def budget_document(budget: UncertaintyBudget, forces: Mapping[str, QuantityBudget]) -> dict[str, Any]:
    """Uncertainty budgets of an estimate's parameters and of the ``forces`` by the name of the frame."""
    return {
        "parameters": {name: _quantity(quantity) for name, quantity in budget.quantities.items()},
        "withheld": budget.withheld,
        "forces": [{"image": name, **_quantity(quantity)} for name, quantity in forces.items()],
    }


def _quantity(budget: QuantityBudget) -> dict[str, Any]:
    freedom = budget.degrees_of_freedom
    return {
        "value": budget.value,
        "unit": budget.unit,
        "combined": budget.combined,
        "degrees_of_freedom": freedom if np.isfinite(freedom) else None,
        "coverage_factor": budget.coverage_factor,
        "expanded": budget.expanded,
        "sampled_sd": budget.sampled_sd,
        "departure": budget.departure,
        "components": [
            {**asdict(component), "sensitivity": component.sensitivity, "fraction": budget.fraction(component)}
            for component in budget.components
        ],
    }


def _parameter(estimate: Estimate, name: str) -> dict[str, Any]:
    """The numbers of a parameter; a withheld one is None, and ``withheld`` says why."""
    withheld = estimate.withheld_reason(name)
    numbers: dict[str, Any] = {
        "withheld": withheld or None,
        "mean": None if withheld else estimate.mean[name],
        "sd": None if withheld else estimate.sd[name],
        "prior_sd": estimate.prior_sd[name],
        **dict.fromkeys(("interval_90", "narrowing", "cramer_rao_sd")),
    }
    if estimate.trusted:
        numbers["interval_90"] = list(estimate.interval(INTERVAL_LEVEL)[name])
        numbers["narrowing"] = estimate.narrowing[name]
        numbers["cramer_rao_sd"] = _finite(estimate.cramer_rao_sd.get(name))
    return numbers


def _finite(value: float | None) -> float | None:
    """The value, or None for an infinite one, which JSON lacks."""
    return value if value is not None and np.isfinite(value) else None


def estimate_messages(estimate: Estimate) -> tuple[str, ...]:
    """Messages on an estimate, the most important first."""
    messages = (
        _presence_message(estimate),
        estimate.printed_identifiability,
        *estimate.printed_notes,
        f"Prior: {estimate.prior}." if estimate.prior else "",
    )
    return tuple(message for message in messages if message)


def _presence_message(estimate: Estimate) -> str:
    if estimate.presence is None:
        return ""
    if not estimate.presence_trusted:
        return "The probability of an inclusion is not to be trusted."
    return f"Probability of an inclusion: {probability_text(estimate.presence)}."


def sd_text(value: float) -> str:
    """A standard deviation to two digits, without an exponent below 99999."""
    return f"{value:.0f}" if 99.5 <= value < 99_999 else f"{value:.2g}"


def features_document(features: Features, contact: Contact | None) -> dict[str, Any]:
    """Features of an image and its round contact as a JSON document."""
    document = {item.name: getattr(features, item.name) for item in fields(features) if item.name not in NOT_SCALAR}
    document["round_contact"] = None if contact is None else asdict(contact)
    document["profile"] = None if features.profile is None else profile_document(features.profile)
    return document


def profile_document(profile: RadialProfile) -> dict[str, Any]:
    """A ring profile as a JSON document; null for rings without pixels."""
    mean = [float(value) if np.isfinite(value) else None for value in profile.mean_grey]
    return {
        "radius_mm": profile.radius_mm.tolist(),
        "mean_grey": mean,
        "count": profile.count.tolist(),
        "clipped_count": profile.clipped_count.tolist(),
    }
