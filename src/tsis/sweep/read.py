"""Data sets back as arrays, every byte checked against the manifest first."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.instrument import printable_path, read_bytes
from tsis.model.check import require_one_of
from tsis.model.errors import FileInputError
from tsis.sweep.manifest import MANIFEST_FILE, read_manifest
from tsis.sweep.plan import PROFILES
from tsis.sweep.plan_file import plan_document, plan_from_document
from tsis.sweep.shards import LARGEST_SHARD_BYTES, decode_shard, sha256

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    from numpy.typing import NDArray

MOST_NAMED = 5


def first_few(files: Sequence[str]) -> str:
    """The first of many files, for a sentence."""
    return ", ".join(files[:MOST_NAMED]) + (", ..." if len(files) > MOST_NAMED else "")


def verify_data_set(folder: str | os.PathLike[str]) -> dict[str, Any]:
    """Check every file of a data set against its manifest, and return the manifest.

    Raises
    ------
    FileInputError
        When the data set is not complete, or a file is missing, damaged or foreign; the message names them.
    """
    place, manifest = _complete(folder)
    wrong = [
        *(f"{entry['file']} ({fault})" for entry in manifest["shards"] if (fault := _fault(place, entry))),
        *(f"{name} (not in the manifest)" for name in _extra(place, manifest)),
    ]
    if wrong:
        raise FileInputError(
            f"{printable_path(place)} must be as it was written; got {len(wrong)} wrong files: {first_few(wrong)}"
            " (tsis sweep run with its plan computes damaged and missing files again)"
        )
    return manifest


def read_data_set(folder: str | os.PathLike[str], columns: Sequence[str] | None = None) -> dict[str, NDArray[Any]]:
    """Read a data set after checking the SHA-256 of every file that is read.

    Parameters
    ----------
    folder
        What `run_sweep` wrote.
    columns
        Names of the columns to read; None for all.

    Returns
    -------
    dict
        By column, one row a press; profiles have an axis more, over ``radius_mm``, which is always there. Refused
        presses hold NaN, and ``error`` says why.

    Raises
    ------
    FileInputError
        When the data set is not complete or a file is not as it was written.
    """
    place, manifest = _complete(folder)
    outputs = plan_document(plan_from_document(manifest["plan"]))["outputs"]
    parts: dict[str, list[NDArray[Any]]] = {}
    for entry in manifest["shards"]:
        content = read_bytes(place / entry["file"], most=LARGEST_SHARD_BYTES)
        if sha256(content) != entry["sha256"]:
            raise FileInputError(
                f"{printable_path(place / entry['file'])} must be as it was written; its SHA-256 differs"
            )
        table = decode_shard(content)
        for name in table.column_names if columns is None else columns:
            require_one_of("column", name, table.column_names)
            try:
                parts.setdefault(name, []).append(_array(table.column(name), name))
            except (ValueError, AttributeError, TypeError, NotImplementedError) as error:
                raise FileInputError(
                    f"{printable_path(place / entry['file'])} must hold numbers by column; got others"
                ) from error
    radius = np.array(outputs["radii_mm"], dtype=float)
    try:
        return {"radius_mm": radius} | {name: np.concatenate(values) for name, values in parts.items()}
    except (ValueError, TypeError) as error:
        raise FileInputError(f"{printable_path(place)} must hold files with alike columns; got others") from error


def _array(column: Any, name: str) -> NDArray[Any]:
    flat = column.combine_chunks()
    if name in PROFILES:
        width = flat.type.list_size
        return np.asarray(flat.flatten().to_numpy(zero_copy_only=False)).reshape(-1, width)
    if name == "error":
        return np.array(flat.to_pylist(), dtype=np.str_)
    return np.asarray(flat.to_numpy(zero_copy_only=False))


def _complete(folder: str | os.PathLike[str]) -> tuple[Path, dict[str, Any]]:
    place = Path(folder)
    manifest = read_manifest(place)
    if not manifest.get("complete"):
        raise FileInputError(
            f"{printable_path(place)} must hold a complete data set; tsis sweep run with its plan finishes it"
        )
    return place, manifest


def _fault(place: Path, entry: dict[str, Any]) -> str:
    try:
        content = read_bytes(place / entry["file"], most=LARGEST_SHARD_BYTES)
    except FileInputError as error:
        return "missing" if not (place / entry["file"]).exists() else str(error)
    return "" if sha256(content) == entry["sha256"] else "damaged"


def _extra(place: Path, manifest: dict[str, Any]) -> list[str]:
    expected = {MANIFEST_FILE, *(entry["file"] for entry in manifest["shards"])}
    return sorted(path.name for path in place.iterdir() if path.name not in expected)
