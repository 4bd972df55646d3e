"""Stored targets, presses and estimates: durable, verifiable, reproducible, and exported to other programs."""

from typing import TYPE_CHECKING

import lazy_loader

from tsis.errors import require_extra

require_extra("sqlalchemy", feature="the store of records", extra="records")

from tsis.records._deidentify import DAMAGED, deidentified
from tsis.records._estimate_json import estimate_to_json
from tsis.records._estimation import PRIORS, REFERENCE_ROLES, EstimationRequest, estimate_stored, require_options
from tsis.records._provenance import environment
from tsis.records._recompute import Recomputation, Shift, recompute
from tsis.records._saving import SavableResult, require_savable, save_results, saved_notes
from tsis.records._target_record import TargetRecord
from tsis.records._values import (
    ESTIMATES,
    KINDS,
    LONGEST_NAME,
    LONGEST_NOTE,
    ROLE_NAMES,
    ROLES,
    StoredEstimate,
    StoredPress,
    Target,
    parse_force,
    parse_truth,
    require_label,
)

__all__ = [
    "DAMAGED",
    "ESTIMATES",
    "KINDS",
    "LONGEST_NAME",
    "LONGEST_NOTE",
    "PRIORS",
    "REFERENCE_ROLES",
    "ROLES",
    "ROLE_NAMES",
    "EstimationRequest",
    "Recomputation",
    "SavableResult",
    "Shift",
    "StoredEstimate",
    "StoredPress",
    "Target",
    "TargetRecord",
    "deidentified",
    "environment",
    "estimate_stored",
    "estimate_to_json",
    "parse_force",
    "parse_truth",
    "recompute",
    "require_label",
    "require_options",
    "require_savable",
    "save_results",
    "saved_notes",
]

if not TYPE_CHECKING:  # subpackages load when they are first used
    __getattr__ = lazy_loader.attach(__name__, ["dicom", "export", "importing", "store"])[0]
