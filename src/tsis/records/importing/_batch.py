"""Checked frames with their metadata, ready for an import."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from sqlalchemy import select

from tsis.calibration.file import calibration_sha256
from tsis.errors import InputError
from tsis.files import file_error, free_to_json, printable_path
from tsis.instrument import read_image
from tsis.model import freeze_mappings
from tsis.records._values import StoredPress
from tsis.records.store import calibration_table, frame_bytes

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from tsis.calibration.file import ProbeCalibration
    from tsis.model import TactileImage
    from tsis.records._target_record import TargetRecord
    from tsis.records.store import Store


MOST_FRAMES = 100_000  # of one import


def no_calibration(_cited: str) -> ProbeCalibration | None:
    """A lookup without any calibration."""
    return None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImportOptions:
    """Metadata from the user, for frames whose files lack it; other fields as in `StoredPress`.

    ``force_n`` has a force for all image files, or one for each. ``taken`` is the time of image files, by default their
    modification time. ``calibration_of`` finds a calibration by the SHA-256 that a file cites.
    """

    role: str = "target"
    force_n: tuple[float, ...] = ()
    mm_per_pixel: tuple[float, float] | None = None
    probe: str = ""
    calibration: ProbeCalibration | None = None
    taken: datetime | None = None
    calibration_of: Callable[[str], ProbeCalibration | None] = no_calibration


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class IncomingPress:
    """A frame from a checked file, ready to be stored; other fields as in `StoredPress`."""

    path: Path
    sha256: str  # of the checked file
    frame: str  # SHA-256 of the frame in a store
    role: str
    taken: datetime
    name: str
    full_scale: float | None = None  # grey level at which the camera clips; None for that of the file
    force_n: float | None = None
    mm_per_pixel: tuple[float, float] | None = None
    probe: str = ""
    calibration: ProbeCalibration | None = None
    flags: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        freeze_mappings(self, "settings")
        free_to_json(self.settings, "settings")
        full_scale = 255.0 if self.full_scale is None else self.full_scale
        names = ("frame", "role", "taken", "name", "force_n", "mm_per_pixel", "probe", "flags")
        values = {name: getattr(self, name) for name in names}
        StoredPress(rows=1, columns=1, full_scale=full_scale, axis_px=(0.0, 0.0), **values)  # checks the values

    def image(self) -> TactileImage:
        """The frame, read again; `FileInputError` when its file has changed since the check."""
        image = read_frame(self.path, full_scale=self.full_scale)
        if image.settings["sha256"] != self.sha256:
            raise file_error(self.path, "must be as it was looked through; it was changed meanwhile")
        return replace(
            image,
            force_n=self.force_n,
            mm_per_pixel=self.mm_per_pixel,
            name=self.name,
            settings={**self.settings, "file": image.name, "sha256": self.sha256},
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestedEstimate:
    """An estimate that came with frames, to be computed again from them; fields as in `StoredEstimate`."""

    kind: str
    probe: str
    calibration: ProbeCalibration
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImportBatch:
    """Frames of one target from one source.

    Parameters
    ----------
    source
        The file or folder.
    kind
        Description of the source.
    presses
        The frames in the order of the estimate.
    number
        Target number in the files, or None.
    name, truth
        As in `Target`, for a new one.
    simulated
        Whether the phantom is virtual; a store of subjects refuses it.
    estimate
        The estimate to compute, or None.
    record
        Content of a bundle, in place of presses.
    notes
        Messages for the user.
    """

    source: Path
    kind: str
    presses: tuple[IncomingPress, ...]
    number: int | None = None
    name: str = ""
    truth: Mapping[str, float] = field(default_factory=dict)
    simulated: bool = False
    estimate: RequestedEstimate | None = None
    record: TargetRecord | None = None
    notes: tuple[str, ...] = ()


def read_frame(path: Path, *, full_scale: float | None = None) -> TactileImage:
    """A grey frame of whole levels; `FileInputError` when it is unreadable, or in colour."""
    image = read_image(path)
    if full_scale is not None:
        image = replace(image, full_scale=full_scale)
    try:
        frame_bytes(image)
    except InputError as error:
        colour = image.settings.get("kind") == "colour"
        fault = "got colours, of which a store keeps none (save it as a grey PNG file and use that everywhere)"
        raise file_error(
            path, f"must hold the grey levels that the camera gave; {fault if colour else error}"
        ) from error
    return image


def inspect_file(path: Path, *, full_scale: float | None = None) -> dict[str, Any]:
    """The fields of `IncomingPress` for a checked file; errors as `read_frame`."""
    image = read_frame(path, full_scale=full_scale)
    return {
        "path": path,
        "sha256": image.settings["sha256"],
        "frame": hashlib.sha256(frame_bytes(image)).hexdigest(),
        "full_scale": full_scale,
    }


def modification_time(path: Path) -> datetime:
    try:
        return datetime.fromtimestamp(path.stat().st_mtime, UTC)
    except (OSError, ValueError, OverflowError) as error:
        raise file_error(path, f"must tell when it was written; got: {error}") from error


def stored_calibration(store: Store, cited: str) -> ProbeCalibration | None:
    """The calibration of this identity in a store, or None; `RecordsError` when it is damaged."""
    with store.database.reading() as connection:
        result = connection.execute(select(calibration_table.c.id).where(calibration_table.c.id == cited)).first()
    return None if result is None else store.calibration(cited)


def cited_calibration(
    source: Path, citation: Any, given: ImportOptions
) -> tuple[ProbeCalibration | None, tuple[str, ...]]:
    """The calibration that a file cites, or None, and notes.

    `FileInputError` when the citation is invalid, `InputError` when the user gave another calibration.
    """
    if citation is None:
        return given.calibration, ()
    if not isinstance(citation, dict) or not isinstance(citation.get("sha256"), str):
        raise file_error(source, f"must cite its calibration by its SHA-256; got {citation!r:.80}")
    requested = citation["sha256"]
    if given.calibration is not None:
        if calibration_sha256(given.calibration) != requested:
            raise InputError(
                f"--calibration must be the one that {printable_path(source)} cites, {requested[:12]}; got "
                f"{calibration_sha256(given.calibration)[:12]} (leave it out, or find the other)"
            )
        return given.calibration, ()
    result = given.calibration_of(requested)
    if result is not None:
        return result, ()
    name = str(citation.get("name", ""))[:60]
    return None, (f"the calibration {name!r} ({requested[:12]}) is not in this store: give its file by --calibration",)
