"""A cache on disk of slow results, under the hash of their inputs.

Each file starts with the SHA-256 of its key and payload; a file that does not match is never used. A cache that cannot
be written is no error: the result is computed again next time. The package ships the tables of the catalog's probes
as a second cache, which is only read; `make tables` writes it. There each has a readable name, and `tables.toml` gives
its key and says what it is.
"""

from __future__ import annotations

import hashlib
import io
import os
import stat
import tomllib
from contextlib import suppress
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import platformdirs

from tsis.errors import FileInputError
from tsis.files.archive import read_arrays
from tsis.files.atomic import write_durably
from tsis.files.canonical_json import content_sha256
from tsis.files.json_values import free_to_json

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import ArrayLike, NDArray


DIGEST_BYTES = 32
LARGEST_CACHED_BYTES = 512 * 2**20
SHIPPED_KEYS = "tables.toml"  # beside the shipped tables


def cache_folder() -> Path:
    """The folder of the cache: ``$TSIS_CACHE_DIR``, else the cache folder of the platform."""
    return Path(os.environ.get("TSIS_CACHE_DIR") or platformdirs.user_cache_dir("tsis"))


def content_key(content: Mapping[str, Any]) -> str:
    """A name for ``content`` (JSON values): equal content gives an equal name on every machine."""
    return content_sha256(free_to_json(content, "content"))[:32]


def read_cached(kind: str, key: str) -> bytes | None:
    """The bytes from the cache or from the package, or None when they are missing or damaged."""
    cached = _read(cache_folder() / kind / key, key)
    if cached is not None:
        return cached
    name = _shipped_names(shipped_tables()).get((kind, key))
    return None if name is None else _read(shipped_tables() / kind / name, key)


def shipped_tables() -> Path:
    """The folder of the tables that ship with the package."""
    return Path(str(files("tsis"))) / "tables"


@cache
def _shipped_names(folder: Path) -> dict[tuple[str, str], str]:
    """Names of the shipped tables by kind and key."""
    try:
        kinds = tomllib.loads((folder / SHIPPED_KEYS).read_text(encoding="utf-8"))
    except FileNotFoundError:  # while `make tables` computes them
        return {}
    return {(kind, key): name for kind, entry in kinds.items() for name, key in entry["keys"].items()}


def _read(path: Path, key: str) -> bytes | None:
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
    """The cached arrays, or None when they are missing or damaged, or the file has other content."""
    stored = read_cached(kind, key)
    if stored is None:
        return None
    try:
        return read_arrays(stored)
    except FileInputError:
        return None


def cached_arrays(
    kind: str, key: str, solve: Callable[[], dict[str, NDArray[Any]]], *, compressed: bool = False
) -> dict[str, NDArray[Any]]:
    """Arrays from the cache; ``solve`` computes missing ones."""
    arrays = read_cached_arrays(kind, key)
    if arrays is None:
        arrays = solve()
        write_cached_arrays(kind, key, arrays, compressed=compressed)
    return arrays


def write_cached_arrays(kind: str, key: str, arrays: Mapping[str, ArrayLike], *, compressed: bool = False) -> None:
    """Store arrays by name as one npz file, atomically; ``compressed`` pays where many numbers are equal."""
    buffer = io.BytesIO()
    save = np.savez_compressed if compressed else np.savez
    save(buffer, allow_pickle=False, **{name: np.asarray(values) for name, values in arrays.items()})
    write_cached(kind, key, buffer.getvalue())


def write_cached(kind: str, key: str, payload: bytes) -> None:
    """Store ``payload`` atomically."""
    path = cache_folder() / kind / key
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_durably(path, cached_sha256(key, payload) + payload)


def remove_cached(kind: str, key: str) -> None:
    """Remove a file of the user's cache, for example the parts of a finished result; no error if there is none."""
    with suppress(OSError):
        (cache_folder() / kind / key).unlink()


def cached_sha256(key: str, payload: bytes) -> bytes:
    """The digest with which a cached file begins."""
    return hashlib.sha256(key.encode() + payload).digest()
