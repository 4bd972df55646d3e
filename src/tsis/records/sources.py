"""Frames and targets in files of commands and cameras, checked for an import."""

from __future__ import annotations

import csv
import hashlib
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from itertools import chain
from typing import TYPE_CHECKING, Any, TypeVar

from sqlalchemy import select

from tsis.__about__ import CALIBRATION_FILE, LARGEST_TARGET
from tsis.calibration.file import calibration_sha256, read_calibration
from tsis.calibration.frames import PICTURES
from tsis.catalog.probes import load_probe
from tsis.errors import FileInputError, InputError
from tsis.files.json_values import free_to_json, from_json_value
from tsis.files.reading import file_error, own_file, printable_name, printable_path, read_bytes, read_object, written_by
from tsis.files.result_schemas import require_known_schema
from tsis.files.tables import read_csv_rows
from tsis.instrument.image_files import read_image
from tsis.instrument.recording import (
    RECORDING_COLUMNS,
    RECORDING_FORMAT,
    RECORDING_INDEX,
    RECORDING_SUMMARY,
    RECORDING_VERSION,
    VIDEO_NAME,
)
from tsis.instrument.snapshot import RAW_ENDINGS, SIDECAR_FORMAT, SIDECAR_VERSION
from tsis.mapping.scan_folder import POSE_COLUMNS, POSES_FILE
from tsis.model.image import grey_sha256
from tsis.model.require import freeze_mappings, require_integer, require_one_of
from tsis.records.blobs import frame_bytes
from tsis.records.places import NUMBERS as PLACE_NUMBERS
from tsis.records.places import place_settings
from tsis.records.schema import calibration_table
from tsis.records.target import DOCUMENTS, read_bundle
from tsis.records.values import ROLES, StoredPress, require_moment

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from tsis.calibration.file import ProbeCalibration
    from tsis.model.image import TactileImage
    from tsis.records.store import Store
    from tsis.records.values import TargetRecord


MOST_FRAMES = 100_000  # of one import
TARGET = "target"  # role where nothing says another
SCAN_ROLES = {"press": "target", "reference": "plain"}  # by the kind of a press in poses.csv


def no_calibration(_cited: str) -> ProbeCalibration | None:
    """A lookup without any calibration."""
    return None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImportOptions:
    """Metadata from the user, for frames whose files lack it; other fields as in `StoredPress`.

    Files that say a value themselves refuse another. ``role`` is ``"target"`` by default. ``force_n`` has a force for
    all image files, or one for each. ``taken`` is the time of image files, by default their modification time.
    ``calibration_of`` finds a calibration by the SHA-256 that a file cites.
    """

    role: str | None = None
    force_n: tuple[float, ...] = ()
    mm_per_pixel: tuple[float, float] | None = None
    probe: str = ""
    calibration: ProbeCalibration | None = None
    taken: datetime | None = None
    calibration_of: Callable[[str], ProbeCalibration | None] = no_calibration


CHANGED_LATER = ("role", "force_n")  # what an edit of a stored press can change


def refuse_said(source: Path, kind: str, options: ImportOptions, names: Iterable[str]) -> None:
    """Raise `InputError` for the first of these options that was given: files of this kind say it themselves."""
    for name in names:
        value = getattr(options, name)
        if value is None or value in ((), ""):
            continue
        option = {"mm_per_pixel": "--scale-mm"}.get(name, f"--{name.replace('_', '-')}")
        shown = value.name if name == "calibration" else ", ".join(map(str, value)) if type(value) is tuple else value
        cure = "; tsis records edit changes a stored press" if name in CHANGED_LATER else ""
        raise InputError(
            f"{option} must not be given for {printable_path(source)}, {kind}, which says it itself; got "
            f"{shown!s:.80} (leave it out{cure})"
        )


def scale_of_frames(options: ImportOptions, calibration: ProbeCalibration | None) -> tuple[float, float] | None:
    """The scale of the calibration, else that of the user; `InputError` where both have one."""
    if calibration is None or calibration.scale is None:
        return options.mm_per_pixel
    if options.mm_per_pixel is not None:
        raise InputError("--scale-mm is not used with this calibration, which holds the scale; leave it out")
    return calibration.scale.mm_per_pixel


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
    """When a file was last written; `FileInputError` when that is unreadable."""
    try:
        return datetime.fromtimestamp(path.stat().st_mtime, UTC)
    except (OSError, ValueError, OverflowError) as error:
        raise file_error(path, f"must tell when it was written; got: {error}") from error


def stored_calibration(store: Store, cited: str) -> ProbeCalibration | None:
    """The calibration of this identity in a store, or None; `RecordsError` when it is damaged."""
    with store.database.reading() as connection:
        row = connection.execute(select(calibration_table.c.id).where(calibration_table.c.id == cited)).first()
    return None if row is None else store.calibration(cited)


def cited_calibration(
    source: Path, citation: Any, options: ImportOptions
) -> tuple[ProbeCalibration | None, tuple[str, ...]]:
    """The calibration that a file cites, or None, and notes.

    `FileInputError` when the citation is invalid, `InputError` when the user gave another calibration.
    """
    if citation is None:
        return options.calibration, ()
    if not isinstance(citation, dict) or not isinstance(citation.get("sha256"), str):
        raise file_error(source, f"must cite its calibration by its SHA-256; got {citation!r:.80}")
    cited = citation["sha256"]
    if options.calibration is not None:
        if calibration_sha256(options.calibration) != cited:
            raise InputError(
                f"--calibration must be the one that {printable_path(source)} cites, {cited[:12]}; got "
                f"{calibration_sha256(options.calibration)[:12]} (leave it out, or find the other)"
            )
        return options.calibration, ()
    calibration = options.calibration_of(cited)
    if calibration is not None:
        return calibration, ()
    name = str(citation.get("name", ""))[:60]
    return None, (f"the calibration {name!r} ({cited[:12]}) is not in this store: give its file by --calibration",)


def sidecar_of(path: Path) -> Path | None:
    """The sidecar of a snapshot, from the sidecar itself or one of its images; None for other files."""
    if path.suffix == ".json":
        return path
    beside = path.with_name(f"{path.stem.removesuffix('-raw')}.json")
    try:
        return beside if read_object(beside).get("format") == SIDECAR_FORMAT else None
    except FileInputError:
        return None


def snapshot_folder(folder: Path, options: ImportOptions, progress: Callable[[], None]) -> tuple[ImportBatch, ...]:
    """Snapshots in a folder and in the folders of targets in it."""
    try:
        subfolders = sorted(path for path in folder.iterdir() if path.is_dir() and not path.is_symlink())
        sidecars = [path for place in (folder, *subfolders) for path in sorted(place.glob("*.json"))]
    except OSError as error:
        raise file_error(folder, f"must be a folder that can be read; got: {error.strerror}") from error
    if len(sidecars) > MOST_FRAMES:
        raise file_error(folder, f"must hold at most {MOST_FRAMES} snapshots; it holds {len(sidecars)}")
    unfinished = [path for path in sidecars if not path.is_symlink() and path.stat().st_size == 0]
    batches = snapshots([path for path in sidecars if path not in unfinished], options, progress, single=False)
    if not batches or not unfinished:
        return batches
    note = (
        f"{len(unfinished)} snapshots in {printable_path(folder)} were cut short while they were saved and are left out"
    )
    return (*batches[:-1], replace(batches[-1], notes=(*batches[-1].notes, note)))


def snapshots(
    sidecars: Iterable[Path], options: ImportOptions, progress: Callable[[], None], *, single: bool = True
) -> tuple[ImportBatch, ...]:
    """A batch for each target that these sidecars name; with ``single`` other JSON files are an error.

    `FileInputError` when a sidecar is damaged, or its frame differs from its hash.
    """
    targets: dict[int, list[IncomingPress]] = {}
    said = ("force_n", "taken")
    notes: dict[int, dict[str, None]] = {}
    first: dict[int, Path] = {}
    for sidecar in sidecars:
        document = read_object(own_file(sidecar.parent, sidecar.name))
        if document.get("format") != SIDECAR_FORMAT:
            if not single:
                continue
            raise file_error(
                sidecar, f"must be the sidecar of a snapshot ({SIDECAR_FORMAT}); got {document.get('format')!r:.60}"
            )
        refuse_said(sidecar, "a snapshot", options, said)
        if document.get("role") not in (None, options.role):
            refuse_said(sidecar, f"a snapshot of role {document['role']!r:.40}", options, ("role",))
        with written_by("tsis acquire", sidecar):
            target, press, of_press = _snapshot(sidecar, document, options)
        targets.setdefault(target, []).append(press)
        notes.setdefault(target, {}).update(dict.fromkeys(of_press))
        first.setdefault(target, sidecar.parent)
        progress()
    return tuple(
        ImportBatch(
            source=first[target], kind="snapshots", presses=tuple(presses), number=target, notes=tuple(notes[target])
        )
        for target, presses in targets.items()
    )


def _snapshot(
    sidecar: Path, document: dict[str, Any], options: ImportOptions
) -> tuple[int, IncomingPress, tuple[str, ...]]:
    if document["version"] != SIDECAR_VERSION:
        raise InputError(f"version must be {SIDECAR_VERSION}; got {document['version']!r:.20}")
    target = require_integer("target", document["target"], 1, LARGEST_TARGET)
    hashes: dict[str, Any] = document["sha256"]
    ending = next((item for item in RAW_ENDINGS if item in hashes), None)
    if ending is None:
        raise InputError(f"sha256 must tell of a raw frame; got {sorted(hashes)!r:.80}")
    raw = own_file(sidecar.parent, f"{sidecar.stem}{ending}")
    checked = inspect_file(raw, full_scale=from_json_value(float, document["full_scale"], "snapshot.full_scale"))
    if checked["sha256"] != hashes[ending]:
        raise file_error(raw, "must be as it was saved; its content does not match its sidecar")
    known, notes = cited_calibration(sidecar, document.get("calibration"), options)
    scale = scale_of_frames(options, known)
    settings: dict[str, Any] = {
        name: document[name] for name in ("camera", "sequence", "time_s", "calibration") if name in document
    }
    press = IncomingPress(
        **checked,
        role=options.role or TARGET
        if document.get("role") is None
        else require_one_of("role", document["role"], ROLES),
        taken=from_json_value(datetime, document["taken"], "snapshot.taken"),
        name=printable_name(raw),
        force_n=_force_n(document.get("force")),
        mm_per_pixel=scale,
        probe=options.probe or ("" if known is None else known.probe) or _probe(document),
        calibration=known,
        flags=tuple(from_json_value(str, flag["name"], "flag.name") for flag in document.get("flags") or ()),
        settings=dict(document["settings"]) | settings,
    )
    return target, press, notes


def _probe(document: dict[str, Any]) -> str:
    return "" if document.get("probe") is None else from_json_value(str, document["probe"], "snapshot.probe")


def _force_n(force: Any) -> float | None:
    """The force of the gauge, at least 0: a press does not pull."""
    return None if force is None else max(0.0, from_json_value(float, force["force_n"], "force.force_n"))


LARGEST_INDEX_BYTES = 64 * 2**20
FORCE = "force_n"
CUT_SHORT = "the recording was cut short before its report was written; its frames are all that its index tells of"


def recording(folder: Path, options: ImportOptions, progress: Callable[[], None]) -> ImportBatch:
    """The frames of a recording, with the force of a gauge.

    A recording has its start time and the delay of each frame. In an interrupted recording, which has no start
    time, the modification time of the index is that of the last frame.

    `FileInputError` when it is no such folder, is a video, or its index does not fit its frames.
    """
    refuse_said(folder, "a recording", options, ("force_n", "taken"))
    summary = _summary(folder)
    rows = _rows(own_file(folder, RECORDING_INDEX))
    kept = None if summary is None else summary["report"]["kept"]
    if kept is not None and kept != len(rows):
        raise file_error(
            folder / RECORDING_INDEX, f"must tell of the {kept!r:.20} frames of the report; it tells of {len(rows)}"
        )
    known, notes = cited_calibration(folder / RECORDING_SUMMARY, (summary or {}).get("calibration"), options)
    scale = scale_of_frames(options, known)
    camera = str((summary or {}).get("camera", ""))[:200]
    moment_then, then_s = _clock(folder, summary, last_s=float(rows[-1]["arrived_s"]))
    presses = []
    for row in rows:
        path = own_file(folder, row["kept_in"])
        presses.append(
            IncomingPress(
                **inspect_file(path, full_scale=_full_scale(summary)),
                role=options.role or TARGET,
                taken=_moment(moment_then, float(row["arrived_s"]) - then_s),
                name=path.name,
                force_n=max(0.0, float(row[FORCE])) if row.get(FORCE) else None,
                mm_per_pixel=scale,
                probe=options.probe or ("" if known is None else known.probe),
                calibration=known,
                settings={"camera": camera, "sequence": row["sequence"], "time_s": row["time_s"]},
            )
        )
        progress()
    notes = notes if summary is not None else (*notes, CUT_SHORT)
    return ImportBatch(source=folder, kind="recording", presses=tuple(presses), notes=notes)


def _summary(folder: Path) -> dict[str, Any] | None:
    source = own_file(folder, RECORDING_SUMMARY)
    if not source.exists():
        return None
    document = read_object(source)
    if document.get("format") != RECORDING_FORMAT or document.get("version") != RECORDING_VERSION:
        raise file_error(
            source,
            f"must be of {RECORDING_FORMAT} {RECORDING_VERSION}; got {document.get('format')!r:.60} "
            f"{document.get('version')!r:.20}",
        )
    if not isinstance(document.get("report"), dict) or "kept" not in document["report"]:
        raise file_error(source, "must hold a report with the number of frames; it does not")
    return document


def _rows(path: Path) -> list[dict[str, str]]:
    try:
        lines = read_bytes(path, most=LARGEST_INDEX_BYTES).decode().splitlines()
        if len(lines) > MOST_FRAMES + 1:
            raise file_error(path, f"must tell of at most {MOST_FRAMES} frames; it has {len(lines)} lines")
        reader = csv.DictReader(lines, strict=True)
        rows = list(reader)
    except (UnicodeDecodeError, csv.Error) as error:
        raise file_error(path, f"must be a table of comma-separated values; got: {error}") from error
    if not rows or not set(RECORDING_COLUMNS) <= set(reader.fieldnames or ()):
        raise file_error(path, f"must have the columns {', '.join(RECORDING_COLUMNS)} and a frame; it has not")
    for at, row in enumerate(rows, start=2):
        _require_sound(path, at, row)
    if len({row["kept_in"] for row in rows}) < len(rows):
        raise file_error(path, "must name every frame once; it names one twice")
    return rows


def _require_sound(path: Path, at: int, row: dict[str, Any]) -> None:
    if None in row or None in row.values():
        raise file_error(path, f"must have one value a column; line {at} has more or fewer")
    if row["kept_in"].startswith(f"{VIDEO_NAME}#"):
        raise file_error(
            path.parent,
            "must be a recording of single frames; it is a video, of which a store keeps none (record without --video, "
            "or save the frames that you want as PNG files)",
        )
    for name in ("arrived_s", FORCE):
        if name == "arrived_s" or row.get(name):
            try:
                from_json_value(float, float(row[name]), name)
            except ValueError as error:
                raise file_error(path, f"must hold a finite {name}; line {at} has {row[name]!r:.40}") from error


def _full_scale(summary: dict[str, Any] | None) -> float | None:
    mode = (summary or {}).get("mode")
    if not isinstance(mode, dict) or "full_scale" not in mode:
        return None
    return from_json_value(float, mode["full_scale"], "mode.full_scale")


def _clock(folder: Path, summary: dict[str, Any] | None, *, last_s: float) -> tuple[datetime, float]:
    """A time of day, and ``arrived_s`` at that time."""
    if summary is None:
        return modification_time(folder / RECORDING_INDEX), last_s
    try:
        begun = from_json_value(datetime, summary["begun"], f"{RECORDING_SUMMARY}.begun")
        require_moment("begun", begun)
        return begun, from_json_value(float, summary["begun_s"], f"{RECORDING_SUMMARY}.begun_s")
    except (ValueError, KeyError) as error:
        raise file_error(folder / RECORDING_SUMMARY, f"must tell when it began; {error}") from error


def _moment(then: datetime, after_s: float) -> datetime:
    try:
        return then + timedelta(seconds=after_s)
    except OverflowError as error:
        raise FileInputError(
            f"times of a recording must lie within it; got one {abs(after_s):g} s away from it"
        ) from error


Value = TypeVar("Value")
RESULT, UNTOUCHED = "result.json", "untouched.png"
MOST_PRESSES = 1000
TRUTH = ("diameter_mm", "depth_mm", "young_kpa")


def result_folder(folder: Path, progress: Callable[[], None]) -> ImportBatch:
    """The presses in a folder of ``tsis demo``, each checked by the hash in the result.

    `FileInputError` when it is no such folder, or a frame differs; `CalibrationError` when the calibration was changed.
    """
    source = own_file(folder, RESULT)
    document = read_object(source)
    require_known_schema(document, printable_path(source))
    with written_by("tsis demo", source):
        return _batch(folder, document, progress)


def _batch(folder: Path, document: dict[str, Any], progress: Callable[[], None]) -> ImportBatch:
    command = document.get("command")
    if command != "demo":
        raise file_error(
            folder / RESULT,
            f"must be of tsis demo, whose folder holds its frames; got one of {command!r:.40} (name the frames, or "
            "repeat the command with --save)",
        )
    provenance = document["estimate"]["provenance"]
    calibration = read_calibration(own_file(folder, CALIBRATION_FILE))
    probe, phantom = from_json_value(str, provenance["probe"]["name"], "probe.name"), document["simulated"]["phantom"]
    presses = list(_presses(folder, provenance, calibration, probe, progress))
    inclusion = phantom.get("inclusion")
    names = () if inclusion is None else TRUTH
    truth = {name: from_json_value(float, inclusion[name], f"inclusion.{name}") for name in names}
    options = {"prior": dict(provenance["prior"]), "strain": from_json_value(str, provenance["strain"], "strain")}
    estimate = RequestedEstimate(kind="inclusion", probe=probe, calibration=calibration, options=options)
    _require_estimable(estimate)
    return ImportBatch(
        source=folder,
        kind="virtual presses",
        presses=tuple(presses),
        name=from_json_value(str, phantom["name"], "phantom.name"),
        truth=truth,
        simulated=True,
        estimate=estimate,
    )


def _require_estimable(estimate: RequestedEstimate) -> None:
    """Check the inputs of the estimate before anything is stored."""
    from tsis.records.recomputation import require_options  # slow to import, rarely needed

    load_probe(estimate.probe)
    estimate.calibration.cited_response("")
    require_options(estimate.kind, estimate.options)


def _presses(
    folder: Path, provenance: dict[str, Any], calibration: ProbeCalibration, probe: str, progress: Callable[[], None]
) -> Iterator[IncomingPress]:
    taken = modification_time(folder / RESULT)
    entries = [("target", item) for item in provenance["images"]] + [
        ("plain", item) for item in provenance["reference"]
    ]
    if not provenance["images"] or len(entries) > MOST_PRESSES:
        raise InputError(
            f"it must tell of a press on the phantom and of at most {MOST_PRESSES} in all; got {len(entries)}"
        )
    scale = None
    for at, (role, entry) in enumerate(entries):
        path = own_file(folder, from_json_value(str, entry["name"], f"{role}.name"))
        scale = _optional(tuple[float, float], entry["mm_per_pixel"], f"{role}.mm_per_pixel")
        grey = read_frame(path).grey
        if grey_sha256(grey) != entry["sha256"]:
            raise file_error(path, "must be the frame that was estimated; its grey levels are others")
        yield IncomingPress(
            **inspect_file(path),
            role=role,
            taken=taken + timedelta(microseconds=at),  # unknown; this preserves their order
            name=path.name,
            force_n=_optional(float, entry["force_n"], f"{role}.force_n"),
            mm_per_pixel=scale,
            probe=probe,
            calibration=calibration,
            settings=dict(entry["settings"]),
        )
        progress()
    untouched = own_file(folder, UNTOUCHED)
    if untouched.exists():
        yield IncomingPress(
            **inspect_file(untouched),
            role="untouched",
            taken=taken + timedelta(microseconds=len(entries)),
            name=UNTOUCHED,
            force_n=0.0,
            mm_per_pixel=scale,
            probe=probe,
            calibration=calibration,
        )
        progress()


def _optional(kind: type[Value], document: Any, where: str) -> Value | None:
    return None if document is None else from_json_value(kind, document, where)


def image_files(paths: Sequence[Path], options: ImportOptions, progress: Callable[[], None]) -> ImportBatch:
    """Image files of presses on one target.

    `FileInputError` when a file is no grey image, `InputError` when the number of forces does not fit that of files.
    """
    if len(options.force_n) not in (0, 1, len(paths)):
        raise InputError(f"--force-n must be given once, or once for each of {len(paths)}; got {len(options.force_n)}")
    forces = list(options.force_n or [None]) * (len(paths) if len(options.force_n) < 2 else 1)
    scale = scale_of_frames(options, options.calibration)
    presses = []
    for path, force in zip(paths, forces, strict=True):
        presses.append(
            IncomingPress(
                **inspect_file(path),
                role=options.role or TARGET,
                taken=options.taken or modification_time(path),
                name=printable_name(path)[:200],
                force_n=force,
                mm_per_pixel=scale,
                probe=options.probe or ("" if options.calibration is None else options.calibration.probe),
                calibration=options.calibration,
            )
        )
        progress()
    return ImportBatch(source=paths[0], kind="image files", presses=tuple(presses))


def scanned(folder: Path, options: ImportOptions, progress: Callable[[], None]) -> ImportBatch:
    """The frames of a scan, each with its place; `FileInputError` for presses that are no frames."""
    refuse_said(folder, "a scan", options, ("role", "force_n"))
    presses, notes = [], []
    scale = scale_of_frames(options, options.calibration)
    calibrated = "" if options.calibration is None else options.calibration.probe
    for row in read_csv_rows(folder / POSES_FILE, ("file", "x_mm", "y_mm"), POSE_COLUMNS):
        name = row.text("name") or row.text("file")
        if row.number("x_mm") is None or row.number("y_mm") is None:
            notes.append(f"{name} has no place and is left out.")
            continue
        path = own_file(folder, row.text("file"))
        if path.suffix.lower() not in PICTURES:
            raise file_error(path, "must be a frame to be stored; pressures and forces stay in their folder")
        if (kind := row.text("kind") or "press") not in SCAN_ROLES:
            raise row.refused("kind", " or ".join(SCAN_ROLES), kind)
        image = IncomingPress(
            **inspect_file(path),
            role=SCAN_ROLES[kind],
            taken=options.taken or modification_time(path),
            name=printable_name(path)[:200] if not row.text("name") else row.text("name")[:200],
            force_n=row.number("force_n"),
            mm_per_pixel=scale,
            probe=options.probe or row.text("probe") or calibrated,
            calibration=options.calibration,
            settings=place_settings({name: row.number(name) for name in PLACE_NUMBERS}),
        )
        presses.append(image)
        progress()
    return ImportBatch(source=folder, kind="scan", presses=tuple(presses), name=folder.name, notes=tuple(notes))


def find_import_batches(
    paths: Sequence[Path], options: ImportOptions, *, progress: Callable[[int], None] | None = None
) -> tuple[ImportBatch, ...]:
    """Check all files that paths name: folders that tsis wrote, sidecars of snapshots, image files.

    ``options`` has metadata from the user; ``progress`` is called with the number of frames.

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

    if options.role is not None:
        require_one_of("role of a press", options.role, ROLES)
    paths = list({path.absolute(): path for path in paths}.values())
    folders = [path for path in paths if _is_folder(path)]
    files = [path for path in paths if path not in folders]
    zipped = [path for path in files if path.suffix.lower() == ".zip"]
    sidecars = {path: sidecar_of(path) for path in files if path not in zipped}
    named = dict.fromkeys(path for path in sidecars.values() if path is not None)
    images = [path for path, sidecar in sidecars.items() if sidecar is None]
    batches = chain(
        *(_folder(folder, options, count) for folder in folders),
        *(_bundle(path, options) for path in zipped),
        snapshots(named, options, count),
        [image_files(images, options, count)] if images else (),
    )
    return tuple(batches)


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError as error:
        raise file_error(path, f"must name a file or folder; got: {error.strerror}") from error


def _folder(folder: Path, options: ImportOptions, count: Callable[[], None]) -> tuple[ImportBatch, ...]:
    if all((folder / name).exists() for name in DOCUMENTS):
        return _bundle(folder, options)
    if (folder / RESULT).exists():
        _refuse_any(folder, "a folder of tsis demo", options)
        return (result_folder(folder, count),)
    if (folder / RECORDING_INDEX).exists() or (folder / RECORDING_SUMMARY).exists():
        return (recording(folder, options, count),)
    if (folder / POSES_FILE).exists():
        return (scanned(folder, options, count),)
    batches = snapshot_folder(folder, options, count)
    if not batches:
        raise file_error(
            folder,
            "must be a folder that tsis wrote (demo, acquire, records export --format bundle) or a scan; it holds "
            "nothing of these (name image files one by one, with --role and what is known of them)",
        )
    return batches


def _refuse_any(source: Path, kind: str, options: ImportOptions) -> None:
    refuse_said(source, kind, options, ("role", "force_n", "mm_per_pixel", "probe", "calibration", "taken"))


def _bundle(path: Path, options: ImportOptions) -> tuple[ImportBatch, ...]:
    _refuse_any(path, "a bundle", options)
    record = read_bundle(path)
    return (ImportBatch(source=path, kind="bundle", presses=(), record=record),)
