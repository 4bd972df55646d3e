"""Frames that are kept: snapshots, sequences, images of the user."""

from __future__ import annotations

import re
import time
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.calibration.frames import read_press_image
from tsis.calibration.guard.watch import check_press
from tsis.console.services.choice import PressForce
from tsis.errors import CameraError, ControlError, FileInputError, GaugeError, InputError, RecordsError, TsisError
from tsis.files.atomic import write_durably
from tsis.files.frame_names import target_folder
from tsis.files.images import encode_picture
from tsis.files.reading import file_error, printable_name, read_object
from tsis.files.result_folder import free_folder
from tsis.imaging.colour import colour_map
from tsis.imaging.contact import analyse_image
from tsis.instrument.discovery import connect
from tsis.instrument.drivers.files import IMAGE_ENDINGS, VIDEO_ENDINGS
from tsis.instrument.recording import FrameFolder, FurtherColumns, record
from tsis.instrument.snapshot import save_snapshot
from tsis.model.require import require_integer, require_number, require_one_of
from tsis.records.importing import import_batches, new_target, target_by_number, truth_note
from tsis.records.sources import ImportOptions, find_import_batches, sidecar_of
from tsis.virtual.camera import FORCE_SETTING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    from tsis.calibration.guard.limits import GuardFlag
    from tsis.console.services.camera import ActiveCalibration
    from tsis.console.services.choice import VirtualSubject
    from tsis.console.services.jobs import Job, Jobs
    from tsis.imaging.contact import ImageFinding
    from tsis.instrument.acquisition import Acquisition, ReceivedFrame
    from tsis.instrument.force_log import ForceLog
    from tsis.instrument.snapshot import Snapshot
    from tsis.model.image import TactileImage
    from tsis.records.store import Store
    from tsis.records.values import StoredPress, Target


HOLDS_S = 1.0  # a reading older than this tells nothing of the press now
GAUGE_WAIT_S = 1.0


def force_at(frame: ReceivedFrame, log: ForceLog | None, typed_n: float | None) -> PressForce | None:
    """The force at a frame of the live view: the newest reading, without waiting for the next one."""
    if log is not None:
        readings = log.readings(since_s=frame.arrived_s - HOLDS_S)
        return PressForce(value_n=max(0.0, readings[-1].force_n), source="gauge") if readings else None
    if frame.frame.settings.get("source") == "virtual" and FORCE_SETTING in frame.frame.settings:
        return PressForce(value_n=float(frame.frame.settings[FORCE_SETTING]), source="virtual")
    return None if typed_n is None else PressForce(value_n=typed_n, source="typed")


def gauge_force(log: ForceLog, frame: ReceivedFrame, *, wait_s: float = GAUGE_WAIT_S) -> PressForce:
    """The gauge's force at a saved frame, once the reading after it has come; `GaugeError` when none comes."""
    log.wait_until(frame.arrived_s, timeout_s=wait_s)
    return PressForce(value_n=max(0.0, log.at(frame.arrived_s).force_n), source="gauge")


SHORTEST_SEQUENCE_S, LONGEST_SEQUENCE_S, MOST_SEQUENCE_FRAMES = 0.1, 3600.0, 200_000
TENTHS, SEQUENCE_GAUGE_WAIT_S = 10, 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class SequenceRequest:
    """A sequence of a target: its end after seconds, in [0.1, 3600], or after frames, in [1, 200000].

    Raises `InputError` when neither or both ends are given, or one lies outside its range.
    """

    target: int
    seconds: float | None = None
    frames: int | None = None

    def __post_init__(self) -> None:
        if (self.seconds is None) == (self.frames is None):
            raise InputError("a sequence must have one end: give seconds or frames")
        if self.seconds is not None:
            require_number("seconds", self.seconds, SHORTEST_SEQUENCE_S, LONGEST_SEQUENCE_S, hint="seconds")
        if self.frames is not None:
            object.__setattr__(self, "frames", require_integer("frames", self.frames, 1, MOST_SEQUENCE_FRAMES))


def begin_sequence(
    jobs: Jobs,
    acquisition: Acquisition | None,
    terms: SequenceRequest,
    *,
    workspace: Path,
    gauge: ForceLog | None,
    typed_n: Callable[[], float | None],
    about: Callable[[], Mapping[str, Any]],
) -> Job:
    """Begin to record into a new folder of the target; the job's result maps ``folder`` and the recording's ``report``.

    The index gives the force of each frame where known: of the gauge, the virtual probe, or as typed.

    Parameters
    ----------
    gauge, typed_n
        As of `force_at`; the typed force is read at each frame, since it may change meanwhile.
    about
        Read at the beginning for further entries of the report's file, and again at the end: what differs then, as a
        calibration that another setting has deactivated, is entered as ``..._at_end``.

    Raises
    ------
    CameraError
        When the camera does not run.
    FileInputError
        When the folder cannot be created.
    """
    if acquisition is None or acquisition.lost:
        at_fault = "it is stopped (start it)" if acquisition is None else "it is away (wait until it is back)"
        raise CameraError(f"the camera must run to record a sequence; {at_fault}")
    begun = about()
    folder = _new_folder(workspace / target_folder(terms.target) / "sequence")
    forces = _Forces(gauge, typed_n)

    def about_all() -> dict[str, Any]:
        of_gauge = {"gauge": {"frames_without_force": forces.without, **asdict(gauge.state())}} if gauge else {}
        differing = {f"{name}_at_end": value for name, value in about().items() if value != begun[name]}
        return {"target": terms.target, **begun, **differing, **of_gauge}

    def work(job: Job) -> dict[str, Any]:
        report = record(
            acquisition,
            FrameFolder(folder),
            folder,
            frames=terms.frames,
            seconds=terms.seconds,
            stopped=lambda: job.ending,
            progress=partial(_report, job, terms),
            beside=FurtherColumns(names=forces.NAMES, of=forces.of),
            about=about_all,
        )
        if report.kept == 0:
            raise CameraError(f"nothing was recorded: {report.ended_by or 'no frame came'}")
        lost = f"{report.missed} lost on the way, {report.overrun} not written in time"
        early = f"; ended early: {report.ended_by}" if report.ended_by else ""
        job.say(f"{report.kept} frames in {report.seconds:.1f} s; {lost}{early}: {folder}")
        return {"folder": str(folder.resolve()), "report": asdict(report)}

    return jobs.begin(f"sequence of target {terms.target}", work, at_once=True)


class _Forces:
    """Force at each frame, newtons, and its source; empty where unknown."""

    NAMES = ("force_n", "force_source")

    def __init__(self, gauge: ForceLog | None, typed_n: Callable[[], float | None]) -> None:
        self._gauge, self._typed_n = gauge, typed_n
        self._wait_s, self.without = SEQUENCE_GAUGE_WAIT_S, 0

    def of(self, frame: ReceivedFrame) -> tuple[str, str]:
        """The columns of a frame."""
        if self._gauge is None:
            force = force_at(frame, None, self._typed_n())
            return ("", "") if force is None else (f"{force.value_n:.6f}", force.source)
        try:
            force = gauge_force(self._gauge, frame, wait_s=self._wait_s)
        except GaugeError:
            self._wait_s = 0.0  # a gauge that is silent must not hold up the frames
            self.without += 1
            return "", ""
        self._wait_s = SEQUENCE_GAUGE_WAIT_S
        return f"{force.value_n:.6f}", force.source


def _new_folder(requested: Path) -> Path:
    folder = free_folder(requested)
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        need = "must be a folder that can be made; got"
        raise FileInputError(f"{str(folder)!r:.120} {need}: {error.strerror or error} (free some space)") from error
    return folder


def _report(job: Job, terms: SequenceRequest, saved: int, passed_s: float) -> None:
    if terms.seconds is None:
        job.report(saved, terms.frames or saved)
    else:
        job.report(int(TENTHS * min(passed_s, terms.seconds)), int(TENTHS * terms.seconds))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressToSave:
    """A press to save."""

    received: ReceivedFrame
    force: PressForce | None
    role: str
    active: ActiveCalibration
    subject: VirtualSubject | None  # of the virtual probe

    @property
    def image(self) -> TactileImage:
        """The frame with scale and force."""
        force_n = None if self.force is None else self.force.value_n
        return self.received.frame.tactile_image(mm_per_pixel=self.active.scale, force_n=force_n)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SavedPress:
    """A press that is on the disk and in the store, with its files in the workspace."""

    files: Snapshot
    target: Target
    press: StoredPress
    flags: tuple[GuardFlag, ...]
    notes: tuple[str, ...]


def save_press(press: PressToSave, *, number: int, workspace: Path, store: Store, map_name: str) -> SavedPress:
    """Save a press under the number of a target, which is created when absent.

    Raises
    ------
    ControlError
        When the virtual probe is on another phantom than the target, or the store is of subjects; nothing is saved.
    FileInputError
        When the files cannot be written; none of them is left then.
    RecordsError
        When the store refuses the press. Its files stay, since the press cannot be repeated; the message names
        them, and ``tsis records import`` enters them.
    """
    if press.subject is not None:  # only the virtual probe can repeat a press that is refused
        require_same_phantom(store, press.subject, number)
    image, calibration = press.image, press.active.calibration
    when = datetime.now().astimezone() - timedelta(seconds=max(0.0, time.monotonic() - press.received.arrived_s))
    flags = check_press(image, reference=press.active.reference)
    files = save_snapshot(
        press.received.frame,
        workspace,
        target=number,
        when=when,
        colour=lambda frame: colour_map(frame.tactile_image(), name=map_name),
        about={
            "role": press.role,
            **press.active.sidecar_entries(),
            "force": None if press.force is None else {"force_n": press.force.value_n, "source": press.force.source},
            "flags": [asdict(flag) for flag in flags],
        },
    )
    try:
        target, notes = _target(store, [image], press.subject, number)
        stored = store.add_press(
            target,
            image,
            role=press.role,
            taken=when.astimezone(UTC),
            probe=press.active.probe,
            calibration=None if calibration is None else calibration.calibration,
            flags=tuple(flag.name for flag in flags),
        )
    except TsisError as error:
        raise RecordsError(
            f"the files are in {files.raw.parent}, but the press could not be saved in the store: {error} "
            "(when that is fixed, open it on the page My images and save it)"
        ) from error
    return SavedPress(files=files, target=target, press=stored, flags=flags, notes=notes)


def enter_target(store: Store, subject: VirtualSubject | None, number: int) -> Target:
    """The target of that number, which is created when absent; errors as of the store."""
    return _target(store, (), subject, number)[0]


def _target(
    store: Store, first: Sequence[TactileImage], subject: VirtualSubject | None, number: int
) -> tuple[Target, tuple[str, ...]]:
    """The target of that number, created when absent with its ``first`` frames on the disk, and notes about it."""
    name, truth = ("", {}) if subject is None else (subject.name, subject.truth if store.kind == "phantom" else {})
    target = target_by_number(store, number)
    if target is None:
        try:
            return new_target(store, first, number=number, name=name, truth=truth), ()
        except InputError:
            target = target_by_number(store, number)  # somebody else has entered it this moment
            if target is None:
                raise
    return target, tuple(truth_note(truth, target))


def require_same_phantom(store: Store, subject: VirtualSubject, number: int) -> None:
    """Refuse, with `ControlError`, what would mix presses of several phantoms, or of a phantom with those of people."""
    if store.kind != "phantom":
        raise ControlError(
            f"the virtual probe presses phantoms, which a store of {store.kind}s does not keep: start the console with "
            "--kind phantom, or choose a camera"
        )
    target = target_by_number(store, number)
    if target is not None and target.truth and dict(target.truth) != dict(subject.truth):
        raise ControlError(
            f"target {number} is of {_phantom_text(target.name, target.truth)}; the virtual probe is on "
            f"{_phantom_text(subject.name, subject.truth)} now: choose another target with + or type its number"
        )


def _phantom_text(name: str, truth: Mapping[str, float]) -> str:
    """A phantom by its name and its inclusion, since two may have the same name."""
    values = ", ".join(f"{name} {value:g}" for name, value in sorted(truth.items()))
    return f"{name or 'another phantom'} ({values or 'no inclusion'})"


SIDECAR = ".json"
OPENABLE = (*IMAGE_ENDINGS, *VIDEO_ENDINGS, SIDECAR)
MOST_OWN_FRAMES = 500  # of one page
UNTOUCHED = "untouched"
IMAGE_ROLES = ("target", "plain", UNTOUCHED)  # an untouched frame is the reference of a measurement


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnImage:
    """One frame of the user: its file, size in pixels, what was pressed, and its force where known, newtons."""

    path: Path
    rows: int
    columns: int
    role: str = IMAGE_ROLES[0]
    force_n: float | None = None

    def __post_init__(self) -> None:
        require_one_of("role", self.role, IMAGE_ROLES)

    @property
    def name(self) -> str:
        """The file's name."""
        return printable_name(self.path)

    @property
    def order(self) -> tuple[object, ...]:
        """Place among others: by role, force and name, whichever was opened first."""
        return IMAGE_ROLES.index(self.role), self.force_n is None, self.force_n or 0.0, self.name


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenedImages:
    """The frames that could be read, and a message for each file that could not."""

    images: tuple[OwnImage, ...] = ()
    refused: tuple[str, ...] = ()


ROLE_IN_NAME = re.compile(r"(target|plain|reference|untouched)(?![a-z])", re.IGNORECASE)
FORCE_IN_NAME = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?) ?N(?![a-z])")
ROLE_WORDS = {"reference": "plain"}


def _options_of(image: OwnImage, options: ImportOptions) -> ImportOptions:
    """The options with role and force of an image; a snapshot says its force, and its role where it has one."""
    sidecar = sidecar_of(image.path)
    if sidecar is not None:
        return options if read_object(sidecar).get("role") is not None else replace(options, role=image.role)
    return replace(options, role=image.role, force_n=() if image.force_n is None else (image.force_n,))


def written_press(file: Path) -> tuple[str, float | None]:
    """What was pressed and how hard, as a sidecar beside the file says, else as its name does; else the first role.

    Examples
    --------
    >>> from pathlib import Path
    >>> written_press(Path("reference-0.5N.png")), written_press(Path("untouched.png")), written_press(Path("a.png"))
    (('plain', 0.5), ('untouched', None), ('target', None))
    """
    sidecar = sidecar_of(file)
    document = {} if sidecar is None else read_object(sidecar)
    role, force = document.get("role"), document.get("force")
    named, newtons = ROLE_IN_NAME.search(file.stem), FORCE_IN_NAME.search(file.stem)
    if role not in IMAGE_ROLES:
        word = IMAGE_ROLES[0] if named is None else named[1].lower()
        role = ROLE_WORDS.get(word, word)
    if isinstance(force, dict) and isinstance(force.get("force_n"), float):
        return role, max(0.0, force["force_n"])
    return role, None if newtons is None else float(newtons[1])


def open_images(paths: Sequence[Path], *, frames_in: Path) -> OpenedImages:
    """Read image files, videos and the image files of folders; a bad file becomes a message and the others stay.

    The frames of a video are written below ``frames_in`` as grey PNG files of 8 bits. Sidecars of ``tsis acquire`` are
    read with the image that they lie beside.
    """
    images: list[OwnImage] = []
    refused: list[str] = []
    for path in paths:
        try:
            for file in _image_files(path, frames_in):
                if len(images) >= MOST_OWN_FRAMES:
                    raise file_error(file, f"is left out: at most {MOST_OWN_FRAMES} frames are opened at once")
                try:
                    rows, columns = read_press_image(file).grey.shape
                    role, force_n = written_press(file)
                    images.append(OwnImage(path=file, rows=rows, columns=columns, role=role, force_n=force_n))
                except TsisError as error:
                    refused.append(str(error))
        except (TsisError, OSError) as error:  # a folder may be closed to us, a disk full
            refused.append(str(error))
    images.sort(key=lambda image: image.order)
    within = f"{frames_in}/"  # the folder of uploads says nothing to a user
    return OpenedImages(images=tuple(images), refused=tuple(message.replace(within, "") for message in refused))


def _image_files(path: Path, frames_in: Path) -> Iterator[Path]:
    ending = path.suffix.lower()
    if path.is_dir():
        files = sorted(item for item in path.iterdir() if item.suffix.lower() in (*IMAGE_ENDINGS, *VIDEO_ENDINGS))
        if not files:
            raise file_error(path, "must hold image files or videos; it holds none")
        for file in files:
            yield from _image_files(file, frames_in)
    elif ending in VIDEO_ENDINGS:
        yield from _video_frames(path, frames_in)
    elif ending in IMAGE_ENDINGS:
        yield path
    elif ending != SIDECAR:
        raise file_error(path, f"must be an image, a video or a sidecar ({', '.join(OPENABLE)}); got {ending!r:.20}")


def _video_frames(path: Path, frames_in: Path) -> Iterator[Path]:
    camera = connect(f"video:{path}")
    try:
        camera.open()
        camera.start()
        for index, frame in enumerate(camera.frames()):
            file = frames_in / f"{path.stem}-{index:05d}.png"
            write_durably(file, encode_picture(np.rint(frame.pixels).astype(np.uint8)))
            yield file
    finally:
        camera.stop()


def measure_images(
    images: Sequence[OwnImage], *, mm_per_pixel: tuple[float, float] | None, invert: bool = False
) -> tuple[tuple[ImageFinding, ...], tuple[str, ...]]:
    """The contact in each pressed image, against the first untouched frame if there is one, and what failed."""
    untouched = next((image for image in images if image.role == UNTOUCHED), None)
    reference = None if untouched is None else read_press_image(untouched.path, mm_per_pixel=mm_per_pixel)
    findings: list[ImageFinding] = []
    failed: list[str] = []
    for image in (item for item in images if item.role != UNTOUCHED):
        try:
            frame = read_press_image(image.path, mm_per_pixel=mm_per_pixel, force_n=image.force_n)
            findings.append(analyse_image(frame, reference, invert=invert))
        except TsisError as error:
            failed.append(f"{image.name}: {error}")
    return tuple(findings), tuple(failed)


def save_images(
    store: Store, images: Sequence[OwnImage], *, number: int | None, options: ImportOptions
) -> tuple[int, int]:
    """Save the frames as presses of target ``number``, of the next free one when None; gives (target, presses added).

    ``options`` has scale, calibration and probe of all; role and force are those of each frame. Nothing is saved when a
    file cannot be. Raises as `tsis.records.importing.find_import_batches` and `import_batches`.
    """
    if not images:
        raise InputError("a target needs at least one image; open some first")
    batches = [batch for image in images for batch in find_import_batches([image.path], _options_of(image, options))]
    number = number or max((item.target.number for item in store.targets(hidden=True)), default=0) + 1
    return number, sum(item.added for item in import_batches(store, batches, target=number))
