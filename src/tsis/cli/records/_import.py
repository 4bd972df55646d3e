"""``tsis records import``: snapshots, recordings, demo folders, bundles and image files into a store."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

import typer

import tsis
from tsis.cli._options import AsJson, scale_of
from tsis.cli._output import print_json
from tsis.cli._progress import progress_bar, stop_interrupted, waiting
from tsis.cli._store import PHANTOM, StoreDatabase, StoreFolder, StoreKind, is_there, opened, target_number
from tsis.present.terminal import people, print_notice

if TYPE_CHECKING:
    from tsis.calibration.file import ProbeCalibration
    from tsis.records.importing import ImportedBatch
    from tsis.records.store import Store


NEW = "new"


def import_(
    paths: Annotated[list[Path], typer.Argument(help="Folders that tsis wrote, bundles, sidecars, image files.")],
    *,
    target: Annotated[
        str | None,
        typer.Option(help="Number of the target, or new.", show_default="that of the files, else new"),
    ] = None,
    role: Annotated[str, typer.Option(help="What was pressed: target, plain, untouched or ball.")] = "target",
    force_n: Annotated[
        list[float] | None, typer.Option(help="Force in newtons of image files: one for all, or one for each.")
    ] = None,
    scale_mm: Annotated[
        str | None, typer.Option(help="Millimetres per pixel on the face: one number, or x,y when they differ.")
    ] = None,
    calibration: Annotated[Path | None, typer.Option(help="Calibration file of the frames.")] = None,
    probe: Annotated[str, typer.Option(help="Name of the probe.", show_default="the calibration's")] = "",
    taken: Annotated[
        datetime | None, typer.Option(help="When image files were taken.", show_default="when each was written")
    ] = None,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """Import frames into a store, each once; their files are verified before anything is stored.

    Frames that the store has are skipped, so repeating an interrupted import completes it. The estimate of
    a demo folder is recomputed from its frames; a bundle contains its own.
    """
    from tsis.calibration.file import read_calibration
    from tsis.records.importing import (
        ImportOptions,
        ImportProgress,
        find_import_batches,
        import_batches,
        require_importable,
    )

    number = None if target in (None, NEW) else target_number(str(target))
    options = ImportOptions(
        role=role,
        force_n=tuple(force_n or ()),
        mm_per_pixel=None if scale_mm is None else scale_of(scale_mm),
        probe=probe,
        calibration=None if calibration is None else read_calibration(calibration),
        taken=None if taken is None else taken.astimezone(),
    )
    with _Calibrations(store, kind, database) as calibrations, waiting("reading the files"):
        batches = find_import_batches(paths, replace(options, calibration_of=calibrations.of))
    require_importable(batches, kind, number)  # before a store is created
    with opened(store, kind, database, create=True) as records:
        tally = ImportProgress()
        try:
            with progress_bar("storing") as advance:
                entered = import_batches(
                    records, batches, target=number, difference=target == NEW, tally=tally, progress=advance
                )
        except KeyboardInterrupt:
            stop_interrupted(f"; {tally.message}.")
        position = str(records.folder.resolve())
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "records import", store=position, imported=[_document(item) for item in entered]
            )
        )
        return
    console = people()
    for item in entered:
        console.print(_line(item), markup=False, soft_wrap=True)
        for note in item.batch.notes:
            console.print(f"- {note}", markup=False, soft_wrap=True)
    console.print(f"Store: {position}", markup=False, soft_wrap=True)
    print_notice(console)


class _Calibrations:
    """Calibrations that files cite, from a store that is opened at the first request, if it exists."""

    def __init__(self, folder: Path | None, kind: str, database: str | None) -> None:
        self._chosen = folder, kind, database
        self._store: Store | None = None
        self._by_name: dict[str, ProbeCalibration | None] = {}
        self._until = ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._until.close()

    def of(self, cited: str) -> ProbeCalibration | None:
        """The calibration of an identity; None where the store has none, `RecordsError` when it is damaged."""
        from tsis.records.importing import stored_calibration

        if cited not in self._by_name:
            if self._store is None and is_there(*self._chosen):
                self._store = self._until.enter_context(opened(*self._chosen))
            self._by_name[cited] = None if self._store is None else stored_calibration(self._store, cited)
        return self._by_name[cited]


def _line(entered: ImportedBatch) -> str:
    text = tsis.present.records.entered_text(
        entered.target, new=entered.new, added=entered.added, present=entered.present, estimates=entered.estimates
    )
    return f"{entered.batch.kind} in {entered.batch.source}: {text}"


def _document(entered: ImportedBatch) -> dict[str, Any]:
    return {
        "source": str(entered.batch.source),
        "kind": entered.batch.kind,
        "target": entered.target.number,
        "new": entered.new,
        "added": entered.added,
        "present": entered.present,
        "estimates": entered.estimates,
        "notes": list(entered.batch.notes),
    }
