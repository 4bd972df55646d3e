"""A gel sensor without hardware: a gel at finite strain, lamps, vignetting and noise that no estimator knows.

The gel is pressed by the axisymmetric finite elements of `tsis.mechanics.finite_strain`, not by the linear layer and
Hertz's contact that the estimators assume, and lit by the lamps of `random_gel_light`, which they do not know.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError
from tsis.hardness.sphere import hertzian_radius_mm, press_fields
from tsis.mechanics.finite_strain.soft_sphere import WIDEST_CONTACT, SphereResolution
from tsis.model.gel_sensor import GelSensor
from tsis.model.phantom import SoftSphere
from tsis.model.probe import Layer, Probe
from tsis.model.require import require_number, require_type
from tsis.virtual.gel_frames import (
    GelBallPress,
    RenderedPress,
    gel_depth_mm,
    marker_drag_mm,
    random_gel,
    random_gel_light,
    random_place,
    render_gel,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.model.press import PressField

    Pair = tuple[float, float]


MESH = SphereResolution(order=3, cells=8, rings=3, face_cells=26)  # with 12, shallow contacts were 2.8 % off
STEEL_OVER_GEL, STEEL_POISSON = 300.0, 0.3  # modulus of a ball that counts as rigid, over the gel's
SHALLOW, DEEP, DEEPEST = 0.35, 0.8, 0.22  # calibration presses: contact over ball radius, travel over thickness


class VirtualGelSensor:
    """One exemplar of a gel sensor: its gel lies somewhere within the limits of the sensor's file.

    Parameters
    ----------
    sensor
        A flat sensor with a known scale.
    rng
        Random source of gel, lamps, places and noise.
    gel
        The gel; drawn within the sensor's limits when None.
    resolution
        Mesh of the press.

    Attributes
    ----------
    sensor, gel
        The sensor, and the true gel as a layer.
    reference
        Frame of the untouched sensor, shape (rows, columns, 3), 8 bits.

    Raises `InputError` when the gel is not flat, or the scale is not known.
    """

    def __init__(
        self,
        sensor: GelSensor,
        *,
        rng: np.random.Generator,
        gel: Layer | None = None,
        resolution: SphereResolution = MESH,
    ) -> None:
        require_type("sensor", sensor, GelSensor)
        if sensor.shape != "flat":
            raise InputError(f"a virtual gel sensor must be flat; {sensor.name} is {sensor.shape}: choose another")
        columns, rows = sensor.image_px
        self.sensor, self._scale = sensor, sensor.known_scale(columns, rows)
        self._rng, self._resolution = rng, resolution
        self.gel = random_gel(sensor, rng) if gel is None else gel
        self._light = random_gel_light((rows, columns), rng, size_px=0.08 * columns)
        self.reference: NDArray[np.uint8] = render_gel(np.zeros((rows, columns)), sensor, self._light, rng, drift=False)

    def press(self, ball: SoftSphere, *, force_n: float, centre_px: tuple[float, float] | None = None) -> RenderedPress:
        """The frame of a ball at one force; `presses` of several."""
        return self.presses(ball, forces_n=(force_n,), centre_px=centre_px)[0]

    def presses(
        self, ball: SoftSphere, *, forces_n: Sequence[float], centre_px: Pair | None = None, shear: Pair = (0.0, 0.0)
    ) -> tuple[RenderedPress, ...]:
        """Frames of a ball at ascending forces, each at another place unless one is given.

        ``shear`` (x, y) is the drag over the force, which follows the pressure and only markers show.

        Raises
        ------
        InputError
            When a value is out of range or forces do not ascend.
        MechanicsError
            When a press does not converge.
        """
        require_type("ball", ball, SoftSphere)
        return tuple(self._rendered(field, ball, centre_px, shear) for field in self._fields(ball, forces_n))

    def rigid_ball(self, radius_mm: float) -> SoftSphere:
        """A ball that does not deform on this gel."""
        return SoftSphere(radius_mm=radius_mm, young_kpa=STEEL_OVER_GEL * self.gel.young_kpa, poisson=STEEL_POISSON)

    def calibration_presses(self, count: int, *, ball_radius_mm: float, depths: int = 3) -> tuple[RenderedPress, ...]:
        """Presses of a rigid ball at ``count`` places and ``depths`` depths, as a depth calibration wants them."""
        radius = require_number("ball_radius_mm", ball_radius_mm, 0.5, 20.0, hint="millimetres")
        widest = min(0.28 * float(np.multiply(self.sensor.image_px, self._scale).min()), DEEP * radius)
        widest = min(widest, float(np.sqrt(DEEPEST * self.gel.thickness_mm * radius)))
        modulus = self.gel.young_kpa / (1.0 - self.gel.poisson**2)
        contact = np.linspace(min(SHALLOW * radius, 0.7 * widest), widest, min(depths, count))
        forces = [float(force) for force in 4.0 / 3.0 * modulus * contact**3 / radius / 1000.0]  # Hertz's, in N
        ball = self.rigid_ball(radius)
        fields = self._fields(ball, forces)
        return tuple(self._rendered(fields[number % len(fields)], ball, None, (0.0, 0.0)) for number in range(count))

    def _fields(self, ball: SoftSphere, forces_n: Sequence[float]) -> tuple[PressField, ...]:
        # The gel goes on beyond the frame, and the bulge of its free rim must lie outside it.
        half = float(np.hypot(self.sensor.width_mm, self.sensor.height_mm)) / 2
        probe = Probe(radius_mm=max(half, 1.01 * ball.radius_mm / WIDEST_CONTACT), layers=(self.gel,))
        return press_fields(probe, ball, forces_n=forces_n, resolution=self._resolution)

    def _rendered(self, field: PressField, ball: SoftSphere, centre_px: Pair | None, shear: Pair) -> RenderedPress:
        contact = hertzian_radius_mm(field)
        press = GelBallPress(
            contact_radius_mm=contact, depth_mm=float(field.face_displacement_mm[0]),
            radius_mm=field.radius_mm, face_mm=field.face_displacement_mm,
        )  # fmt: skip
        radius_px = contact / float(np.sqrt(np.prod(self._scale)))
        centre = random_place(self.sensor, radius_px, self._rng) if centre_px is None else centre_px
        depth = gel_depth_mm(press, self.sensor, *self.sensor.image_px, centre)
        shift = marker_drag_mm(field, self.sensor, self.gel, centre, shear)
        return RenderedPress(
            sensor=self.sensor,
            reference=self.reference,
            frame=render_gel(depth, self.sensor, self._light, self._rng, shift_mm=shift),
            ball_radius_mm=ball.radius_mm,
            centre_px=centre,
            radius_px=radius_px,
            depth_mm=depth,
            force_n=field.force_n,
            shear_n=(shear[0] * field.force_n, shear[1] * field.force_n),
        )
