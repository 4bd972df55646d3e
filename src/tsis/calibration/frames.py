"""Frames of a target from a folder, with the forces and roles of its tables, and a calibration applied to them."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from tsis.__about__ import LARGEST_TARGET
from tsis.calibration.camera_reference import CameraReference
from tsis.calibration.file import ProbeCalibration, calibration_sha256, parse_calibration, read_calibration
from tsis.calibration.force_line import ForceLine, total_grey
from tsis.catalog.probes import list_probes, load_probe, parse_probe
from tsis.errors import FileInputError, ImageMismatchError, InputError
from tsis.files.json_values import from_json_value
from tsis.files.reading import as_path, file_error, own_file, printable_path, read_bytes, read_object, written_by
from tsis.files.result_schemas import require_known_schema
from tsis.files.tables import read_csv_rows
from tsis.instrument.image_files import read_image
from tsis.instrument.snapshot import RAW_ENDINGS, SIDECAR_FORMAT, SIDECAR_VERSION
from tsis.model.budget import QuantityBudget, UncertaintyComponent
from tsis.model.content import ContentValue
from tsis.model.image import grey_sha256, require_pixel_scale
from tsis.model.probe import Probe
from tsis.model.require import require_integer, require_one_of, require_type

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from tsis.calibration.measured import MeasuredValue
    from tsis.instrument.acquisition import Acquisition
    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage

    CorrectedFrames = tuple[list[TactileImage], Calibration]


RESULT_FILE, UNTOUCHED_FILE = "result.json", "untouched.png"
TARGET, REFERENCE, UNTOUCHED = "target", "plain", "untouched"  # roles of frames in sidecars
BALL = "ball"  # of presses of a known ball, in exports of records
MOST_FRAMES = 1000  # of one folder
PRESSES_FILE, FRAMES_FOLDER, MANIFEST_FILE = "presses.csv", "frames", "manifest.json"
PRESS_COLUMNS = (  # the first two are needed
    *("frame file", "force (N)", "role", "pixel size x (mm)", "pixel size y (mm)", "probe", "full scale (grey level)"),
    *("frame (SHA-256)", "press", "taken", "axis x (px)", "axis y (px)", "rows (px)", "columns (px)", "flags", "name"),
    *("note", "calibration (SHA-256)", "settings (JSON)", "id", "version"),
)
PICTURES = (".png", ".bmp", ".jpg", ".jpeg", ".tif", ".tiff")


def apply_calibration(
    calibration: ProbeCalibration, frames: Sequence[TactileImage], *, identity: str, on_tissue: bool = False
) -> CorrectedFrames:
    """Correct frames by the reference and give the response with the uncertainty of forces by the force line.

    Raises `CalibrationError` when the response is missing, a force must be read and the force line or the reference is
    missing, or a frame's settings name another probe, camera or setting; `ImageMismatchError` when a frame differs in
    size, scale or full scale from those of the calibration; `InputError` when a frame lies outside the line's range, or
    is not of the reference.

    Parameters
    ----------
    calibration
        The calibration; its expiry is not checked here.
    frames
        Raw camera frames; the force line gives the force of each without one.
    identity
        SHA-256 by which results cite the calibration.
    on_tissue
        Whether the frames show tissue and not a tip or ball: its dents change the light otherwise.
    """
    frames = [_of_same_instrument(calibration, frame) for frame in frames]
    forces = [_force(calibration, frame, on_tissue=on_tissue) for frame in frames if frame.force_n is None]
    by_line = iter(forces)
    reference = calibration.reference
    corrected = frames if reference is None else [reference.corrected(frame) for frame in frames]
    ready = [frame if frame.force_n is not None else replace(frame, force_n=next(by_line).value) for frame in corrected]
    response = calibration.cited_response(identity, on_tissue=on_tissue)
    uncertainty = max((force.sd / force.value for force in forces), default=0.0)
    return ready, replace(response, force_sd=max(response.force_sd, uncertainty))


def _of_same_instrument(calibration: ProbeCalibration, frame: TactileImage) -> TactileImage:
    """The frame with the scale of the calibration, if any; frames of another instrument are refused."""
    stated = frame.settings
    calibration.require_same_instrument(
        probe=stated.get("probe"),
        camera=stated.get("camera"),
        settings={name: value for name, value in stated.items() if isinstance(value, float)},
    )
    return frame if calibration.scale is None else calibration.scale.on(frame)


def _force(calibration: ProbeCalibration, frame: TactileImage, *, on_tissue: bool) -> MeasuredValue:
    line = calibration.need(ForceLine, "a force without --force-n")
    reference = calibration.need(CameraReference, "a force without --force-n")
    total = total_grey(frame, reference, method=line.method)
    return line.soft_force_n(total) if on_tissue else line.force_n(total)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UsableCalibration(ContentValue):
    """A calibration with the identity by which results cite it."""

    calibration: ProbeCalibration
    identity: str

    @property
    def response(self) -> Calibration:
        """The response for estimates; `CalibrationError` when it was not measured."""
        return self.calibration.cited_response(self.identity)

    def _repr_html_(self) -> str:
        """The summary of the calibration."""
        return self.calibration._repr_html_()

    def pressed(self, frames: Sequence[TactileImage], *, on_tissue: bool = False) -> CorrectedFrames:
        """Corrected frames and the matching response; parameters and errors as `apply_calibration`."""
        return apply_calibration(self.calibration, frames, identity=self.identity, on_tissue=on_tissue)

    def force_budget(self, force_n: float, *, by_line: bool) -> QuantityBudget:
        """The uncertainty budget of a force in newtons: of the force line, or of a force that was stated."""
        if by_line:
            return self.calibration.need(ForceLine, "the budget of a force").budget(force_n)
        sd = self.response.force_sd
        sizes = {"standard_uncertainty": sd, "contribution": sd * force_n}
        stated = UncertaintyComponent(source="stated force", evaluation="B", distribution="normal", unit="1", **sizes)
        return QuantityBudget(name="force_n", value=force_n, unit="N", components=(stated,))

    def require_untouched(self, frames: Sequence[TactileImage]) -> None:
        """Refuse frames of the untouched probe that do not show the light of the calibration's reference.

        Raises `ImageMismatchError` for another probe, camera or mode. Without a reference nothing is compared.
        """
        if (reference := self.calibration.reference) is not None:
            for frame in frames:
                reference.require_untouched(frame)

    def require_camera(self, acquisition: Acquisition, *, stored: bool) -> None:
        """Refuse another camera or other settings; stored frames carry no camera name."""
        present = {setting.name: setting.value for setting in acquisition.settings()}
        camera = None if stored else acquisition.name
        self.calibration.require_usable(datetime.now(UTC), camera=camera, settings=present)

    def citation(self) -> dict[str, Any]:
        """Name, hash, date and expiry, for the result."""
        created, expires = self.calibration.made, self.calibration.expires
        return {
            "name": self.calibration.name,
            "sha256": self.identity,
            "made": None if created is None else created.isoformat(),
            "expires": None if expires is None else expires.isoformat(),
        }


def load_calibration(path: str | os.PathLike[str]) -> UsableCalibration:
    """Read a calibration file that may be used today.

    Raises `CalibrationError` when it is expired, dated in the future or altered; `FileInputError` when it is no such
    file.
    """
    return _usable(read_calibration(path))


def parse_usable_calibration(content: bytes, name: str) -> UsableCalibration:
    """Parse an uploaded calibration file; errors as `load_calibration`."""
    return _usable(parse_calibration(content, name))


def _usable(calibration: ProbeCalibration) -> UsableCalibration:
    calibration.require_usable(datetime.now(UTC))
    return UsableCalibration(calibration=calibration, identity=calibration_sha256(calibration))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressFrames(ContentValue):
    """Frames of one target, all by one probe, ready for an estimate.

    Attributes
    ----------
    images
        Presses on the target.
    reference
        Presses on tissue without inclusion.
    untouched
        Frames of the untouched probe.
    probe
        The probe.
    calibration
        Its response, with the uncertainty of forces that a force line gave; None where no calibration was given.
    """

    images: tuple[TactileImage, ...]
    reference: tuple[TactileImage, ...]
    untouched: tuple[TactileImage, ...]
    probe: Probe
    calibration: Calibration | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _SavedFrame:
    """A frame with what its sidecar states; an empty name is unknown."""

    file: Path
    role: str
    target: int | None
    image: TactileImage
    probe: Probe | str
    camera: str = ""


def load_frames(
    folder: str | os.PathLike[str],
    *,
    calibration: UsableCalibration | None = None,
    probe: Probe | None = None,
    target: int | None = None,
    role: str = TARGET,
    mm_per_pixel: tuple[float, float] | None = None,
) -> PressFrames:
    """Read the frames of a folder of ``tsis demo``, of snapshots of ``tsis acquire`` and the console, or of an export.

    Force, scale, role and probe come from the result file, the table ``presses.csv`` or the sidecars. Each frame is
    compared with its hash.

    Raises `FileInputError` when the folder has no frames, a frame has no sidecar or differs from its hash, or a name
    leads elsewhere; `ImageMismatchError` when frames are of several targets, probes or cameras; `CalibrationError` when
    the calibration is expired, or of another probe or camera; `InputError` when the probe is unknown.

    Parameters
    ----------
    folder
        A folder with ``result.json``, ``presses.csv`` or sidecars, or with a folder of sidecars for each target.
    calibration
        The result of `load_calibration`. It corrects the frames, and gives the scale and the forces that it contains.
    probe
        The probe; None for that of the files or of the calibration.
    target
        Number of the target; needed where the sidecars name several.
    role
        Role of frames whose sidecar names none: ``"target"``, ``"plain"`` (tissue without inclusion) or
        ``"untouched"``.
    mm_per_pixel
        Size (x, y) of a pixel on the face in mm, where neither files nor calibration contain it.
    """
    frames, pressing = _checked_frames(folder, calibration, probe, target, role, mm_per_pixel)
    return _ready(frames, pressing, calibration, mm_per_pixel)


def read_raw_frames(
    folder: str | os.PathLike[str],
    *,
    calibration: UsableCalibration | None = None,
    probe: Probe | None = None,
    mm_per_pixel: tuple[float, float] | None = None,
) -> PressFrames:
    """Frames of a folder as the camera gave them, compared with the calibration as `load_frames` compares them.

    Forces and scale are those of the files; parameters and errors as `load_frames`.
    """
    frames, pressing = _checked_frames(folder, calibration, probe, None, TARGET, mm_per_pixel)
    if calibration is not None:
        calibration.require_untouched([frame.image for frame in frames if frame.role == UNTOUCHED])
        mm_per_pixel = mm_per_pixel if calibration.calibration.scale is None else None
    return _ready(frames, pressing, None, mm_per_pixel)


def _checked_frames(
    folder: str | os.PathLike[str],
    calibration: UsableCalibration | None,
    probe: Probe | None,
    target: int | None,
    role: str,
    mm_per_pixel: tuple[float, float] | None,
) -> tuple[list[_SavedFrame], Probe]:
    """The checked frames of one target, and the probe of all."""
    require_one_of("role", role, (TARGET, REFERENCE, UNTOUCHED))
    if calibration is not None:
        require_type("calibration", calibration, UsableCalibration)
    if mm_per_pixel is not None:
        require_pixel_scale(mm_per_pixel)
    root = as_path(folder)
    try:
        is_folder = root.is_dir()
    except OSError:  # a name that is too long
        is_folder = False
    if not is_folder:
        raise file_error(root, "must be a folder of frames; it is none")
    demo, table = own_file(root, RESULT_FILE), own_file(root, PRESSES_FILE)
    if demo.exists():
        frames = list(_of_demo(root, demo))
    else:
        frames = list(_of_table(root, table, role) if table.exists() else _of_snapshots(root, role))
    frames = _of_one_target(root, frames, target)
    pressing = _one_probe(root, frames, calibration, probe)
    if calibration is not None:
        camera = _only(root, "camera", {frame.camera for frame in frames} - {""}, "choose one folder a camera") or None
        for frame in frames:
            settings = {name: value for name, value in frame.image.settings.items() if isinstance(value, float)}
            calibration.calibration.require_usable(
                datetime.now(UTC), probe=pressing.name, camera=camera, settings=settings
            )
    return frames, pressing


def _ready(
    frames: list[_SavedFrame],
    probe: Probe,
    calibration: UsableCalibration | None,
    mm_per_pixel: tuple[float, float] | None,
) -> PressFrames:
    stored = None if calibration is None else calibration.calibration.scale
    scale = mm_per_pixel if stored is None else None  # the calibration compares its scale with that of the frames
    by_role: dict[str, list[TactileImage]] = {TARGET: [], REFERENCE: [], UNTOUCHED: []}
    for frame in frames:
        image = frame.image if scale is None else replace(frame.image, mm_per_pixel=scale)
        by_role[frame.role].append(replace(image, force_n=0.0) if frame.role == UNTOUCHED else image)
    if calibration is None:
        images, reference, untouched = (tuple(by_role[name]) for name in by_role)
        return PressFrames(images=images, reference=reference, untouched=untouched, probe=probe, calibration=None)
    calibration.require_untouched(by_role[UNTOUCHED])
    results = {name: calibration.pressed(items) for name, items in by_role.items()}
    response = max((response for _, response in results.values()), key=lambda item: item.force_sd)
    images, reference, untouched = (tuple(results[name][0]) for name in by_role)
    return PressFrames(images=images, reference=reference, untouched=untouched, probe=probe, calibration=response)


def _of_demo(folder: Path, source: Path) -> Iterator[_SavedFrame]:
    """Frames of ``tsis demo`` as its result lists them."""
    document = read_object(source)
    require_known_schema(document, printable_path(source))
    if document.get("command") != "demo":
        raise file_error(
            source,
            f"must be the result of tsis demo, which saves its frames; got one of {document.get('command')!r:.40}",
        )
    with written_by("tsis demo", source):
        result = document["estimate"]["provenance"]
        probe = parse_probe(from_json_value(str, result["probe"]["name"], "probe.name"), result["probe"])
        entries = [(TARGET, item) for item in result["images"]] + [(REFERENCE, item) for item in result["reference"]]
        require_integer("the number of frames", len(entries), 1, MOST_FRAMES)
        scale = None
        for role, entry in entries:
            file = own_file(folder, from_json_value(str, entry["name"], "name"))
            scale = require_pixel_scale(from_json_value(tuple[float, float], entry["mm_per_pixel"], "mm_per_pixel"))
            force = from_json_value(float, entry["force_n"], "force_n")
            image = read_image(file, mm_per_pixel=scale, force_n=force)
            if grey_sha256(image.grey) != entry["sha256"]:
                raise file_error(file, "must be the frame that was estimated; its grey levels are others")
            strain = from_json_value(str, entry["settings"]["strain"], "strain")
            image = replace(image, settings={**image.settings, "strain": strain})
            yield _SavedFrame(file=file, role=role, target=None, image=image, probe=probe)
    untouched = own_file(folder, UNTOUCHED_FILE)
    if untouched.exists():
        image = read_image(untouched, mm_per_pixel=scale, force_n=0.0)
        yield _SavedFrame(file=untouched, role=UNTOUCHED, target=None, image=image, probe=probe)


def _of_table(folder: Path, table: Path, role: str) -> Iterator[_SavedFrame]:
    """Frames as a table of presses lists them: that of ``tsis records export``, or one of the same headings.

    Presses of a ball are left out: they say nothing of tissue.
    """
    rows = list(read_csv_rows(table, PRESS_COLUMNS[:2], PRESS_COLUMNS[2:]))
    require_integer(f"the number of frames in {printable_path(table)}", len(rows), 1, MOST_FRAMES)
    without = [row for row in rows if not row.text("role")]
    if without and len(without) < len(rows):
        raise without[0].refused("role", f"{TARGET}, {REFERENCE} or {UNTOUCHED} in each row, or in none", "")
    written = _hashes_of_manifest(folder)
    for row in rows:
        if row.text("role") == BALL:
            continue
        name = row.text("frame file")
        inside = own_file(folder, FRAMES_FOLDER) if name.startswith(f"{FRAMES_FOLDER}/") else folder
        file = own_file(inside, name.removeprefix(f"{FRAMES_FOLDER}/"))
        x, y = row.number("pixel size x (mm)"), row.number("pixel size y (mm)")
        scale = None if x is None or y is None else (x, y)
        image = read_image(file, mm_per_pixel=scale, force_n=row.number("force (N)"))
        known = {row.text("frame (SHA-256)"), written.get(name, "")} - {""}
        if known and image.settings["sha256"] not in known:
            raise file_error(
                file,
                f"must be the frame of which {printable_path(table)} states the SHA-256; its content is another (if it "
                f"was changed on purpose, empty that column and delete {MANIFEST_FILE})",
            )
        stated = row.number("rows (px)"), row.number("columns (px)")
        if any(length not in (None, own) for length, own in zip(stated, image.grey.shape, strict=True)):
            raise row.refused("rows (px) and columns (px)", f"those of the frame, {image.grey.shape}", f"{stated}")
        full_scale, probe = row.number("full scale (grey level)"), row.text("probe")
        axis = row.number("axis x (px)"), row.number("axis y (px)")
        image = replace(
            image,
            full_scale=image.full_scale if full_scale is None else full_scale,
            axis_px=image.axis_px if axis[0] is None or axis[1] is None else (axis[0], axis[1]),
            settings={**image.settings, "probe": probe},
        )
        given = require_one_of("role", row.text("role") or role, (TARGET, REFERENCE, UNTOUCHED))
        yield _SavedFrame(file=file, role=given, target=None, image=image, probe=probe)


def _hashes_of_manifest(folder: Path) -> dict[str, str]:
    """The SHA-256 of each file of an export by its name; none where the folder has no list of them."""
    manifest = own_file(folder, MANIFEST_FILE)
    if not manifest.exists():
        return {}
    files = read_object(manifest).get("files")
    if not isinstance(files, dict):
        return {}
    return {name: str(entry.get("sha256", "")) for name, entry in files.items() if isinstance(entry, dict)}


def _of_snapshots(folder: Path, role: str) -> Iterator[_SavedFrame]:
    """Frames by their sidecars, in this folder and the folders of targets in it, in the order of their names."""
    try:
        places = [folder, *sorted(path for path in folder.iterdir() if path.is_dir() and not path.is_symlink())]
        files = [path for place in places for path in sorted(place.iterdir())]
    except OSError as error:
        raise file_error(folder, f"must be a folder that can be read; got: {error.strerror}") from error
    sidecars = [path for path in files if path.suffix == ".json" and path.is_file()]
    if len(sidecars) > MOST_FRAMES:
        raise file_error(folder, f"must hold at most {MOST_FRAMES} sidecars; it holds {len(sidecars)}")
    documents = {path: read_object(own_file(path.parent, path.name)) for path in sidecars}
    documents = {path: item for path, item in documents.items() if item.get("format") == SIDECAR_FORMAT}
    described = {path.with_suffix("") for path in documents}
    for path in files:
        stem = path.with_name(path.stem.removesuffix("-raw"))
        if path.suffix.lower() in PICTURES and stem not in described:
            raise file_error(
                path,
                "must have a sidecar, the JSON file of the same name that tsis acquire writes; it has none (read a "
                "frame alone by tsis.instrument.image_files.read_image)",
            )
    if not documents:
        raise file_error(
            folder,
            "must hold the result of tsis demo, or frames with presses.csv or their sidecars; it holds none of these",
        )
    for path, document in documents.items():
        with written_by("tsis acquire", path):
            yield _snapshot(path, document, role)


def _snapshot(sidecar: Path, document: dict[str, Any], role: str) -> _SavedFrame:
    if document["version"] != SIDECAR_VERSION:
        raise InputError(f"version must be {SIDECAR_VERSION}; got {document['version']!r:.20}")
    hashes: dict[str, Any] = document["sha256"]
    ending = next((item for item in RAW_ENDINGS if item in hashes), None)
    if ending is None:
        raise InputError(f"sha256 must name a raw frame; got {sorted(hashes)!r:.80}")
    raw = own_file(sidecar.parent, f"{sidecar.stem}{ending}")
    if hashlib.sha256(read_bytes(raw)).hexdigest() != hashes[ending]:
        raise file_error(raw, "must be as it was saved; its content does not match its sidecar")
    given, force = document.get("role"), document.get("force")
    force_n = None if force is None else max(0.0, from_json_value(float, force["force_n"], "force.force_n"))
    probe, camera = _instrument(document)
    image = replace(
        read_image(raw, force_n=force_n),
        full_scale=from_json_value(float, document["full_scale"], "full_scale"),
        settings={**document["settings"], "probe": probe, "camera": camera},
    )
    return _SavedFrame(
        file=raw,
        role=role if given is None else require_one_of("role", given, (TARGET, REFERENCE, UNTOUCHED)),
        target=require_integer("target", document["target"], 1, LARGEST_TARGET),
        image=image,
        probe=probe,
        camera=camera,
    )


def _instrument(document: dict[str, Any]) -> tuple[str, str]:
    """Probe and camera of a sidecar; an empty name is unknown."""
    probe = document.get("probe")
    name = "" if probe is None else from_json_value(str, probe, "probe")
    return name, from_json_value(str, document["camera"], "camera")


def read_press_image(
    path: str | os.PathLike[str],
    *,
    mm_per_pixel: tuple[float, float] | None = None,
    force_n: float | None = None,
) -> TactileImage:
    """Read one frame, with probe, camera and settings of the sidecar of ``tsis acquire`` beside it, if any.

    They are in the image's ``settings``, with which estimates and calibrations refuse the frames of another probe.

    Raises `FileInputError` when the file is no image, is the coloured picture in place of the raw frame, or differs
    from its hash; `InputError` when the pixel size or the force lies outside its range.
    """
    file = as_path(path)
    image = read_image(file, mm_per_pixel=mm_per_pixel, force_n=force_n)
    sidecar = file.with_name(f"{file.stem.removesuffix('-raw')}.json")
    try:
        document = read_object(sidecar) if sidecar.is_file() else {}
    except FileInputError:  # a file of another program
        document = {}
    if document.get("format") != SIDECAR_FORMAT:
        return image
    with written_by("tsis acquire", sidecar):
        hashes: dict[str, Any] = document["sha256"]
        ending, own = file.name.removeprefix(sidecar.stem), dict(document["settings"])
        probe, camera = _instrument(document)
    if ending in hashes and ending not in RAW_ENDINGS:
        raw = next((name for name in RAW_ENDINGS if name in hashes), RAW_ENDINGS[0])
        raise file_error(file, f"must be the raw frame, {sidecar.stem}{raw}; it is its coloured picture")
    if ending not in hashes:
        return image
    if hashes[ending] != image.settings["sha256"]:
        raise file_error(file, "must be as it was saved; its content does not match its sidecar")
    return replace(image, settings={**own, **image.settings, "probe": probe, "camera": camera})


def _of_one_target(folder: Path, frames: list[_SavedFrame], target: int | None) -> list[_SavedFrame]:
    numbers = sorted({frame.target for frame in frames if frame.target is not None})
    if target is None:
        _only(folder, "target", {str(number) for number in numbers}, "choose one, as target=1")
        return frames
    chosen = [frame for frame in frames if frame.target == target]
    if not chosen:
        named = ", ".join(map(str, numbers)) or "none by number"
        raise InputError(
            f"target must be a number in the sidecars of {printable_path(folder)}, {named}; got {target!r:.20}"
        )
    return chosen


def _one_probe(
    folder: Path, frames: list[_SavedFrame], calibration: UsableCalibration | None, probe: Probe | None
) -> Probe:
    """The probe of all frames, from the argument, the files, or the calibration."""
    if probe is not None:
        require_type("probe", probe, Probe)
    values = [probe, *(frame.probe for frame in frames), "" if calibration is None else calibration.calibration.probe]
    names = {item.name if isinstance(item, Probe) else item for item in values if item}
    name = _only(folder, "probe", names - {""}, "a file or calibration of another probe must not be used")
    whole = [item for item in values if isinstance(item, Probe)]
    if any(asdict(item) != asdict(whole[0]) for item in whole):
        raise ImageMismatchError(
            f"{printable_path(folder)} must hold frames of the given probe; its {name!r:.60} has other layers or lamps"
        )
    if whole:
        return whole[0]
    if name not in list_probes():
        what = f"names {name!r:.60}, which is not in the catalog" if name else "names no probe"
        raise InputError(f"probe must be given where the catalog does not have it; {printable_path(folder)} {what}")
    return load_probe(name)


def _only(folder: Path, what: str, names: set[str], cure: str) -> str:
    """The one name, or an empty text without any; `ImageMismatchError` for several."""
    if len(names) > 1:
        listed = ", ".join(sorted(names))
        raise ImageMismatchError(f"{printable_path(folder)} must hold frames of one {what}; got {listed:.120} ({cure})")
    return next(iter(names), "")
