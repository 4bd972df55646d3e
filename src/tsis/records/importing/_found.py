"""What an import found: frames that were looked through, and what is known of them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from sqlalchemy import select

from tsis.calibration.file import calibration_sha256
from tsis.errors import FileInputError, InputError
from tsis.files import free_to_json, printable_path
from tsis.instrument import read_image
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
LONGEST_FILE_NAME = 255  # bytes, as file systems take them


def no_calibration(_cited: str) -> ProbeCalibration | None:
    """Knows none."""
    return None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImportOptions:
    """What a person says of the frames, where their files do not say it themselves.

    Parameters
    ----------
    role
        As of `StoredPress`.
    force_n
        One for all image files, or one for each.
    mm_per_pixel
        Size (x, y) of a pixel on the face in mm.
    probe
        Name of the probe.
    calibration
        The calibration in force.
    taken
        When image files were taken; by default when each was written.
    calibration_of
        Looks a calibration up by the SHA-256 that a file cites.
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
    """A frame that waits to be stored: its file was read and found whole.

    Parameters
    ----------
    path
        Of its file.
    sha256
        Of the file as it was looked through.
    frame
        SHA-256 under which a store keeps it.
    full_scale
        Grey level at which the camera clips; None for that of the file.
    role, taken, name, force_n, mm_per_pixel, probe, calibration, flags, settings
        As of `StoredPress`.
    """

    path: Path
    sha256: str
    frame: str
    role: str
    taken: datetime
    name: str
    full_scale: float | None = None
    force_n: float | None = None
    mm_per_pixel: tuple[float, float] | None = None
    probe: str = ""
    calibration: ProbeCalibration | None = None
    flags: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "settings", MappingProxyType(dict(self.settings)))
        free_to_json(self.settings, "settings")
        StoredPress(  # which refuses, before anything is stored, what no press may be
            frame=self.frame,
            rows=1,
            columns=1,
            full_scale=255.0 if self.full_scale is None else self.full_scale,
            axis_px=(0.0, 0.0),
            **{
                name: getattr(self, name)
                for name in ("role", "taken", "name", "force_n", "mm_per_pixel", "probe", "flags")
            },
        )

    def image(self) -> TactileImage:
        """The frame, read again; `FileInputError` when its file was changed since it was looked through."""
        image = read_frame(self.path, full_scale=self.full_scale)
        if image.settings["sha256"] != self.sha256:
            raise FileInputError(
                f"{printable_path(self.path)} must be as it was looked through; it was changed meanwhile"
            )
        return replace(
            image,
            force_n=self.force_n,
            mm_per_pixel=self.mm_per_pixel,
            name=self.name,
            settings={**self.settings, "file": image.name, "sha256": self.sha256},
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestedEstimate:
    """The estimate that came with frames, to be made again from them.

    Parameters
    ----------
    kind, probe, options
        As of `StoredEstimate`.
    calibration
        With which it is made.
    """

    kind: str
    probe: str
    calibration: ProbeCalibration
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImportBatch:
    """Frames of one target that came together.

    Parameters
    ----------
    source
        Where they were found.
    kind
        What that is, in words.
    presses
        The frames in the order in which the estimate takes them.
    number
        Which target the files name; None where they name none.
    name, truth
        As of `Target`, for a new one.
    simulated
        Whether it is a virtual phantom that was pressed, of which a store of subjects holds none.
    estimate
        What to estimate from them; None for nothing.
    record
        Of a bundle all that is in it, in place of presses.
    notes
        One sentence for each thing to know.
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
    """A frame as a store can keep it: grey, of whole levels.

    Raises
    ------
    FileInputError
        When it is no readable image file, or one in colour.
    """
    image = read_image(path)
    if full_scale is not None:
        image = replace(image, full_scale=full_scale)
    try:
        frame_bytes(image)
    except InputError as error:
        colour = image.settings.get("kind") == "colour"
        raise FileInputError(
            f"{printable_path(path)} must hold the grey levels that the camera gave; "
            + (
                "got colours, of which a store keeps none (save it as a grey PNG file and use that everywhere)"
                if colour
                else f"{error}"
            )
        ) from error
    return image


def inspect_folder(path: Path, *, full_scale: float | None = None) -> dict[str, Any]:
    """What `IncomingPress` says of the file itself, after it was read and found whole; errors as `read_frame`."""
    image = read_frame(path, full_scale=full_scale)
    return {
        "path": path,
        "sha256": image.settings["sha256"],
        "frame": hashlib.sha256(frame_bytes(image)).hexdigest(),
        "full_scale": full_scale,
    }


def own_file(folder: Path, name: str) -> Path:
    """The file of that name in a folder; names that lead elsewhere, and links, are refused.

    Raises
    ------
    FileInputError
        When the name is none of a file of the folder itself.
    """
    path = folder / name
    if not _is_safe_name(name) or name in ("", ".", ".."):
        raise FileInputError(f"{printable_path(folder)} must name files of its own; it names {name!r:.80}")
    if path.is_symlink():
        raise FileInputError(f"{printable_path(path)} must be a file of its own; it is a link that leads elsewhere")
    return path


def _is_safe_name(name: str) -> bool:
    return name.isprintable() and len(name.encode()) <= LONGEST_FILE_NAME and not any(mark in name for mark in "/\\")


def written(path: Path) -> datetime:
    """When a file was written last."""
    try:
        return datetime.fromtimestamp(path.stat().st_mtime, UTC)
    except (OSError, ValueError, OverflowError) as error:
        raise FileInputError(f"{printable_path(path)} must tell when it was written; got: {error}") from error


def stored_calibration(store: Store, cited: str) -> ProbeCalibration | None:
    """The calibration of that identity in a store; None where it is not in it, `RecordsError` when it is damaged."""
    with store.database.reading() as connection:
        result = connection.execute(select(calibration_table.c.id).where(calibration_table.c.id == cited)).first()
    return None if result is None else store.calibration(cited)


def cited_calibration(
    source: Path, citation: Any, given: ImportOptions
) -> tuple[ProbeCalibration | None, tuple[str, ...]]:
    """The calibration, and what to know when it is not to be had.

    Raises
    ------
    FileInputError
        When the citation is none.
    InputError
        When another calibration was given than the files cite.
    """
    if citation is None:
        return given.calibration, ()
    if not isinstance(citation, dict) or not isinstance(citation.get("sha256"), str):
        raise FileInputError(f"{printable_path(source)} must cite its calibration by its SHA-256; got {citation!r:.80}")
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
