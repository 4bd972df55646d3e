"""Targets, presses and estimates as plain values for JSON, and back, exactly; samples are kept apart (`samples`).

Times keep their offset from UTC, numbers every bit.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from tsis.errors import InputError
from tsis.model import Estimate
from tsis.records._plain_fields import (
    absent,
    at_least_one,
    free_of_plain,
    free_to_plain,
    mapping,
    moment,
    number,
    numbers,
    pair,
    require_fields,
    spread,
    text,
    texts,
    truth_value,
    whole,
)
from tsis.records._values import StoredEstimate, StoredPress, Target

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray


def target_to_plain(target: Target) -> dict[str, Any]:
    """What JSON can hold of a target.

    Examples
    --------
    >>> from datetime import UTC, datetime
    >>> plain = target_to_plain(Target(number=3, kind="phantom", made=datetime(2026, 11, 22, tzinfo=UTC)))
    >>> plain["made"], target_of_plain(plain).number
    ('2026-11-22T00:00:00+00:00', 3)
    """
    return {
        "number": int(target.number),
        "kind": target.kind,
        "name": target.name,
        "note": target.note,
        "truth": {name: float(value) for name, value in target.truth.items()},
        "made": target.made.isoformat(),
        "id": target.id,
        "version": int(target.version),
    }


def target_of_plain(document: Any, where: str = "target") -> Target:
    """The target that `target_to_plain` made ``document`` of; ``where`` names it in errors.

    Raises
    ------
    InputError
        When it is no target.
    """
    result = require_fields(Target, document, where)
    return Target(
        number=whole(result, "number", where),
        kind=text(result, "kind", where),
        name=text(result, "name", where),
        note=text(result, "note", where),
        truth=numbers(result, "truth", where),
        made=moment(result, "made", where),
        id=text(result, "id", where),
        version=at_least_one(result, "version", where),
    )


def press_to_plain(press: StoredPress) -> dict[str, Any]:
    """What JSON can hold of a press.

    Raises
    ------
    InputError
        When its settings hold something that is neither a number, text, nor lists and mappings of them.
    """
    return {
        "role": press.role,
        "taken": press.taken.isoformat(),
        "frame": press.frame,
        "rows": int(press.rows),
        "columns": int(press.columns),
        "full_scale": float(press.full_scale),
        "force_n": None if press.force_n is None else float(press.force_n),
        "mm_per_pixel": None if press.mm_per_pixel is None else [float(item) for item in press.mm_per_pixel],
        "axis_px": [float(item) for item in press.axis_px],
        "probe": press.probe,
        "calibration": press.calibration,
        "flags": list(press.flags),
        "settings": free_to_plain(press.settings, "settings"),
        "name": press.name,
        "note": press.note,
        "id": press.id,
        "target": press.target,
        "version": int(press.version),
    }


def press_of_plain(document: Any, where: str = "press") -> StoredPress:
    """The press that `press_to_plain` made ``document`` of; ``where`` names it in errors.

    Raises
    ------
    InputError
        When it is no press.
    """
    result = require_fields(StoredPress, document, where)
    return StoredPress(
        role=text(result, "role", where),
        taken=moment(result, "taken", where),
        frame=text(result, "frame", where),
        rows=at_least_one(result, "rows", where),
        columns=at_least_one(result, "columns", where),
        full_scale=number(result, "full_scale", where),
        force_n=absent(number, result, "force_n", where),
        mm_per_pixel=absent(pair, result, "mm_per_pixel", where),
        axis_px=pair(result, "axis_px", where),
        probe=text(result, "probe", where),
        calibration=absent(text, result, "calibration", where),
        flags=texts(result, "flags", where),
        settings=_free(result, "settings", where),
        name=text(result, "name", where),
        note=text(result, "note", where),
        id=text(result, "id", where),
        target=text(result, "target", where),
        version=at_least_one(result, "version", where),
    )


def estimate_to_plain(stored: StoredEstimate) -> dict[str, Any]:
    """What JSON can hold of a stored estimate, its samples left out: `samples_bytes` holds those.

    Raises
    ------
    InputError
        When its options, environment or provenance hold what is no plain value.
    """
    result = stored.estimate
    return {
        "kind": stored.kind,
        "made": stored.made.isoformat(),
        "probe": stored.probe,
        "presses": list(stored.presses),
        "calibration": stored.calibration,
        "options": free_to_plain(stored.options, "options"),
        "environment": free_to_plain(stored.environment, "environment"),
        "supersedes": stored.supersedes,
        "id": stored.id,
        "target": stored.target,
        "estimate": {
            "prior_sd": {name: float(sd) for name, sd in result.prior_sd.items()},
            "cramer_rao_sd": {
                name: float(sd) if math.isfinite(sd) else "infinity" for name, sd in result.cramer_rao_sd.items()
            },
            "presence": None if result.presence is None else float(result.presence),
            "identifiability": result.identifiability,
            "prior": result.prior,
            "trusted": result.trusted,
            "flags": list(result.flags),
            "notes": list(result.notes),
            "provenance": free_to_plain(result.provenance, "provenance"),
        }
        # Estimates of before there was one must read and hash as they did.
        | ({} if result.log_bayes_factor is None else {"log_bayes_factor": float(result.log_bayes_factor)}),
    }


def estimate_of_plain(
    document: Any, samples: Mapping[str, NDArray[np.float64]], where: str = "estimate"
) -> StoredEstimate:
    """The stored estimate that `estimate_to_plain` made ``document`` of, with its samples: name -> shape (n,).

    Raises
    ------
    InputError
        When it is no estimate, or not of these samples.
    """
    result = require_fields(StoredEstimate, document, where)
    return StoredEstimate(
        kind=text(result, "kind", where),
        estimate=_estimate(result["estimate"], samples, f"{where}.estimate"),
        made=moment(result, "made", where),
        probe=text(result, "probe", where),
        presses=texts(result, "presses", where),
        calibration=text(result, "calibration", where),
        options=_free(result, "options", where),
        environment=_free(result, "environment", where),
        supersedes=absent(text, result, "supersedes", where),
        id=text(result, "id", where),
        target=text(result, "target", where),
    )


def _estimate(document: Any, samples: Mapping[str, NDArray[np.float64]], where: str) -> Estimate:
    evidence = document.get("log_bayes_factor") if isinstance(document, dict) else None
    without = ("samples",) if evidence is not None else ("samples", "log_bayes_factor")
    result = require_fields(Estimate, document, where, without=without)
    return Estimate(
        samples=samples,
        prior_sd=numbers(result, "prior_sd", where),
        cramer_rao_sd=mapping(result, "cramer_rao_sd", where, spread),
        presence=absent(number, result, "presence", where),
        log_bayes_factor=None if evidence is None else number(result, "log_bayes_factor", where),
        identifiability=text(result, "identifiability", where),
        prior=text(result, "prior", where),
        trusted=truth_value(result, "trusted", where),
        flags=texts(result, "flags", where),
        notes=texts(result, "notes", where),
        provenance=_free(result, "provenance", where),
    )


def _free(document: Mapping[str, Any], name: str, where: str) -> dict[str, Any]:
    value = free_of_plain(document[name], f"{where}.{name}")
    if not isinstance(value, dict):
        raise InputError(f"{where}.{name} must be a mapping; got {value!r:.80}")
    return value
