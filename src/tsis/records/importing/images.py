"""Image files from any camera, with what a person says of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.instrument.file_bytes import printable_name
from tsis.model.errors import InputError
from tsis.records.importing.found import ImportBatch, ImportOptions, IncomingPress, looked_through, written

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path


def image_files(paths: Sequence[Path], given: ImportOptions, progress: Callable[[], None]) -> ImportBatch:
    """Image files of presses on one target.

    Raises
    ------
    FileInputError
        When one is no grey image file.
    InputError
        When forces are neither one for all nor one for each.
    """
    if len(given.force_n) not in (0, 1, len(paths)):
        raise InputError(f"--force-n must be given once, or once for each of {len(paths)}; got {len(given.force_n)}")
    forces = list(given.force_n or [None]) * (len(paths) if len(given.force_n) < 2 else 1)
    scale = given.calibration.scale if given.calibration is not None else None
    if scale is not None and given.mm_per_pixel is not None:
        raise InputError("--scale-mm is not used with this calibration, which holds the scale; leave it out")
    presses = []
    for path, force in zip(paths, forces, strict=True):
        presses.append(
            IncomingPress(
                **looked_through(path),
                role=given.role,
                taken=given.taken or written(path),
                name=printable_name(path)[:200],
                force_n=force,
                mm_per_pixel=given.mm_per_pixel if scale is None else scale.mm_per_pixel,
                probe=given.probe or ("" if given.calibration is None else given.calibration.probe),
                calibration=given.calibration,
            )
        )
        progress()
    return ImportBatch(source=paths[0], kind="image files", presses=tuple(presses))
