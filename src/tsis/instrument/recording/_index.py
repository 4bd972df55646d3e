"""The index of a recording: files of the frames and their arrival times."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import FileInputError, InputError
from tsis.files import as_path, printable_path, read_parsed
from tsis.instrument.recording._record import RECORDING_COLUMNS, RECORDING_INDEX

if TYPE_CHECKING:
    import os


LARGEST_INDEX_BYTES = 64 * 2**20


def read_recording_index(folder: str | os.PathLike[str]) -> tuple[tuple[Path, float], ...]:
    """Files of the frames of a recording with their arrival times in seconds, in order.

    Raises `FileInputError` when the folder has no valid ``frames.csv``, or it lists no frame or a file elsewhere.
    """
    root = as_path(folder)
    rows = read_parsed(root / RECORDING_INDEX, _rows, most=LARGEST_INDEX_BYTES)
    for name, _ in rows:
        if not name or Path(name).name != name or name in (".", ".."):
            raise FileInputError(
                f"{printable_path(root / RECORDING_INDEX)} must name files beside it; got {name!r:.80} "
                "(a recording in a video is not read)"
            )
    return tuple((root / name, arrived_s) for name, arrived_s in rows)


def _rows(text: str) -> list[tuple[str, float]]:
    try:
        lines = list(csv.DictReader(io.StringIO(text)))
        rows = [(line["kept_in"], float(line["arrived_s"])) for line in lines]
    except (csv.Error, KeyError, TypeError, ValueError) as error:
        raise InputError(f"it must have the columns {', '.join(RECORDING_COLUMNS)}; it has not") from error
    if not rows or not np.isfinite([time for _, time in rows]).all():
        raise InputError("it must list at least one frame with the time of its arrival; it does not")
    return rows
