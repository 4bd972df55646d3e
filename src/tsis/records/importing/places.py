"""Which kind of thing a path is, and all that is in it, looked through before anything is stored."""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING

from tsis.instrument import printable_path
from tsis.instrument.recording.record import RECORDING_INDEX, RECORDING_SUMMARY
from tsis.model.check import require_one_of
from tsis.model.errors import FileInputError
from tsis.records.export.bundle import read_bundle
from tsis.records.export.bundle.contents import DOCUMENTS
from tsis.records.importing.found import MOST_FRAMES, ImportBatch, ImportOptions
from tsis.records.importing.images import image_files
from tsis.records.importing.recording import recording
from tsis.records.importing.result_folder import RESULT, result_folder
from tsis.records.importing.snapshots import sidecar_of, snapshot_folder, snapshots
from tsis.records.values import ROLES

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path


def find_import_batches(
    paths: Sequence[Path], given: ImportOptions, *, progress: Callable[[int], None] | None = None
) -> tuple[ImportBatch, ...]:
    """Look through all that paths name.

    Parameters
    ----------
    paths
        Folders that tsis wrote, sidecars of snapshots, image files.
    given
        What a person says of them.
    progress
        Told how many frames were read.

    Raises
    ------
    FileInputError
        When a path is nothing that can be imported, or a file is not what its hash says.
    InputError
        When what was given does not belong to what was found.
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
    found = chain(
        *(_folder(folder, given, count) for folder in folders),
        *(_bundle(path) for path in zipped),
        snapshots(named, given, count),
        [image_files(images, given, count)] if images else (),
    )
    return tuple(found)


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError as error:
        raise FileInputError(f"{printable_path(path)} must name a file or folder; got: {error.strerror}") from error


def _folder(folder: Path, given: ImportOptions, count: Callable[[], None]) -> tuple[ImportBatch, ...]:
    if all((folder / name).exists() for name in DOCUMENTS):
        return _bundle(folder)
    if (folder / RESULT).exists():
        return (result_folder(folder, count),)
    if (folder / RECORDING_INDEX).exists() or (folder / RECORDING_SUMMARY).exists():
        return (recording(folder, given, count),)
    found = snapshot_folder(folder, given, count)
    if not found:
        raise FileInputError(
            f"{printable_path(folder)} must be a folder that tsis wrote (demo, acquire, records export --format bundle); it "
            "holds nothing of these (name image files one by one, with --role and what is known of them)"
        )
    return found


def _bundle(path: Path) -> tuple[ImportBatch, ...]:
    dossier = read_bundle(path)
    return (ImportBatch(source=path, kind="bundle", presses=(), dossier=dossier),)
