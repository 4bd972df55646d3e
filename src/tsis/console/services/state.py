"""What the instrument is told and what it says: settings, choices, subjects and the state of everything."""

from __future__ import annotations

import json
import re
import threading
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tsis.__about__ import LARGEST_SEED
from tsis.calibration.file import ProbeCalibration, calibration_bytes, calibration_sha256
from tsis.calibration.frames import UsableCalibration, apply_calibration, read_usable_calibration
from tsis.calibration.guard.reading import GuardReference
from tsis.catalog.phantoms import list_phantoms, list_spheres, load_sphere, phantom_variant
from tsis.catalog.probes import list_probes, load_probe
from tsis.console.worker import light_of
from tsis.errors import InputError, MechanicsError, TsisError
from tsis.files.atomic import write_durably
from tsis.files.canonical_json import content_sha256
from tsis.files.json_values import from_json_value, to_json_value
from tsis.imaging.sensor import Sensor
from tsis.inclusion.tissue import protocol_forces, tissue_modulus
from tsis.instrument.camera import Setting
from tsis.instrument.discovery import STORED_SOURCES, live_sources
from tsis.model.image import TactileImage
from tsis.model.phantom import Phantom, SoftSphere
from tsis.model.require import require_integer, require_number, require_one_of, require_type
from tsis.records.values import KINDS, ROLES
from tsis.virtual.camera import LARGEST_FORCE_N, VirtualCamera, camera_settings, virtual_mode
from tsis.virtual.direct_contact import DirectContactRig
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from tsis.console.services.camera import CameraController
    from tsis.console.services.control import Owner
    from tsis.console.services.frames import FrameAnalysis
    from tsis.console.services.jobs import JobState
    from tsis.console.worker import WorkerProcess
    from tsis.records.values import TargetRecord


VIRTUAL, VIRTUAL_GEL, OPENCV = "virtual", "virtual-gel", "opencv"
OPENCV_SPEC = re.compile("opencv(:[0-9]{0,4})?")  # without a number it is the first
TARGET, PLAIN, BALL, UNTOUCHED = "target", "plain", "ball", "untouched"  # roles of presses
TISSUE_N, SPHERE_N = 1.0, 0.7  # forces with which the virtual probe begins
LONGEST_SPEC = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class PressForce:
    """A force and where it is known from: ``"gauge"``, ``"virtual"`` or ``"typed"``."""

    value_n: float
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraChoice:
    """A camera and its mode; of the virtual probe also what it presses.

    Parameters
    ----------
    spec
        ``"virtual"``, ``virtual-gel:SENSOR``, or ``SOURCE:ID`` of a live camera as
        `tsis.instrument.discovery.find_cameras` does.
    mode
        Label of the mode to start in; the camera's first when None.
    probe
        Name in the catalog: of the virtual probe, and of the probe before the camera where no calibration tells.
    phantom
        What the virtual probe presses: a phantom of the catalog, or a sphere of it for hardness.
    diameter_mm, depth_mm, young_kpa
        Of the phantom's inclusion instead of the catalog's.
    seed
        Of the virtual probe's errors, and of the virtual gel sensor's lamps and presses.

    Raises
    ------
    InputError
        When a name is unknown or a value outside its range.
    """

    spec: str = VIRTUAL
    mode: str | None = None
    probe: str = "tsis-domed"
    phantom: str = "hardness-100"
    diameter_mm: float | None = None
    depth_mm: float | None = None
    young_kpa: float | None = None
    seed: int = 4

    def __post_init__(self) -> None:
        require_type("spec", self.spec, str)
        self._require_live()
        if self.mode is not None:
            require_type("mode", self.mode, str)
            if self.is_virtual:  # whose modes are known before it runs
                require_one_of("mode", self.mode, [virtual_mode(Sensor()).label])
        require_one_of("probe", self.probe, list_probes())
        require_one_of("phantom", self.phantom, (*list_phantoms(), *list_spheres()))
        changed = (self.diameter_mm, self.depth_mm, self.young_kpa)
        if not self.is_sphere:
            phantom_variant(self.phantom, *changed)
        elif any(value is not None for value in changed):
            raise InputError(f"diameter_mm, depth_mm and young_kpa are of phantoms; {self.phantom} is a sphere")
        require_integer("seed", self.seed, 0, LARGEST_SEED)

    def _require_live(self) -> None:
        source = self.spec.partition(":")[0]
        if source in STORED_SOURCES:
            raise InputError(
                f"camera must be a live one; got {self.spec!r:.80}, which is stored (estimate from stored frames with "
                "tsis examine, or enter them with tsis records import)"
            )
        require_one_of("camera source", source, (VIRTUAL, VIRTUAL_GEL, *live_sources()))
        if source == VIRTUAL and self.spec != VIRTUAL:
            raise InputError(f"the virtual probe is called virtual and nothing more; got {self.spec!r:.80}")
        if source == OPENCV and not OPENCV_SPEC.fullmatch(self.spec):
            raise InputError(f"opencv cameras go by their number, as in opencv:0; got {self.spec!r:.80}")
        if len(self.spec) > LONGEST_SPEC or not self.spec.isprintable():
            raise InputError(
                f"camera must be at most {LONGEST_SPEC} characters that can be shown; got {self.spec!r:.80}"
            )

    @property
    def is_virtual(self) -> bool:
        """Whether there is no hardware."""
        return self.spec == VIRTUAL

    @property
    def is_sphere(self) -> bool:
        """Whether the bare virtual probe touches an object, for its hardness."""
        return self.phantom in list_spheres()

    @property
    def roles(self) -> tuple[str, ...]:
        """What may be pressed with it; a press begins on the first."""
        if not self.is_virtual:
            return ROLES
        return (TARGET, BALL if self.is_sphere else PLAIN, UNTOUCHED)

    @property
    def touch_n(self) -> float | None:
        """Force with which the virtual probe begins, N; None for other cameras."""
        if not self.is_virtual:
            return None
        return SPHERE_N if self.is_sphere else TISSUE_N


LIVE_STRAIN = "small"  # of the presses of a live view, which must not wait for seconds
RIGID_KPA = 1e6  # of a ball that does not give
BALL_MM = 3.0
TRUTHS = ("diameter_mm", "depth_mm", "young_kpa")


class VirtualSubject:
    """A virtual rig with the objects before it, by the role of a press; `InputError` for a phantom out of range.

    Its presses are solved in ``solver``, a process of their own, or here.
    """

    def __init__(self, choice: CameraChoice, *, solver: WorkerProcess | None = None) -> None:
        rng = np.random.default_rng(choice.seed)
        self._noise, self._solver, self.roles = rng.spawn(1)[0], solver, choice.roles
        self.probe = load_probe(choice.probe)
        self._rig: VirtualProbe | DirectContactRig
        self._objects: dict[str, Phantom | SoftSphere]
        self.written_radius_mm: float | None = None
        if choice.is_sphere:
            rig = DirectContactRig(self.probe, rng=rng)
            sphere = load_sphere(choice.phantom)
            ball = SoftSphere(radius_mm=BALL_MM, young_kpa=RIGID_KPA, name="rigid ball")
            self._rig, self._objects = rig, {TARGET: sphere, BALL: ball}
            self.written_radius_mm = rig.written_radius_mm(sphere)
            self.truth: Mapping[str, float] = {"young_kpa": sphere.young_kpa}
        else:
            phantom = phantom_variant(choice.phantom, choice.diameter_mm, choice.depth_mm, choice.young_kpa)
            self._rig = VirtualProbe(self.probe, rng=rng, strain=LIVE_STRAIN)
            self._objects = {TARGET: phantom, PLAIN: phantom.without_inclusion()}
            lump = phantom.inclusion
            self.truth = {} if lump is None else {name: getattr(lump, name) for name in TRUTHS}
        self.name = self._objects[TARGET].name
        self.role, self.force_n = choice.roles[0], choice.touch_n or 0.0
        self._light: NDArray[np.float64] | None = None
        self._camera: VirtualCamera | None = None
        self._lock = threading.Lock()
        self.calibration = self._own_calibration()

    @property
    def mm_per_pixel(self) -> tuple[float, float]:
        """Size (x, y) of a pixel on the face, mm."""
        return self._rig.sensor.mm_per_pixel

    def guard_reference(self) -> GuardReference:
        """What the press guard compares with: the untouched probe, whose every level is known."""
        sensor = self._rig.sensor
        untouched = TactileImage(
            grey=np.full((sensor.rows, sensor.columns), sensor.background_grey),
            mm_per_pixel=sensor.mm_per_pixel,
            full_scale=sensor.full_scale,
        )
        return GuardReference(
            untouched=untouched, face_radius_mm=self.probe.radius_mm, dark_grey=sensor.background_grey
        )

    def connect(self, *, apart: bool = False) -> VirtualCamera:
        """A camera of the present press, which stays the same after a reconnection; ``apart`` as `VirtualCamera`."""
        camera = VirtualCamera(
            self._rig,
            self._lying(self.role),
            rng=self._noise,
            force_n=_pressed_n(self.role, self.force_n),
            paced=True,
            light=self._light,
            apart=apart,
        )
        self._camera = camera
        return camera

    def hold(self, role: str, force_n: float) -> None:
        """Press an object with a force in newtons; it is visible once the mechanics are solved: on return.

        Raises `InputError` for an unknown role or a force outside its range, and `MechanicsError` when the tissue
        cannot be pressed so hard; the press then stays as it was.
        """
        require_one_of("role", role, self.roles)
        require_number("force_n", force_n, 0.0, LARGEST_FORCE_N, hint="newtons")
        with self._lock:
            lies, pressed_n = self._lying(role), _pressed_n(role, force_n)
            try:
                given = self._rig, lies, pressed_n
                light, self._rig = light_of(*given) if self._solver is None else self._solver.call(light_of, *given)
            except MechanicsError as error:
                if error.largest_n is None:
                    raise
                # The only cure at this probe is less force.
                raise MechanicsError(f"{error.problem}: choose a force of at most {error.largest_n:.2g} N") from error
            if self._camera is not None:
                self._camera.hold_on(lies, force_n=pressed_n, light=light)
            self.role, self.force_n, self._light = role, force_n, light

    def _own_calibration(self) -> UsableCalibration:
        """What is known of the rig, which holds at the camera's usual settings."""
        response, sensor = self._rig.calibration, self._rig.sensor
        settings = camera_settings(sensor)
        calibration = ProbeCalibration(name=response.name, probe=self.probe.name, settings=settings, response=response)
        return UsableCalibration(calibration=calibration, identity=calibration_sha256(calibration))

    def _lying(self, role: str) -> Phantom | SoftSphere:
        return self._objects[TARGET if role == UNTOUCHED else role]


def _pressed_n(role: str, force_n: float) -> float:
    return 0.0 if role == UNTOUCHED else force_n


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentSettings:
    """Folders and initial settings of an instrument.

    Parameters
    ----------
    workspace
        Folder of snapshots, sequences and calibration sessions; made when it does not exist.
    store
        Folder of the store of records; that of this user and kind when None.
    kind
        Of that store: ``"phantom"`` or ``"subject"``.
    database
        URL of a PostgreSQL database for its rows; SQLite in the folder when None.
    camera
        ``"virtual"``, or a live camera as of `CameraChoice`.
    probe, phantom, seed
        Of the virtual probe: names in the catalog, also of a sphere in place of a phantom, and the seed of its errors.
    calibration
        Calibration file that is active at the start; the virtual probe's own when None.

    Raises
    ------
    InputError
        When a name is unknown or a value outside its range.
    """

    workspace: Path = Path("tsis-console")
    store: Path | None = None
    kind: str = KINDS[0]
    database: str | None = None
    camera: str = VIRTUAL
    probe: str = "tsis-domed"
    phantom: str = "hardness-100"
    seed: int = 4
    calibration: Path | None = None

    def __post_init__(self) -> None:
        require_one_of("kind of store", self.kind, KINDS)
        self.choice  # noqa: B018 - which refuses what cannot be chosen

    @property
    def choice(self) -> CameraChoice:
        """The camera to begin with."""
        return CameraChoice(spec=self.camera, probe=self.probe, phantom=self.phantom, seed=self.seed)


LIGHT_N = 0.2  # of the light press by which the virtual probe reads tissue
NOT_ON_TISSUE = (
    "the press does not look like one on even tissue without an inclusion: press another place lightly, and measure "
    "the tissue again"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class TissueReading:
    """Tissue as a light press shows it: modulus with its 90 % interval, and the forces that use the probe well on it.

    ``press`` is the light press, which no estimate uses beside its own reading.
    """

    press: str
    young_kpa: float
    interval_kpa: tuple[float, float]
    forces_n: tuple[float, ...]


def read_tissue(record: TargetRecord, press: str) -> TissueReading:
    """The tissue under a stored light press of a target, and the forces that follow from it.

    Raises
    ------
    InputError
        When the press has no calibration, force or scale, does not look like one on even tissue, or no forces are known
        for its tissue.
    """
    stored = next(item for item in record.presses if item.id == press)
    if stored.calibration is None:
        raise InputError(
            "tissue is measured with a calibrated press; this one has no active calibration (activate one)"
        )
    probe, calibration = load_probe(stored.probe), record.calibrations[stored.calibration]
    (ready,), response = apply_calibration(
        calibration, [record.image(stored)], identity=stored.calibration, on_tissue=True
    )
    tissue = tissue_modulus(ready, probe=probe, calibration=response)
    if not tissue.trusted:
        raise InputError(NOT_ON_TISSUE)
    forces_n = protocol_forces(probe, tissue_young_kpa=tissue.young_kpa)
    return TissueReading(press=press, young_kpa=tissue.young_kpa, interval_kpa=tissue.interval_kpa, forces_n=forces_n)


class TissueReadings:
    """The last reading of each target, in a file that survives a restart; safe for several threads."""

    def __init__(self, file: Path) -> None:
        self._file, self._lock = file, threading.Lock()
        self._readings: dict[int, TissueReading] = {}
        with suppress(OSError, ValueError, AttributeError, InputError):  # none yet, or of another release
            items = json.loads(file.read_text(encoding="utf-8")).items()
            self._readings = {int(number): from_json_value(TissueReading, item, "tissue") for number, item in items}

    def of(self, number: int) -> TissueReading | None:
        """That of a target; None before the first."""
        return self._readings.get(number)

    def add(self, number: int, reading: TissueReading) -> None:
        """Replace that of a target; `FileInputError` when it cannot be written, and it holds until the end then."""
        with self._lock:
            self._readings = {**self._readings, number: reading}
            content = {str(target): to_json_value(item) for target, item in self._readings.items()}
            write_durably(self._file, json.dumps(content).encode())


class CalibrationMemory:
    """Keeps in a folder which calibration was activated for each camera, and for the virtual probe of each seed."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def of(self, choice: CameraChoice) -> tuple[UsableCalibration | None, str]:
        """The calibration of a camera's last run, and a message about it; None and empty where none was active."""
        file = self._file(choice)
        if not file.exists():
            return None, ""
        try:
            given = read_usable_calibration(file)
        except TsisError as error:
            return None, f"The calibration of the last session was not activated: {error}."
        return given, f"Calibration {given.calibration.name!r} of the last session is active again."

    def keep(self, choice: CameraChoice, given: UsableCalibration | None) -> None:
        """Keep the one that was activated, or that none is; a disk that refuses it stops nothing."""
        file = self._file(choice)
        with suppress(OSError):
            file.unlink(missing_ok=True)
            if given is not None:
                file.parent.mkdir(parents=True, exist_ok=True)
                write_durably(file, calibration_bytes(given.calibration))

    def _file(self, choice: CameraChoice) -> Path:
        own = [choice.probe, choice.seed, choice.is_sphere] if choice.is_virtual else []
        return self._folder / f"{content_sha256([choice.spec, *own])[:16]}.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraState:
    """State of the camera.

    Attributes
    ----------
    choice
        Which camera was chosen.
    name
        Its name; empty while it is stopped.
    mode, modes
        Label of its mode, and of all its modes; empty while it is stopped.
    running
        Whether the camera streams.
    lost
        Whether a running camera sends no frames; the program connects it again.
    failure
        Why the last frames stayed away; empty when none did.
    received
        Complete frames.
    missed
        Frames that the camera numbered and that did not arrive.
    interruptions
        How often the camera was lost.
    frames_per_s
        Rate over the last two seconds.
    rows, columns
        Size of a frame in pixels; 0 before the first.
    full_scale
        Grey level at which the camera clips; 0 before the first frame.
    mm_per_pixel
        Size (x, y) of a pixel on the face; None when nobody knows it.
    settings
        What can be adjusted now.
    """

    choice: CameraChoice
    name: str = ""
    mode: str = ""
    modes: tuple[str, ...] = ()
    running: bool = False
    lost: bool = False
    failure: str = ""
    received: int = 0
    missed: int = 0
    interruptions: int = 0
    frames_per_s: float = 0.0
    rows: int = 0
    columns: int = 0
    full_scale: float = 0.0
    mm_per_pixel: tuple[float, float] | None = None
    settings: tuple[Setting, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentState:
    """State of the instrument.

    Attributes
    ----------
    target
        Number of the target that snapshots go to.
    role, roles
        What is pressed, and what may be.
    force_n
        As typed, or that of the virtual probe, which for "untouched" stays for the next press; None when unknown.
    calibration, calibration_identity
        Name and SHA-256 of the active one; empty without one, and while the chosen one does not fit the camera's
        settings, as ``trouble`` says.
    sequence
        The running or last sequence; None before the first.
    jobs
        Longer work, the newest last.
    trouble
        Messages of problems, the most urgent first.
    busy
        The running command that others must wait for, as ``"starting the camera"``; empty without one.
    gauge
        Name of the gauge that forces are read from; empty without one.
    active, tissue
        The active calibration itself, and the target's tissue as a light press showed it; None without.
    """

    camera: CameraState
    target: int
    role: str
    roles: tuple[str, ...]
    force_n: float | None
    calibration: str
    calibration_identity: str
    frame_analysis: FrameAnalysis | None
    owner: Owner | None
    sequence: JobState | None
    jobs: tuple[JobState, ...]
    trouble: tuple[str, ...]
    busy: str = ""
    gauge: str = ""
    active: UsableCalibration | None = None
    tissue: TissueReading | None = None

    @property
    def lifted(self) -> bool:
        """Whether the virtual probe touches nothing: its force is 0 then, whatever is set for the next press."""
        return self.camera.choice.is_virtual and self.role == UNTOUCHED


def camera_state(camera_controller: CameraController, mm_per_pixel: tuple[float, float] | None) -> CameraState:
    """State of the camera, with the size (x, y) of its pixels in mm; it never waits for the camera."""
    # Asked once: it may be stopped, or be another one, the moment after.
    acquisition, choice = camera_controller.acquisition, camera_controller.choice
    if acquisition is None:
        return CameraState(choice=choice, mm_per_pixel=mm_per_pixel)
    account, latest, mode, failure = acquisition.account(), acquisition.latest(), acquisition.mode, acquisition.failure
    rows, columns = (0, 0) if latest is None else latest.frame.pixels.shape[:2]
    return CameraState(
        choice=choice,
        name=acquisition.name,
        mode="" if mode is None else mode.label,
        modes=tuple(mode.label for mode in acquisition.modes),
        running=True,
        lost=acquisition.lost or acquisition.ended,
        failure="" if failure is None else str(failure),
        received=account.received,
        missed=account.missed,
        interruptions=len(account.interruptions),
        frames_per_s=account.frames_per_s,
        rows=rows,
        columns=columns,
        full_scale=0.0 if latest is None else latest.frame.full_scale,
        mm_per_pixel=mm_per_pixel,
        settings=camera_controller.settings(),
    )
