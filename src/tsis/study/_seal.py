"""The sealed truth: ``sealed.json``, which nobody needs to open before the unblinding.

The seal is no lock: anyone can open the file. It prevents reading by accident, and its SHA-256 in the plan reveals
every later change. A random salt prevents a search for the truth by trial.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import FileInputError, InputError, RecordsError
from tsis.files import json_bytes, parse_object
from tsis.study._plan import require_study_format
from tsis.study._values import TargetTruth, parse_target_truth

if TYPE_CHECKING:
    from collections.abc import Mapping


FORMAT, VERSION = "tsis-study-truth", 1


@dataclass(frozen=True, slots=True, kw_only=True)
class SealedTruth:
    """The targets of all codes.

    Attributes
    ----------
    salt
        Random hexadecimal digits.
    seed
        Determines codes, order and drawn targets.
    truths
        By code.
    """

    salt: str
    seed: int
    truths: Mapping[str, TargetTruth]

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
    """SHA-256 of the file, which reveals later changes.

    Examples
    --------
    >>> commitment(b"")[:8]
    'e3b0c442'
    """
    return hashlib.sha256(content).hexdigest()


def parse_seal(content: bytes, name: str) -> SealedTruth:
    """Parse the content of a ``sealed.json``; ``name`` identifies it in errors.

    Raises
    ------
    RecordsError
        When it is no truth of this version.
    """
    try:
        document = parse_object(content, name, values=8_000_000)
        require_study_format(document, FORMAT, VERSION)
        truths = {str(code): parse_target_truth(item) for code, item in document["targets"].items()}
        return SealedTruth(salt=document["salt"], seed=document["seed"], truths=truths)
    except FileInputError as error:  # it names the file
        raise RecordsError(str(error)) from error
    except InputError as error:
        raise RecordsError(f"{name}: {error}") from error
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise RecordsError(f"{name} must hold salt, seed and targets; wrong or missing: {error!s:.80}") from error
