"""``manifest.json``: what a data set is, and the SHA-256 of every file of it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from importlib import metadata
from typing import TYPE_CHECKING, Any

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.instrument import printable_path
from tsis.instrument.file_bytes import one_line, read_object
from tsis.model.durable import write_durably
from tsis.model.errors import FileInputError, InputError
from tsis.model.extra import import_extra
from tsis.sweep.plan_file import plan_document, plan_from_document
from tsis.sweep.shards import FEATURE, NAME, Receipt, shard_name

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from tsis.sweep.plan import Plan

MANIFEST_FILE = "manifest.json"
LARGEST_BYTES, MOST_VALUES = 64 * 2**20, 1_000_000  # of 100 000 files
FORMAT, VERSION = "tsis-sweep", 1
# Their versions can change the last digits, or the bytes of a file.
LIBRARIES = ("numpy", "scipy", "pyarrow")


def head(plan: Plan) -> dict[str, Any]:
    """What decides every byte of a data set; no time, machine or worker is part of it."""
    import_extra("pyarrow", feature=FEATURE, extra="cluster")
    document = plan_document(plan)
    return {
        "format": FORMAT,
        "version": VERSION,
        "tsis": __version__,
        "libraries": {name: metadata.version(name) for name in LIBRARIES},
        "plan_sha256": manifest_sha256(document),
        "plan": document,
    }


def data_set_key(start: Mapping[str, Any]) -> str:
    """The key that every file of the data set carries."""
    return manifest_sha256(start)


def write_manifest(folder: Path, start: Mapping[str, Any], receipts: Iterable[Receipt] | None) -> None:
    """Write the manifest; ``receipts`` is None as long as the data set is not complete."""
    files = None if receipts is None else sorted(receipts, key=lambda receipt: receipt.shard)
    document = {
        "notice": RESEARCH_USE_ONLY,
        **start,
        "data_set": data_set_key(start),
        "complete": files is not None,
        "presses": sum(one.rows for one in files or ()),
        "refused": sum(one.refused for one in files or ()),
        "shards": [{"file": shard_name(one.shard), **asdict(one)} for one in files or ()],
    }
    write_durably(folder / MANIFEST_FILE, (json.dumps(document, indent=1, allow_nan=False) + "\n").encode())


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a data set, its form checked.

    Raises
    ------
    FileInputError
        When there is none, or it is no manifest of a sweep.
    """
    path = folder / MANIFEST_FILE
    document = read_object(path, most=LARGEST_BYTES, values=MOST_VALUES)
    try:
        found = (document["format"], document["version"])
        entries = [(str(entry["file"]), int(entry["shard"]), str(entry["sha256"])) for entry in document["shards"]]
        whole = all(NAME.fullmatch(name) and name == shard_name(shard) for name, shard, _ in entries)
        plan_from_document(document["plan"])
        whole = whole and document.get("data_set") == data_set_key({key: document[key] for key in START})
        whole = whole and document["plan_sha256"] == manifest_sha256(document["plan"])
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError, InputError) as error:
        raise FileInputError(
            f"{printable_path(path)} must be the manifest of a sweep; got: {one_line(error)}"
        ) from error
    if found != (FORMAT, VERSION):
        raise FileInputError(f"{printable_path(path)} must be of {FORMAT}, version {VERSION}; got another format")
    if not whole:
        raise FileInputError(
            f"{printable_path(path)} must be as it was written; its hashes do not agree with its content"
        )
    return dict(document)


START = ("format", "version", "tsis", "libraries", "plan_sha256", "plan")


def manifest_sha256(document: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(document, sort_keys=True, allow_nan=False).encode()).hexdigest()
