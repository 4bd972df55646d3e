"""Results that are slow to compute, kept on disk under the hash of what they were computed from.

Each file starts with the SHA-256 of its key and the rest. A file that does not match, or that belongs to another key,
is never used. A cache that cannot be written is no error: the result is computed again next time.
"""

from __future__ import annotations

import hashlib
import io
import os
import stat
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import platformdirs

from tsis.errors import FileInputError
from tsis.files._archive import arrays_of
from tsis.files._atomic import write_durably
from tsis.files._codec import free_to_plain
from tsis.files._json import content_sha256

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray


DIGEST_BYTES = 32
LARGEST_CACHED_BYTES = 512 * 2**20


def cache_folder() -> Path:
    """Where the cache lies: ``$TSIS_CACHE_DIR``, else the platform's folder for caches."""
    return Path(os.environ.get("TSIS_CACHE_DIR") or platformdirs.user_cache_dir("tsis"))


def content_key(content: Mapping[str, Any]) -> str:
    """A name for ``content`` (JSON values): equal content gives an equal name on every machine."""
    return content_sha256(free_to_plain(content, "content"))[:32]


def read_cached(kind: str, key: str) -> bytes | None:
    """The stored bytes, or None when there are none or they are damaged."""
    path = cache_folder() / kind / key
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode) or status.st_size > LARGEST_CACHED_BYTES:  # reading a pipe may never end
            return None
        data = path.read_bytes()
    except OSError:
        return None
    digest, payload = data[:DIGEST_BYTES], data[DIGEST_BYTES:]
    return payload if cached_sha256(key, payload) == digest else None


def read_cached_arrays(kind: str, key: str) -> dict[str, NDArray[Any]] | None:
    """The stored arrays, or None when there are none, they are damaged, or the file holds something else."""
    stored = read_cached(kind, key)
    if stored is None:
        return None
    try:
        return arrays_of(stored)
    except FileInputError:
        return None


def write_cached_arrays(kind: str, key: str, arrays: Mapping[str, ArrayLike]) -> None:
    """Store arrays by name as one npz file; readers see all of it or nothing."""
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **{name: np.asarray(values) for name, values in arrays.items()})
    write_cached(kind, key, buffer.getvalue())


def write_cached(kind: str, key: str, payload: bytes) -> None:
    """Store ``payload``; readers see all of it or nothing."""
    path = cache_folder() / kind / key
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_durably(path, cached_sha256(key, payload) + payload)


def cached_sha256(key: str, payload: bytes) -> bytes:
    return hashlib.sha256(key.encode() + payload).digest()
