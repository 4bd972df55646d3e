"""A snapshot: one frame in colour and raw, with a sidecar file."""

from __future__ import annotations

import hashlib
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.errors import FileInputError
from tsis.files.atomic import write_durably
from tsis.files.canonical_json import json_bytes
from tsis.files.frame_names import snapshot_stems, target_folder
from tsis.files.images import encode_picture
from tsis.files.reading import as_path, printable_path
from tsis.instrument.image_files import whole_levels
from tsis.model.require import require_one_of

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterator, Mapping
    from datetime import datetime
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.instrument.camera import Frame


FORMATS = ("bmp", "png", "jpg")
SIDECAR_FORMAT, SIDECAR_VERSION = "tsis-snapshot", 1
RAW_ENDINGS = ("-raw.bmp", "-raw.png")  # of the raw frame, after the stem of its sidecar


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """Files of a saved frame: the colour picture, the raw grey levels, and the JSON file about both."""

    colour: Path
    raw: Path
    sidecar: Path


def save_snapshot(
    frame: Frame,
    folder: str | os.PathLike[str],
    *,
    target: int,
    when: datetime,
    colour: Callable[[Frame], NDArray[np.uint8]],
    picture: str = "bmp",
    name: str = "Target",
    about: Mapping[str, Any] | None = None,
) -> Snapshot:
    """Save a frame as ``TargetN/TargetN-MMDDYY-HHMMSS`` in a folder; no file is ever overwritten.

    The sidecar is written last: a snapshot with a sidecar is complete.

    Parameters
    ----------
    frame
        The frame; its grey levels must be whole numbers.
    folder
        Parent of the targets' folders; created when missing.
    target
        Number of the target, in [1, 99999].
    when
        Local time of the snapshot.
    colour
        Returns the colour picture: red-green-blue, shape (rows, columns, 3).
    picture
        Its format: ``"bmp"``, ``"png"`` or ``"jpg"``. The raw frame stays lossless: BMP beside BMP, else PNG, and PNG
        whenever it has more than 8 bits.
    name
        Prefix of the number.
    about
        Further entries of the sidecar, e.g. the identity of the calibration.

    Raises
    ------
    InputError
        When a name, the number, the format or the grey levels cannot be saved.
    FileInputError
        When the files cannot be written; this snapshot is then removed, and earlier ones are unchanged.
    """
    require_one_of("picture format", picture, FORMATS)
    pixels = whole_levels(frame.pixels, frame.full_scale)
    path = as_path(folder) / target_folder(target, name=name)
    raw_format = "bmp" if picture == "bmp" and pixels.dtype == np.uint8 else "png"
    contents = {
        f".{picture}": encode_picture(colour(frame), picture),
        f"-raw.{raw_format}": encode_picture(pixels, raw_format),
    }
    sidecar = _sidecar(frame, target, when, contents, about or {})
    try:
        path.mkdir(parents=True, exist_ok=True)
        stem = _reserved(path, snapshot_stems(target, when, name=name), tuple(contents))
        _write_all(path, stem, contents, sidecar)
    except OSError as error:
        raise FileInputError(
            f"the snapshot must be written into {printable_path(path)}; got: {error.strerror or error} "
            "(free some space or choose another folder)"
        ) from error
    files = {ending: path / f"{stem}{ending}" for ending in contents}
    return Snapshot(colour=files[f".{picture}"], raw=files[f"-raw.{raw_format}"], sidecar=path / f"{stem}.json")


def _reserved(path: Path, stems: Iterator[str], endings: tuple[str, ...]) -> str:
    """The first free stem, reserved by its sidecar, so that two programs never choose the same."""
    for stem in stems:
        if any((path / f"{stem}{ending}").exists() for ending in endings):
            continue
        with suppress(FileExistsError), (path / f"{stem}.json").open("xb"):
            return stem
    raise AssertionError("stems never end")


def _write_all(path: Path, stem: str, contents: Mapping[str, bytes], sidecar: bytes) -> None:
    written = [path / f"{stem}.json"]
    try:
        for ending, content in contents.items():
            written.append(path / f"{stem}{ending}")
            write_durably(written[-1], content)
        write_durably(written[0], sidecar)
    except BaseException:
        for file in written:
            with suppress(OSError):
                file.unlink(missing_ok=True)
        raise


def _sidecar(
    frame: Frame, target: int, when: datetime, contents: Mapping[str, bytes], about: Mapping[str, Any]
) -> bytes:
    document = {
        "format": SIDECAR_FORMAT,
        "version": SIDECAR_VERSION,
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "target": int(target),
        "taken": when.isoformat(timespec="milliseconds"),
        "camera": frame.name,
        "sequence": frame.sequence,
        "time_s": frame.time_s,
        "full_scale": frame.full_scale,
        "shape": list(frame.pixels.shape),
        "settings": dict(frame.settings),
        "sha256": {ending: hashlib.sha256(content).hexdigest() for ending, content in contents.items()},
        **about,
    }
    return json_bytes(document)
