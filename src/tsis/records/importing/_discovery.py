"""Discovery of the batches in files and folders: bundles, results, recordings, snapshots, image files."""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING

from tsis.errors import FileInputError, InputError
from tsis.files import file_error, printable_name
from tsis.instrument.recording import RECORDING_INDEX, RECORDING_SUMMARY
from tsis.model import require_one_of
from tsis.records._values import ROLES
from tsis.records.export.bundle import DOCUMENTS, read_bundle
from tsis.records.importing._acquired import recording, sidecar_of, snapshot_folder, snapshots
from tsis.records.importing._batch import (
    MOST_FRAMES,
    ImportBatch,
    ImportOptions,
    IncomingPress,
    inspect_file,
    modification_time,
)
from tsis.records.importing._results import RESULT, result_folder

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path


def image_files(paths: Sequence[Path], given: ImportOptions, progress: Callable[[], None]) -> ImportBatch:
    """Image files of presses on one target.

    `FileInputError` when a file is no grey image, `InputError` when the number of forces does not fit that of files.
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
                **inspect_file(path),
                role=given.role,
                taken=given.taken or modification_time(path),
                name=printable_name(path)[:200],
                force_n=force,
                mm_per_pixel=given.mm_per_pixel if scale is None else scale.mm_per_pixel,
                probe=given.probe or ("" if given.calibration is None else given.calibration.probe),
                calibration=given.calibration,
            )
        )
        progress()
    return ImportBatch(source=paths[0], kind="image files", presses=tuple(presses))


def find_import_batches(
    paths: Sequence[Path], given: ImportOptions, *, progress: Callable[[int], None] | None = None
) -> tuple[ImportBatch, ...]:
    """Check all files that paths name: folders that tsis wrote, sidecars of snapshots, image files.

    ``given`` has metadata from the user; ``progress`` is called with the number of frames.

    Raises
    ------
    FileInputError
        When a path cannot be imported, or a file does not match its hash.
    InputError
        When the metadata do not fit the files.
    """
    done = 0

    def count() -> None:
        nonlocal done
        done += 1
        if done > MOST_FRAMES:
            raise FileInputError(f"an import must hold at most {MOST_FRAMES} frames; got more (import it in parts)")
        if progress is not None:
            progress(done)

    require_one_of("role of a press", given.role, ROLES)
    paths = list({path.absolute(): path for path in paths}.values())
    folders = [path for path in paths if _is_folder(path)]
    files = [path for path in paths if path not in folders]
    zipped = [path for path in files if path.suffix.lower() == ".zip"]
    sidecars = {path: sidecar_of(path) for path in files if path not in zipped}
    named = dict.fromkeys(path for path in sidecars.values() if path is not None)
    images = [path for path, sidecar in sidecars.items() if sidecar is None]
    result = chain(
        *(_folder(folder, given, count) for folder in folders),
        *(_bundle(path) for path in zipped),
        snapshots(named, given, count),
        [image_files(images, given, count)] if images else (),
    )
    return tuple(result)


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError as error:
        raise file_error(path, f"must name a file or folder; got: {error.strerror}") from error


def _folder(folder: Path, given: ImportOptions, count: Callable[[], None]) -> tuple[ImportBatch, ...]:
    if all((folder / name).exists() for name in DOCUMENTS):
        return _bundle(folder)
    if (folder / RESULT).exists():
        return (result_folder(folder, count),)
    if (folder / RECORDING_INDEX).exists() or (folder / RECORDING_SUMMARY).exists():
        return (recording(folder, given, count),)
    result = snapshot_folder(folder, given, count)
    if not result:
        raise file_error(
            folder,
            "must be a folder that tsis wrote (demo, acquire, records export "
            "--format bundle); it "
            "holds nothing of these (name image files one by one, with --role and what is known of them)",
        )
    return result


def _bundle(path: Path) -> tuple[ImportBatch, ...]:
    record = read_bundle(path)
    return (ImportBatch(source=path, kind="bundle", presses=(), record=record),)
