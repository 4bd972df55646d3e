"""What the instrument is told: settings, camera, phantom."""

from __future__ import annotations

import re
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tsis.__about__ import LARGEST_SEED
from tsis.calibration.file import ProbeCalibration, calibration_sha256
from tsis.calibration.frames import UsableCalibration
from tsis.calibration.guard.reading import GuardReference
from tsis.catalog.phantoms import list_phantoms, list_spheres, load_sphere, phantom_variant
from tsis.catalog.probes import list_probes, load_probe
from tsis.console.worker import light_of
from tsis.errors import InputError, MechanicsError
from tsis.imaging.sensor import Sensor
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

    from tsis.console.worker import WorkerProcess


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
                press = self._rig, lies, pressed_n
                light, self._rig = light_of(*press) if self._solver is None else self._solver.call(light_of, *press)
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
