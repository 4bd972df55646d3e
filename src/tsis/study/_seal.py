"""The sealed truth: ``sealed.json``, which nobody needs to open before the study is unblinded.

It is no lock: whoever opens the file reads the truth. It keeps people from reading it by accident, and its SHA-256
in the plan shows every later change. A salt that chance gave keeps anybody from finding the truth by trying.
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
    """What every code stands for.

    Attributes
    ----------
    salt
        Hexadecimal digits that chance gave.
    seed
        What codes, order and drawn targets follow from.
    truths
        By code.
    """

    salt: str
    seed: int
    truths: Mapping[str, TargetTruth]

    def content(self) -> bytes:
        """The file."""
        document = {
            "format": FORMAT,
            "version": VERSION,
            "notice": RESEARCH_USE_ONLY,
            "salt": self.salt,
            "seed": self.seed,
            "targets": {code: truth.plain() for code, truth in self.truths.items()},
        }
        return json_bytes(document, indent=1)


def commitment(content: bytes) -> str:
    """SHA-256 of the file, by which a later change shows.

    Examples
    --------
    >>> commitment(b"")[:8]
    'e3b0c442'
    """
    return hashlib.sha256(content).hexdigest()


def parse_seal(content: bytes, name: str) -> SealedTruth:
    """The truth in the content of a ``sealed.json``; ``name`` says in errors where it came from.

    Raises
    ------
    RecordsError
        When it holds none that this version reads.
    """
    try:
        reference = parse_object(content, name, values=8_000_000)
        require_study_format(reference, FORMAT, VERSION)
        truths = {str(code): parse_target_truth(item) for code, item in reference["targets"].items()}
        return SealedTruth(salt=reference["salt"], seed=reference["seed"], truths=truths)
    except FileInputError as error:  # which names the file
        raise RecordsError(str(error)) from error
    except InputError as error:
        raise RecordsError(f"{name}: {error}") from error
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise RecordsError(f"{name} must hold salt, seed and targets; wrong or missing: {error!s:.80}") from error
