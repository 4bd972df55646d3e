"""Light on the probe's face from inside, for any displacement and slope of the face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.model.calibration import LightMap
from tsis.model.press import PressField, PressMap, interpolation_matrix, require_ascending
from tsis.model.require import require_array, require_number
from tsis.optics._angles import real_contact
from tsis.optics.irradiance._fit import POWERS, RINGS, powers
from tsis.optics.rays import face_grid, on_face, slopes

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tsis.optics._inputs import Floats


SMALL = 0.35  # of the second displacement: 0.28 mm in layers of 10 mm, the depth of a dent by tissue
TYPICAL = 0.75  # of a small displacement: a tilted face is displaced as well
DARKEST = 0.02  # of the mean; lower limit of the light that the flux is divided by
STEEPEST = 1.25 * RINGS[-1]  # largest slope of the even terms, which are fitted up to the last ring
FASTEST_PER_MM = 2.0  # limit of the growth: lit areas change by less, dark ones are mostly noise
STRIDE = 2  # points of the tracer's grid to one of a map
FINE_POINTS = 480  # along each side of the square around the face


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Irradiance:
    """Light on the face from inside, as a function of position, displacement and slope of the face.

    ``light = exp(lift u) * sum over k of terms[k](x, y, u) * slope_x^i slope_y^j`` with the exponents ``(i, j)`` of
    ``tsis.optics.irradiance._fit.POWERS``: the light on a level face, the flux of light along the face, and even terms
    for faces steeper than the light, which turn dark or receive light from below. Quadratic in the displacement.

    Attributes
    ----------
    radius_mm
        Radius of the face.
    nodes_mm
        Coordinates of the terms along x and y, shape (n,), ascending; linear between, constant beyond the edge.
    displacement_mm
        Three displacements of the face towards the glass, from 0, at which the terms are given; larger displacements
        than 1.25 times the last have the light of that limit.
    terms
        Terms over the mean light on the undented face, shape (3, 11, n, n), rows along y.
    lift_per_mm
        Growth of the light by reflection from a dent's own flanks, fitted on traced dents.
    depletion
        Loss of light over the whole face by contact: the factor is ``1 / (1 + depletion * fraction)`` when contact
        absorbs that fraction of the arriving light.
    mean_per_mm2
        Mean light on the undented face per mm², as a fraction of the lamps' power.
    error
        Standard error of the light on the undented face by the number of rays, root mean square over the face.

    Raises
    ------
    InputError
        When coordinates do not ascend, a value is not finite or a shape differs from the grid's.
    """

    radius_mm: float
    nodes_mm: Floats
    displacement_mm: Floats
    terms: Floats
    lift_per_mm: float
    depletion: float
    mean_per_mm2: float
    error: float

    def __post_init__(self) -> None:
        require_number("radius_mm", self.radius_mm, 1.0, 100.0, hint="millimetres")
        for name in ("nodes_mm", "displacement_mm"):
            object.__setattr__(self, name, require_ascending(name, getattr(self, name)))
        terms = require_array("terms", self.terms, ndim=4)
        count = len(self.nodes_mm)
        if terms.shape != (3, len(POWERS), count, count) or len(self.displacement_mm) != 3:
            raise InputError(f"terms must have the shape {(3, len(POWERS), count, count)}; got {terms.shape}")
        object.__setattr__(self, "terms", terms)
        require_number("lift_per_mm", self.lift_per_mm, -10.0, 10.0)
        require_number("depletion", self.depletion, -1.0, 100.0)
        require_number("mean_per_mm2", self.mean_per_mm2, 0.0, np.inf)
        require_number("error", self.error, 0.0, np.inf)

    def at(
        self,
        x_mm: ArrayLike,
        y_mm: ArrayLike,
        *,
        displacement_mm: ArrayLike = 0.0,
        slope_x: ArrayLike = 0.0,
        slope_y: ArrayLike = 0.0,
    ) -> Floats:
        """Light on a dented face over a grid, relative to the mean on the undented face, >= 0.

        Parameters
        ----------
        x_mm, y_mm
            Coordinates of the grid's columns (k,) and rows (l,), mm.
        displacement_mm
            Displacement of the face towards the glass, mm, shape (l, k) or one number.
        slope_x, slope_y
            Its derivatives by x and y, of the same shapes; steeper slopes than 0.5 count as 0.5.
        """
        rows, columns = interpolation_matrix(self.nodes_mm, y_mm), interpolation_matrix(self.nodes_mm, x_mm).T
        shape = (rows.shape[0], columns.shape[1])
        displacement, along_x, along_y = (
            np.broadcast_to(np.asarray(part, dtype=float), shape) for part in (displacement_mm, slope_x, slope_y)
        )
        maps = self.terms.reshape(-1, *self.terms.shape[2:])
        terms = np.reshape([rows @ item @ columns for item in maps], (*self.terms.shape[:2], *shape))
        flatter = np.minimum(1.0, STEEPEST / np.maximum(np.hypot(along_x, along_y), STEEPEST))
        tilted = np.einsum("hkij,kij->hij", terms, powers(flatter * along_x, flatter * along_y))
        light = (tilted * _parabola_weights(self.displacement_mm, displacement)).sum(axis=0)
        return np.asarray(np.maximum(light, 0.0) * np.exp(self.lift_per_mm * displacement))

    def remaining(self, light: Floats, fraction: Floats) -> float:
        """Remaining fraction of ``light`` over an even grid of the face when contact absorbs ``fraction`` of it."""
        return float(1 / (1 + self.depletion * (light * fraction).sum() / light.sum()))

    def on(self, pressed: PressField | PressMap, *, saturation_kpa: float | None = None) -> LightMap:
        """Light on the face of one press as a map for the camera, with displacement and tilt included.

        With ``saturation_kpa``, the pressure at which real contact saturates, the map includes the contact's loss.
        """
        side, from_axis = face_grid(self.radius_mm)
        displacement, pressure = on_face(pressed, side, from_axis)
        slope_x, slope_y = slopes(displacement, side)
        x, coarse = side[::STRIDE], (slice(None, None, STRIDE),) * 2
        light = self.at(x, x, displacement_mm=displacement[coarse], slope_x=slope_x[coarse], slope_y=slope_y[coarse])
        if saturation_kpa is not None:
            inside = np.hypot(x, x[:, None]) < self.radius_mm
            light = light * self.remaining(light[inside], real_contact(pressure[coarse][inside], saturation_kpa))
        none = np.zeros_like(light)
        return LightMap(x_mm=x, y_mm=x, relative=light, flux_x=none, flux_y=none, growth_per_mm=none, error=self.error)

    def near_undented(self) -> LightMap:
        """The light for small dents: first order in the slope, its logarithm second order in the displacement.

        The flux belongs to the displacement of a `TYPICAL` dent. Growth and bend cover displacements up to `SMALL` of
        the second one, limited by `FASTEST_PER_MM`; beyond the rim they have the values of the nearest point inside.
        """
        level = np.maximum(self.terms[0, 0], 0.0)
        half, full = (fraction * SMALL * self.displacement_mm[1] for fraction in (0.5, 1.0))
        weights = _parabola_weights(self.displacement_mm, np.array(TYPICAL * full))
        typical = np.einsum("h,hkij->kij", weights, self.terms[:, :3])
        flux_x, flux_y = typical[1:] / np.maximum(typical[0], DARKEST)
        at_half, at_full = (self._log_growth(displacement) for displacement in (half, full))
        bend = (at_full / full - at_half / half) / (full - half)
        growth = at_half / half - bend * half
        outside = np.hypot(self.nodes_mm, self.nodes_mm[:, None]) > self.radius_mm
        nearest = scipy.ndimage.distance_transform_edt(outside, return_distances=False, return_indices=True)
        return LightMap(
            x_mm=self.nodes_mm,
            y_mm=self.nodes_mm,
            relative=level,
            flux_x=flux_x,
            flux_y=flux_y,
            growth_per_mm=np.clip(growth[tuple(nearest)], -FASTEST_PER_MM, FASTEST_PER_MM),
            bend_per_mm2=np.clip(bend[tuple(nearest)], -FASTEST_PER_MM / full, FASTEST_PER_MM / full),
            error=self.error,
            depletion=self.depletion,
        )

    def _log_growth(self, displacement_mm: float) -> Floats:
        """Logarithm of the relative change of light on the level face by a displacement, shape (n, n)."""
        weights = _parabola_weights(self.displacement_mm, np.array(displacement_mm))
        raised = np.einsum("h,hij->ij", weights, self.terms[:, 0])
        ratio = np.maximum(raised, DARKEST) / np.maximum(self.terms[0, 0], DARKEST)
        return np.asarray(np.log(ratio) + self.lift_per_mm * displacement_mm)


def _parabola_weights(nodes: Floats, at: Floats) -> Floats:
    """Weights of values at three displacements in the parabola through them, shape (3, *at.shape)."""
    inside = np.clip(at, 0.0, 1.25 * nodes[-1])
    others = [[nodes[j] for j in range(3) if j != i] for i in range(3)]
    pairs = zip(nodes, others, strict=True)
    return np.stack([(inside - a) * (inside - b) / ((here - a) * (here - b)) for here, (a, b) in pairs])


def leaving_light(
    light: Irradiance, pressed: PressField | PressMap, *, saturation_kpa: float, bins: int, by: LightMap | None = None
) -> tuple[Floats, Floats]:
    """Light that leaves through contact in each bin, and the mean displacement where it leaves, shape (bins, bins).

    The light is a fraction of the lamps' power, as in the tracer's map, and weights the displacement. ``by`` replaces
    the light on the face.
    """
    points = bins * max(1, FINE_POINTS // bins)
    spacing = 2 * light.radius_mm / points
    side: Floats = (np.arange(points, dtype=float) + 0.5) * spacing - light.radius_mm
    from_axis = np.hypot(side, side[:, None])
    displacement, pressure = on_face(pressed, side, np.minimum(from_axis, light.radius_mm))
    slope_x, slope_y = slopes(displacement, side)
    source = light if by is None else by
    arriving = source.at(side, side, displacement_mm=displacement, slope_x=slope_x, slope_y=slope_y)
    arriving = np.asarray(arriving, dtype=float)
    inside = from_axis < light.radius_mm
    fraction = np.where(inside, real_contact(pressure, saturation_kpa), 0.0)
    remaining = 1.0 if by is not None else light.remaining(arriving[inside], fraction[inside])
    out = light.mean_per_mm2 * spacing**2 * arriving * fraction * remaining
    fine = (bins, points // bins, bins, points // bins)
    total, weighted = (part.reshape(fine).sum(axis=(1, 3)) for part in (out, out * displacement))
    return total, weighted / np.maximum(total, np.finfo(float).tiny)
