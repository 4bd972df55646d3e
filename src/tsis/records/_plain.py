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


def target_of_plain(plain: Any, where: str = "target") -> Target:
    """The target that `target_to_plain` made ``plain`` of; ``where`` names it in errors.

    Raises
    ------
    InputError
        When it is no target.
    """
    found = require_fields(Target, plain, where)
    return Target(
        number=whole(found, "number", where),
        kind=text(found, "kind", where),
        name=text(found, "name", where),
        note=text(found, "note", where),
        truth=numbers(found, "truth", where),
        made=moment(found, "made", where),
        id=text(found, "id", where),
        version=at_least_one(found, "version", where),
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
        "mm_per_pixel": None if press.mm_per_pixel is None else [float(each) for each in press.mm_per_pixel],
        "axis_px": [float(each) for each in press.axis_px],
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


def press_of_plain(plain: Any, where: str = "press") -> StoredPress:
    """The press that `press_to_plain` made ``plain`` of; ``where`` names it in errors.

    Raises
    ------
    InputError
        When it is no press.
    """
    found = require_fields(StoredPress, plain, where)
    return StoredPress(
        role=text(found, "role", where),
        taken=moment(found, "taken", where),
        frame=text(found, "frame", where),
        rows=at_least_one(found, "rows", where),
        columns=at_least_one(found, "columns", where),
        full_scale=number(found, "full_scale", where),
        force_n=absent(number, found, "force_n", where),
        mm_per_pixel=absent(pair, found, "mm_per_pixel", where),
        axis_px=pair(found, "axis_px", where),
        probe=text(found, "probe", where),
        calibration=absent(text, found, "calibration", where),
        flags=texts(found, "flags", where),
        settings=_free(found, "settings", where),
        name=text(found, "name", where),
        note=text(found, "note", where),
        id=text(found, "id", where),
        target=text(found, "target", where),
        version=at_least_one(found, "version", where),
    )


def estimate_to_plain(stored: StoredEstimate) -> dict[str, Any]:
    """What JSON can hold of a stored estimate, its samples left out: `samples_bytes` holds those.

    Raises
    ------
    InputError
        When its options, environment or provenance hold what is no plain value.
    """
    found = stored.estimate
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
            "prior_sd": {name: float(sd) for name, sd in found.prior_sd.items()},
            "cramer_rao_sd": {
                name: float(sd) if math.isfinite(sd) else "infinity" for name, sd in found.cramer_rao_sd.items()
            },
            "presence": None if found.presence is None else float(found.presence),
            "identifiability": found.identifiability,
            "prior": found.prior,
            "trusted": found.trusted,
            "flags": list(found.flags),
            "notes": list(found.notes),
            "provenance": free_to_plain(found.provenance, "provenance"),
        }
        # Estimates of before there was one must read and hash as they did.
        | ({} if found.log_bayes_factor is None else {"log_bayes_factor": float(found.log_bayes_factor)}),
    }


def estimate_of_plain(
    plain: Any, samples: Mapping[str, NDArray[np.float64]], where: str = "estimate"
) -> StoredEstimate:
    """The stored estimate that `estimate_to_plain` made ``plain`` of, with its samples: name -> shape (n,).

    Raises
    ------
    InputError
        When it is no estimate, or not of these samples.
    """
    found = require_fields(StoredEstimate, plain, where)
    return StoredEstimate(
        kind=text(found, "kind", where),
        estimate=_estimate(found["estimate"], samples, f"{where}.estimate"),
        made=moment(found, "made", where),
        probe=text(found, "probe", where),
        presses=texts(found, "presses", where),
        calibration=text(found, "calibration", where),
        options=_free(found, "options", where),
        environment=_free(found, "environment", where),
        supersedes=absent(text, found, "supersedes", where),
        id=text(found, "id", where),
        target=text(found, "target", where),
    )


def _estimate(plain: Any, samples: Mapping[str, NDArray[np.float64]], where: str) -> Estimate:
    evidence = plain.get("log_bayes_factor") if isinstance(plain, dict) else None
    without = ("samples",) if evidence is not None else ("samples", "log_bayes_factor")
    found = require_fields(Estimate, plain, where, without=without)
    return Estimate(
        samples=samples,
        prior_sd=numbers(found, "prior_sd", where),
        cramer_rao_sd=mapping(found, "cramer_rao_sd", where, spread),
        presence=absent(number, found, "presence", where),
        log_bayes_factor=None if evidence is None else number(found, "log_bayes_factor", where),
        identifiability=text(found, "identifiability", where),
        prior=text(found, "prior", where),
        trusted=truth_value(found, "trusted", where),
        flags=texts(found, "flags", where),
        notes=texts(found, "notes", where),
        provenance=_free(found, "provenance", where),
    )


def _free(found: Mapping[str, Any], name: str, where: str) -> dict[str, Any]:
    value = free_of_plain(found[name], f"{where}.{name}")
    if not isinstance(value, dict):
        raise InputError(f"{where}.{name} must be a mapping; got {value!r:.80}")
    return value
