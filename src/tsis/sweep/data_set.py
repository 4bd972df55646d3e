"""A data set: its folder, its manifest with hashes, its verification."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.errors import FileInputError, InputError, import_extra
from tsis.files.atomic import UNFINISHED, exclusive_lock, write_durably
from tsis.files.canonical_json import content_sha256, json_bytes
from tsis.files.reading import file_error, one_line, read_bytes, read_object
from tsis.model.require import require_one_of
from tsis.sweep.plan import plan_document, plan_from_document
from tsis.sweep.shards import FEATURE, LARGEST_SHARD_BYTES, NAME, Receipt, data_set_of, decode_shard, sha256, shard_name

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from tsis.sweep.plan import Plan


MANIFEST_FILE = "manifest.json"
LARGEST_BYTES, MOST_VALUES = 64 * 2**20, 1_000_000  # of 100 000 files
FORMAT, VERSION = "tsis-sweep", 1
# Their versions can change the last digits, or the bytes of a file.
LIBRARIES = ("numpy", "scipy", "pyarrow")


def head(plan: Plan) -> dict[str, Any]:
    """Everything that determines the bytes of a data set; time, machine and workers are not part of it."""
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
    """The key in every file of the data set."""
    return manifest_sha256(start)


def write_manifest(folder: Path, start: Mapping[str, Any], receipts: Iterable[Receipt] | None) -> None:
    """Write the manifest; ``receipts`` is None while the data set is incomplete."""
    files = None if receipts is None else sorted(receipts, key=lambda receipt: receipt.shard)
    document = {
        "notice": RESEARCH_USE_ONLY,
        **start,
        "data_set": data_set_key(start),
        "complete": files is not None,
        "presses": sum(file.rows for file in files or ()),
        "refused": sum(file.refused for file in files or ()),
        "shards": [{"file": shard_name(file.shard), **asdict(file)} for file in files or ()],
    }
    write_durably(folder / MANIFEST_FILE, json_bytes(document, indent=1))


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read and check the manifest of a data set; `FileInputError` when it is missing or invalid."""
    path = folder / MANIFEST_FILE
    document = read_object(path, most=LARGEST_BYTES, values=MOST_VALUES)
    try:
        version = (document["format"], document["version"])
        entries = [(str(entry["file"]), int(entry["shard"]), str(entry["sha256"])) for entry in document["shards"]]
        whole = all(NAME.fullmatch(name) and name == shard_name(shard) for name, shard, _ in entries)
        plan_from_document(document["plan"])
        whole = whole and document.get("data_set") == data_set_key({key: document[key] for key in START})
        whole = whole and document["plan_sha256"] == manifest_sha256(document["plan"])
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError, InputError) as error:
        raise file_error(path, f"must be the manifest of a sweep; got: {one_line(error)}") from error
    if version != (FORMAT, VERSION):
        raise file_error(path, f"must be of {FORMAT}, version {VERSION}; got another format")
    if not whole:
        raise file_error(path, "must be as it was written; its hashes do not agree with its content")
    return dict(document)


START = ("format", "version", "tsis", "libraries", "plan_sha256", "plan")


def manifest_sha256(document: Mapping[str, Any]) -> str:
    """SHA-256 of a part of a manifest, from its JSON."""
    return content_sha256(document)


MOST_NAMED = 5


def first_few(files: Sequence[str]) -> str:
    """The first few file names, for a message."""
    return ", ".join(files[:MOST_NAMED]) + (", ..." if len(files) > MOST_NAMED else "")


def verify_data_set(folder: str | os.PathLike[str]) -> dict[str, Any]:
    """Check every file of a data set against its manifest, and return the manifest.

    Raises
    ------
    FileInputError
        When the data set is incomplete, or a file is missing, damaged or foreign; the message names them.
    """
    root, manifest = _complete(folder)
    wrong = [
        *(f"{entry['file']} ({fault})" for entry in manifest["shards"] if (fault := _fault(root, entry))),
        *(f"{name} (not in the manifest)" for name in _extra(root, manifest)),
    ]
    if wrong:
        raise file_error(
            root,
            f"must be as it was written; got {len(wrong)} wrong files: {first_few(wrong)}"
            " (tsis sweep run with its plan computes damaged and missing files again)",
        )
    return manifest


def read_data_set(
    folder: str | os.PathLike[str], columns: Sequence[str] | None = None, *, partial: bool = False
) -> dict[str, NDArray[Any]]:
    """Read a data set after checking the SHA-256 of every file that is read.

    Parameters
    ----------
    folder
        A folder of `run_sweep`.
    columns
        Names of the columns to read; None for all.
    partial
        Read the finished files of an incomplete data set, whose digests no manifest states yet, instead of refusing it;
        without a finished file there are no columns but ``radius_mm``.

    Returns
    -------
    dict
        By column, one row per press; profiles have a second axis over ``radius_mm``, which is always included.
        Refused presses are NaN, and ``error`` gives the reason.

    Raises
    ------
    FileInputError
        When the data set is incomplete or a file was changed.
    """
    root, manifest = _complete(folder, partial=partial)
    files = manifest["shards"] if manifest.get("complete") else _finished(root)
    outputs = plan_document(plan_from_document(manifest["plan"]))["outputs"]
    parts: dict[str, list[NDArray[Any]]] = {}
    for entry in files:
        content = read_bytes(root / entry["file"], most=LARGEST_SHARD_BYTES)
        if entry.get("sha256") not in (None, sha256(content)):
            raise file_error(root / entry["file"], "must be as it was written; its SHA-256 differs")
        rows = decode_shard(content)
        found = {"sample": rows.sample, **rows.numbers, "error": np.array(rows.error, dtype=np.str_)}
        for name in found if columns is None else columns:
            parts.setdefault(require_one_of("column", name, found), []).append(found[name])
    radius = np.array(outputs["radii_mm"], dtype=float)
    try:
        return {"radius_mm": radius} | {name: np.concatenate(values) for name, values in parts.items()}
    except (ValueError, TypeError) as error:
        raise file_error(root, "must hold files with the same columns; got others") from error


def _finished(root: Path) -> list[dict[str, Any]]:
    """The files of an incomplete data set; each is whole, since it got its name when it was written."""
    return [{"file": path.name} for path in sorted(root.iterdir()) if NAME.fullmatch(path.name)]


def _complete(folder: str | os.PathLike[str], *, partial: bool = False) -> tuple[Path, dict[str, Any]]:
    path = Path(folder)
    manifest = read_manifest(path)
    if not manifest.get("complete") and not partial:
        raise file_error(path, "must hold a complete data set; tsis sweep run with its plan finishes it")
    return path, manifest


def _fault(path: Path, entry: dict[str, Any]) -> str:
    try:
        content = read_bytes(path / entry["file"], most=LARGEST_SHARD_BYTES)
    except FileInputError as error:
        return "missing" if not (path / entry["file"]).exists() else str(error)
    return "" if sha256(content) == entry["sha256"] else "damaged"


def _extra(root: Path, manifest: dict[str, Any]) -> list[str]:
    expected = {MANIFEST_FILE, *(entry["file"] for entry in manifest["shards"])}
    return sorted(path.name for path in root.iterdir() if path.name not in expected)


def as_folder(folder: str | os.PathLike[str]) -> Path:
    """The absolute path of a folder, which need not exist; `FileInputError` when no folder can have this name."""
    try:
        return Path(folder).resolve()
    except (OSError, ValueError, TypeError, RuntimeError) as error:  # RuntimeError: a loop of links
        raise FileInputError(f"folder must be the name of a folder; got {folder!r:.80}") from error


@contextmanager
def begun(folder: Path, start: Mapping[str, Any]) -> Iterator[None]:
    """Create or resume the data set of ``start``, and lock it against other sweeps.

    `FileInputError` when the folder cannot be created, belongs to another plan or to something else, or is locked.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with exclusive_lock(folder, wait=False):
            if (folder / MANIFEST_FILE).exists():
                _refuse_other(folder, start)
            else:
                _refuse_content(folder, start)
                write_manifest(folder, start, None)
            yield
    except BlockingIOError as error:
        raise file_error(folder, "must not be in use; another sweep is writing into it") from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise file_error(folder, f"must be a folder that can be written; got: {reason}") from error


def _refuse_other(folder: Path, start: Mapping[str, Any]) -> None:
    manifest = read_manifest(folder)
    if manifest["plan_sha256"] != start["plan_sha256"]:
        raise file_error(
            folder,
            f"must hold no other data set; got one of another plan, which differs in "
            f"{', '.join(_differences(manifest['plan'], start['plan']))} (choose another folder)",
        )
    versions, here = ({"tsis": item["tsis"], **item["libraries"]} for item in (manifest, start))
    other = [
        f"{name} {versions.get(name)} and not {version}"
        for name, version in here.items()
        if versions.get(name) != version
    ]
    if other:
        raise file_error(
            folder,
            f"was begun with {', '.join(other)}; install those versions or choose another "
            "folder, so that all of its files are computed with the same versions",
        )
    if manifest["data_set"] != data_set_key(start):
        raise file_error(folder, "must hold no other data set; got one of another kind")


def _differences(present: Mapping[str, Any], asked: Mapping[str, Any]) -> list[str]:
    keys = dict.fromkeys((*asked, *present))
    return [key for key in keys if present.get(key) != asked.get(key)]


def _refuse_content(folder: Path, start: Mapping[str, Any]) -> None:
    """Without a manifest, accept only files of this data set, as after the removal of a damaged manifest."""
    for path in sorted(folder.iterdir()):
        if path.name.endswith(UNFINISHED):
            continue
        if not NAME.fullmatch(path.name) or data_set_of(path) != data_set_key(start):
            raise file_error(
                folder, f"must be new, empty, or a folder that this plan began; got {path.name!r:.80} in it"
            )
