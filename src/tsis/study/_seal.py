"""The sealed truth: ``sealed.json``, which nobody needs to open before the unblinding.

The seal is no lock: anyone can open the file. It prevents reading by accident, and its SHA-256 in the plan reveals
every later change. A random salt prevents a search for the truth by trial.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.files import json_bytes, parse_object
from tsis.study._plan import require_study_format, study_file_errors
from tsis.study._values import TargetTruth, parse_target_truth

if TYPE_CHECKING:
    from collections.abc import Mapping


FORMAT, VERSION = "tsis-study-truth", 1


@dataclass(frozen=True, slots=True, kw_only=True)
class SealedTruth:
    """The targets of all codes."""

    salt: str  # random hexadecimal digits
    seed: int  # of codes, order and drawn targets
    truths: Mapping[str, TargetTruth]  # by code

    def content(self) -> bytes:
        """Content of the file."""
        document = {
            "format": FORMAT,
            "version": VERSION,
            "notice": RESEARCH_USE_ONLY,
            "salt": self.salt,
            "seed": self.seed,
            "targets": {code: truth.json_values() for code, truth in self.truths.items()},
        }
        return json_bytes(document, indent=1)


def commitment(content: bytes) -> str:
    """SHA-256 of the file, which reveals later changes."""
    return hashlib.sha256(content).hexdigest()


def parse_seal(content: bytes, name: str) -> SealedTruth:
    """Parse the content of a ``sealed.json``; ``name`` identifies it in errors.

    `RecordsError` when it is no truth of this version.
    """
    with study_file_errors(name, "salt, seed and targets"):
        document = parse_object(content, name, values=8_000_000)
        require_study_format(document, FORMAT, VERSION)
        truths = {str(code): parse_target_truth(item) for code, item in document["targets"].items()}
        return SealedTruth(salt=document["salt"], seed=document["seed"], truths=truths)
