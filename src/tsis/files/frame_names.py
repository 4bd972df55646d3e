"""Names of saved frames: the folder of a target and the files of its snapshots."""

from __future__ import annotations

import itertools
import re
from typing import TYPE_CHECKING

from tsis.__about__ import LARGEST_TARGET
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from datetime import datetime


_FILE_STEM = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,39}")
_DEVICES_OF_WINDOWS = re.compile(r"(?i:con|prn|aux|nul|com[0-9]*|lpt[0-9]*)")


def require_file_stem(name: object) -> str:
    """Return ``name`` when it may begin a file name on every system: a letter, then letters, digits, ``-``, ``_``.

    `InputError` when it has other characters, or more than 40.

    Examples
    --------
    >>> require_file_stem("Target")
    'Target'
    """
    if not isinstance(name, str) or not _FILE_STEM.fullmatch(name) or _DEVICES_OF_WINDOWS.fullmatch(name):
        raise InputError(
            f"name must be a letter followed by at most 39 letters, digits, '-' or '_'; got {name!r:.80} "
            "(choose the folder separately)"
        )
    return name


def target_folder(target: object, *, name: str = "Target") -> str:
    """Name of the folder of a target, e.g. ``"Target1"``; ``target`` is a whole number in [1, 99999]."""
    if not isinstance(target, int) or isinstance(target, bool) or not 1 <= target <= LARGEST_TARGET:
        raise InputError(f"target must be a whole number in [1, {LARGEST_TARGET}]; got {target!r:.80}")
    return f"{require_file_stem(name)}{target}"


def snapshot_stems(target: object, when: datetime, *, name: str = "Target") -> Iterator[str]:
    """Names for a snapshot without their ending, in the order in which to try them.

    The first follows the dissertation, ``TargetN-MMDDYY-HHMMSS``; a second snapshot within a second takes the suffix
    ``-2``, and so on.

    Examples
    --------
    >>> from datetime import datetime
    >>> stems = snapshot_stems(1, datetime(2011, 2, 4, 13, 11, 12))
    >>> next(stems), next(stems)
    ('Target1-020411-131112', 'Target1-020411-131112-2')
    """
    first = f"{target_folder(target, name=name)}-{when:%m%d%y-%H%M%S}"
    return itertools.chain([first], (f"{first}-{number}" for number in itertools.count(2)))
