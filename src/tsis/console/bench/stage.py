"""The virtual probe on its stage: what can be pressed with it, and what is pressed now."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration.cited import UsableCalibration
from tsis.calibration.file import ProbeCalibration, calibration_sha256
from tsis.calibration.guard.reference import GuardReference
from tsis.console.bench.choice import BALL, PLAIN, TARGET, UNTOUCHED
from tsis.model import Phantom, SoftSphere, TactileImage, load_probe, load_sphere
from tsis.model.check import require_number, require_one_of
from tsis.model.errors import MechanicsError
from tsis.model.variants import phantom_variant
from tsis.virtual import DirectContactRig, VirtualCamera, VirtualProbe
from tsis.virtual.camera import LARGEST_FORCE_N, USUAL_MS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from tsis.console.bench.choice import CameraChoice

RIGID_KPA = 1e6  # of a ball that does not give
BALL_MM = 3.0
TRUTHS = ("diameter_mm", "depth_mm", "young_kpa")


class VirtualStage:
    """A virtual rig with what lies before it, by the role of a press on it.

    Parameters
    ----------
    choice
        Probe, phantom or sphere, and seed.

    Raises
    ------
    InputError
        When the phantom's values lie outside their ranges.
    """

    def __init__(self, choice: CameraChoice) -> None:
        self._rng, self._roles = np.random.default_rng(choice.seed), choice.roles
        self.probe = load_probe(choice.probe)
        self._rig: VirtualProbe | DirectContactRig
        self._objects: dict[str, Phantom | SoftSphere]
        self.written_radius_mm: float | None = None
        if choice.is_sphere:
            rig = DirectContactRig(self.probe, rng=self._rng)
            sphere = load_sphere(choice.phantom)
            ball = SoftSphere(radius_mm=BALL_MM, young_kpa=RIGID_KPA, name="rigid ball")
            self._rig, self._objects = rig, {TARGET: sphere, BALL: ball}
            self.written_radius_mm = rig.written_radius_mm(sphere)
            self.truth: Mapping[str, float] = {"young_kpa": sphere.young_kpa}
        else:
            phantom = phantom_variant(choice.phantom, choice.diameter_mm, choice.depth_mm, choice.young_kpa)
            self._rig = VirtualProbe(self.probe, rng=self._rng)
            self._objects = {TARGET: phantom, PLAIN: phantom.without_inclusion()}
            lump = phantom.inclusion
            self.truth = {} if lump is None else {name: getattr(lump, name) for name in TRUTHS}
        self.name = self._objects[TARGET].name
        self.role, self.force_n = choice.roles[0], choice.touch_n or 0.0
        self._light_of: Callable[..., NDArray[np.float64]] = self._rig.light
        self._light: NDArray[np.float64] | None = None
        self._camera: VirtualCamera | None = None
        self._one_at_a_time = threading.Lock()
        self.calibration = self._own_calibration()

    @property
    def roles(self) -> tuple[str, ...]:
        """What the probe can be held on."""
        return self._roles

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

    def connect(self) -> VirtualCamera:
        """A camera that looks at the press as it is held; connected anew it is the same press."""
        camera = VirtualCamera(
            self._rig,
            self._lying(self.role),
            rng=self._rng,
            force_n=_pressed_n(self.role, self.force_n),
            paced=True,
            light=self._light,
        )
        self._camera = camera
        return camera

    def hold(self, role: str, force_n: float) -> None:
        """Lift the probe and hold it on something, or again; it shows once the mechanics are solved: on return.

        Raises
        ------
        InputError
            When there is nothing of that role, or the force lies outside its range.
        MechanicsError
            When the tissue cannot be pressed so hard; the press is as it was.
        """
        require_one_of("role", role, self.roles)
        require_number("force_n", force_n, 0.0, LARGEST_FORCE_N, hint="newtons")
        with self._one_at_a_time:
            lies, pressed_n = self._lying(role), _pressed_n(role, force_n)
            try:
                light = self._light_of(lies, force_n=pressed_n)
            except MechanicsError as error:
                if error.largest_n is None:
                    raise
                # The one cure that whoever holds this probe has: less force.
                raise MechanicsError(f"{error.problem}: choose a force of at most {error.largest_n:.2g} N") from error
            if self._camera is not None:
                self._camera.hold_on(lies, force_n=pressed_n, light=light)
            self.role, self.force_n, self._light = role, force_n, light

    def _own_calibration(self) -> UsableCalibration:
        """What is known of the rig, which holds at the camera's usual settings."""
        response, sensor = self._rig.calibration, self._rig.sensor
        settings = {"exposure_ms": USUAL_MS, "gain": 0.0, "brightness": sensor.background_grey}
        known = ProbeCalibration(name=response.name, probe=self.probe.name, settings=settings, response=response)
        return UsableCalibration(known=known, identity=calibration_sha256(known))

    def _lying(self, role: str) -> Phantom | SoftSphere:
        return self._objects[TARGET if role == UNTOUCHED else role]


def _pressed_n(role: str, force_n: float) -> float:
    return 0.0 if role == UNTOUCHED else force_n
