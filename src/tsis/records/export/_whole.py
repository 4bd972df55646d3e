"""Atomic exports to new files and folders."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from tsis.files import QUICK_PNG, as_path, atomic_file, atomic_folder, encode_picture, file_error

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator
    from pathlib import Path

    from tsis.records._target_record import TargetRecord
    from tsis.records._values import StoredPress


@contextmanager
def export_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """As `tsis.files.atomic_file`; `FileInputError` when the name is taken, or it cannot be written."""
    requested = as_path(path)
    with _refusing(requested), atomic_file(requested) as draft:
        yield draft


@contextmanager
def export_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """As `tsis.files.atomic_folder`; `FileInputError` when the name is taken, or it cannot be written."""
    requested = as_path(path)
    with _refusing(requested), atomic_folder(requested) as draft:
        yield draft


@contextmanager
def _refusing(requested: Path) -> Iterator[None]:
    try:
        yield
    except FileExistsError as error:
        raise file_error(requested, "must be a new name; there is such a file or folder (choose another)") from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise file_error(requested, f"must be a place that can be written; got: {reason}") from error


def frame_png(record: TargetRecord, press: StoredPress) -> bytes:
    """The frame of a press as a grey PNG file of 8 or 16 bits; `RecordsError` when it does not match its press."""
    return encode_picture(record.levels(press), level=QUICK_PNG)
