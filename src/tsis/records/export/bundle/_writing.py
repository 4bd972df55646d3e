"""Writing a target record as a bundle: whole or not at all, and read once before it gets its name."""

from __future__ import annotations

import hashlib
import zipfile
from typing import TYPE_CHECKING, Any

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.calibration.file import calibration_bytes
from tsis.errors import InputError, RecordsError
from tsis.files import SHA256, as_path, file_error, to_json_value
from tsis.records._estimate_json import estimate_to_json
from tsis.records.export._whole import export_file, export_folder, frame_png
from tsis.records.export.bundle._layout import (
    ESTIMATES,
    FOLDERS,
    FORMAT,
    MANIFEST,
    PRESSES,
    TARGET,
    VERSION,
    calibration_name,
    document_bytes,
    frame_name,
    samples_name,
    sealed_bytes,
)
from tsis.records.export.bundle._reading import read_bundle
from tsis.records.store import samples_bytes

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from tsis.records._target_record import TargetRecord

    Put = Callable[[str, bytes], object]

EARLIEST = (1980, 1, 1, 0, 0, 0)  # the time of every file in a zip file, so that equal bundles have equal bytes


def write_bundle(record: TargetRecord, path: str | os.PathLike[str]) -> str:
    """Write a target record as a new folder, or as a new zip file where the name ends in ``.zip``.

    Returns
    -------
    str
        SHA-256 of the manifest. The manifest has the hash of every other file, so this hash identifies the bundle.

    Raises
    ------
    FileInputError
        When the name is taken, or the bundle cannot be written.
    RecordsError
        When the record lacks something that it cites, or the bundle cannot be read back.
    """
    requested = as_path(path)
    if requested.suffix.lower() != ".zip":
        with export_folder(requested) as draft:
            for name in FOLDERS:
                (draft / name).mkdir()
            seal = _write(record, lambda name, content: (draft / name).write_bytes(content))
            _require_readable(draft)
        return seal
    with export_file(requested) as draft:
        try:
            with zipfile.ZipFile(draft, "x", allowZip64=False) as file:
                seal = _write(record, lambda name, content: file.writestr(zipfile.ZipInfo(name, EARLIEST), content))
        except zipfile.LargeZipFile as error:
            raise file_error(requested, "must hold at most 4 GiB; got more (write a folder)", InputError) from error
        _require_readable(draft)
    return seal


def _write(record: TargetRecord, put: Put) -> str:
    entries: dict[str, dict[str, Any]] = {}
    for name, content in _files(record):
        put(name, content)
        entries[name] = {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
    head = {"format": FORMAT, "version": VERSION, "notice": RESEARCH_USE_ONLY, "tsis": __version__}
    manifest = sealed_bytes(head | {"files": dict(sorted(entries.items()))})
    put(MANIFEST, manifest)
    return hashlib.sha256(manifest).hexdigest()


def _files(record: TargetRecord) -> Iterator[tuple[str, bytes]]:
    """Every file but the manifest, one at a time."""
    yield TARGET, document_bytes(to_json_value(record.target))
    yield PRESSES, document_bytes([to_json_value(press) for press in record.presses])
    yield ESTIMATES, document_bytes([estimate_to_json(stored) for stored in record.estimates])
    for number, stored in enumerate(record.estimates):
        yield samples_name(number), samples_bytes(stored.estimate)
    for cited, calibration in record.calibrations.items():
        yield calibration_name(cited), calibration_bytes(calibration)
    for frame, press in {press.frame: press for press in record.presses}.items():
        if not SHA256.fullmatch(frame):
            raise InputError(f"frame must be a SHA-256 in hexadecimal digits; got {frame!r:.80}")
        yield frame_name(frame), frame_png(record, press)


def _require_readable(draft: Path) -> None:
    try:
        read_bundle(draft)
    except InputError as error:
        raise RecordsError(f"a bundle must be one that can be read back; this one cannot: {error}") from error
