"""Files of a study: its log, a hash-chained file to which one process at a time appends, and its sealed truth.

The seal, ``sealed.json``, is no lock: anyone can open the file. It prevents reading by accident, and its SHA-256 in
the plan reveals every later change. A random salt prevents a search for the truth by trial.
"""

from __future__ import annotations

import hashlib
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import RecordsError
from tsis.files.atomic import DISK, Disk, exclusive_lock
from tsis.files.canonical_json import json_bytes
from tsis.files.hash_chain import EMPTY_CHAIN, LogChain, LogDraft, append_entries, read_chain_file
from tsis.files.reading import file_error, parse_object, printable_path
from tsis.study.plan import TargetTruth, parse_target_truth, require_study_format, study_file_errors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path


LOG_FILE = "log.jsonl"
CURE = "tsis study verify tells all"
REPORT_EVERY = 1000  # targets


def read_log(folder: Path, *, disk: Disk = DISK) -> LogChain:
    """Read the log of a study, damaged or not; `FileInputError` when it is missing or unreadable."""
    with _log_lock(folder):  # never reads half of an entry
        return read_chain_file(folder / LOG_FILE, disk=disk)


def append_log(
    folder: Path,
    drafts_after: Callable[[LogChain], Sequence[LogDraft]],
    *,
    log_chain: LogChain = EMPTY_CHAIN,
    damaged: bool = False,
    disk: Disk = DISK,
) -> LogChain:
    """Append entries to the log of a study, durably and exclusively, and return it; as `append_entries`.

    `RecordsError` when the log is damaged, or cannot be written.
    """
    path = folder / LOG_FILE
    with _log_lock(folder):
        try:
            return append_entries(
                path, drafts_after, datetime.now(UTC), log_chain=log_chain, damaged=damaged, cure=CURE, disk=disk
            )
        except OSError as error:
            raise file_error(
                path, f"could not be written: {error.strerror or error}; earlier entries are unchanged", RecordsError
            ) from error


@contextmanager
def _log_lock(path: Path, *, wait: bool = True) -> Iterator[None]:
    """Exclusive access to the log in the folder ``path``."""
    with ExitStack() as stack:
        try:
            stack.enter_context(exclusive_lock(path, wait=wait))
        except BlockingIOError as error:
            raise RecordsError(
                f"{printable_path(path.parent)} must be read by one run at a time; another one is under way (wait "
                "for it, or end it)"
            ) from error
        except OSError as error:
            raise RecordsError(f"{printable_path(path)} must be part of a study; got: {error.strerror}") from error
        yield


def run_lock(plan: Path) -> AbstractContextManager[None]:
    """Refuse while another run reads the targets of this ``plan``, a file that is never replaced."""
    return _log_lock(plan, wait=False)


FORMAT, VERSION = "tsis-study-truth", 1


@dataclass(frozen=True, slots=True, kw_only=True)
class SealedTruth:
    """The targets of all codes."""

    salt: str  # random hexadecimal digits
    seed: int  # of codes, order and drawn targets
    truths: Mapping[str, TargetTruth]  # by code

    def content(self, progress: Callable[[int, int], None] = lambda _done, _all: None) -> bytes:
        """Content of the file, written target by target; ``progress`` is called with (written, all)."""
        head = {"format": FORMAT, "version": VERSION, "notice": RESEARCH_USE_ONLY, "salt": self.salt, "seed": self.seed}
        content = bytearray(json_bytes(head, indent=1).removesuffix(b"\n}\n") + b',\n "targets": {')
        for number, (code, truth) in enumerate(self.truths.items()):
            if number % REPORT_EVERY == 0:
                progress(number, len(self.truths))
            item = json_bytes(truth.json_values(), indent=1).rstrip().replace(b"\n", b"\n  ")
            content += b'%s\n  "%s": %s' % (b"," if number else b"", code.encode(), item)
        return bytes(content + b"\n }\n}\n")


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
