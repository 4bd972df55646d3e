"""How much light reaches the probe's face from inside, wherever a press displaces and tilts it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import distance_transform_edt

from tsis.errors import InputError
from tsis.model import (
    LightMap,
    PressField,
    PressMap,
    interpolation_matrix,
    require_array,
    require_ascending,
    require_number,
)
from tsis.optics._asperities import real_contact
from tsis.optics.irradiance._fit import POWERS, RINGS, powers
from tsis.optics.rays import face_grid, on_face, slopes

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


SMALL = 0.35  # of the second known displacement: 0.28 mm in layers of 10 mm, as deep as tissue dents a probe
TYPICAL = 0.75  # of a small one: a face that is tilted is displaced as well
DARKEST = 0.02  # of the mean, below which a place's flux is no longer divided by its light
STEEPEST = 1.25 * RINGS[-1]  # slope up to which the even terms, known to the last ring, are trusted
FASTEST_PER_MM = 2.0  # growth that is believed: places lit at all change by less, dark ones are mostly noise
STRIDE = 2  # points of the tracer's grid to one of a map


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Irradiance:
    """Light that arrives at the face from inside, as a function of place, displacement and slope of the face.

    ``light = exp(lift u) * sum over k of terms[k](x, y, u) * slope_x^i slope_y^j`` with the exponents ``(i, j)`` of
    ``tsis.optics.irradiance._fit.POWERS``: the light on a level face, the flux of light along the face, and the even
    terms by which faces steeper than the light turn dark or catch light from below. Quadratic in the displacement.

    Attributes
    ----------
    radius_mm
        Radius of the face.
    nodes_mm
        Coordinates of the terms along x and y, shape (n,), ascending; linear between, those of the edge beyond.
    displacement_mm
        Displacements of the face towards the glass at which the terms are known, three of them from 0; light on faces
        displaced further than a quarter more than the last is that of there.
    terms
        Over the mean light on the undented face, shape (3, 11, n, n), rows along y.
    lift_per_mm
        What a dent's own flanks throw onto it, fitted on traced dents.
    depletion
        What a contact takes is missing elsewhere: light falls by ``1 / (1 + depletion * share)`` all over the face when
        contact takes that share of the light that arrives.
    mean_per_mm2
        Mean light on the undented face per mm², as a share of what the lamps send out.
    error
        Standard error of the light on the undented face by the number of rays, its root mean square over the face.

    Raises
    ------
    InputError
        When coordinates do not ascend, a value is not finite or a shape is not that of the grid.
    """

    radius_mm: float
    nodes_mm: NDArray[np.float64]
    displacement_mm: NDArray[np.float64]
    terms: NDArray[np.float64]
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
    ) -> NDArray[np.float64]:
        """Light on a dented face over a grid, over the mean on the undented one; never negative.

        Parameters
        ----------
        x_mm, y_mm
            Coordinates of the grid's columns (k,) and rows (l,), mm.
        displacement_mm
            Displacement of the face towards the glass, mm, shape (l, k) or one number.
        slope_x, slope_y
            Its derivatives by x and y, of the same shapes; faces steeper than 0.5 are lit as those of 0.5.
        """
        rows, columns = interpolation_matrix(self.nodes_mm, y_mm), interpolation_matrix(self.nodes_mm, x_mm).T
        shape = (rows.shape[0], columns.shape[1])
        shifted, along, layer = (
            np.broadcast_to(np.asarray(part, dtype=float), shape) for part in (displacement_mm, slope_x, slope_y)
        )
        maps = self.terms.reshape(-1, *self.terms.shape[2:])
        given = np.reshape([rows @ item @ columns for item in maps], (*self.terms.shape[:2], *shape))
        flatter = np.minimum(1.0, STEEPEST / np.maximum(np.hypot(along, layer), STEEPEST))
        tilted = np.einsum("hkij,kij->hij", given, powers(flatter * along, flatter * layer))
        light = (tilted * _through(self.displacement_mm, shifted)).sum(axis=0)
        return np.asarray(np.maximum(light, 0.0) * np.exp(self.lift_per_mm * shifted))

    def remaining(self, light: NDArray[np.float64], fraction: NDArray[np.float64]) -> float:
        """Share of ``light`` over an even grid of the face that is left when contact takes ``fraction`` of it there."""
        return float(1 / (1 + self.depletion * (light * fraction).sum() / light.sum()))

    def on(self, pressed: PressField | PressMap, *, saturation_kpa: float | None = None) -> LightMap:
        """Light on the face of one press as a map for the camera, in which displacement and tilt are done already.

        With ``saturation_kpa``, the pressure at which real contact saturates, so is what the contact takes from it.
        """
        side, from_axis = face_grid(self.radius_mm)
        shifted, pressure = on_face(pressed, side, from_axis)
        slope_x, slope_y = slopes(shifted, side)
        x, some = side[::STRIDE], (slice(None, None, STRIDE),) * 2
        light = self.at(x, x, displacement_mm=shifted[some], slope_x=slope_x[some], slope_y=slope_y[some])
        if saturation_kpa is not None:
            inside = np.hypot(x, x[:, None]) < self.radius_mm
            light = light * self.remaining(light[inside], real_contact(pressure[some][inside], saturation_kpa))
        none = np.zeros_like(light)
        return LightMap(x_mm=x, y_mm=x, relative=light, flux_x=none, flux_y=none, growth_per_mm=none, error=self.error)

    def near_undented(self) -> LightMap:
        """The same light to first order in the slope, the log of it to second in the displacement, for small dents.

        The flux is that at the displacement of a `TYPICAL` dent. Growth and bend are those up to `SMALL` of the second
        known displacement, bounded by `FASTEST_PER_MM`, and beyond the rim those of the nearest place inside.
        """
        level = np.maximum(self.terms[0, 0], 0.0)
        half, full = (fraction * SMALL * self.displacement_mm[1] for fraction in (0.5, 1.0))
        typical = np.einsum("h,hkij->kij", _through(self.displacement_mm, np.array(TYPICAL * full)), self.terms[:, :3])
        flux_x, flux_y = typical[1:] / np.maximum(typical[0], DARKEST)
        at_half, at_full = (self._log_growth(shifted) for shifted in (half, full))
        bend = (at_full / full - at_half / half) / (full - half)
        growth = at_half / half - bend * half
        outside = np.hypot(self.nodes_mm, self.nodes_mm[:, None]) > self.radius_mm
        nearest = distance_transform_edt(outside, return_distances=False, return_indices=True)
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

    def _log_growth(self, displacement_mm: float) -> NDArray[np.float64]:
        """Log of what displacing the level face does to its light, shape (n, n)."""
        raised = np.einsum("h,hij->ij", _through(self.displacement_mm, np.array(displacement_mm)), self.terms[:, 0])
        ratio = np.maximum(raised, DARKEST) / np.maximum(self.terms[0, 0], DARKEST)
        return np.asarray(np.log(ratio) + self.lift_per_mm * displacement_mm)


def _through(given: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights of values at three displacements in the parabola through them, shape (3, *at.shape)."""
    inside = np.clip(at, 0.0, 1.25 * given[-1])
    others = [[given[j] for j in range(3) if j != i] for i in range(3)]
    pairs = zip(given, others, strict=True)
    return np.stack([(inside - a) * (inside - b) / ((here - a) * (here - b)) for here, (a, b) in pairs])


FINE_POINTS = 480  # along each side of the square around the face


def leaving_light(
    light: Irradiance, pressed: PressField | PressMap, *, saturation_kpa: float, bins: int, by: LightMap | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Light that leaves through contact in each bin, and the mean displacement where it leaves, shape (bins, bins).

    The light is a share of what the lamps send out, as the tracer's map of it; the displacement is weighted by it.
    With ``by`` the light on the face is read off that map.
    """
    points = bins * max(1, FINE_POINTS // bins)
    spacing = 2 * light.radius_mm / points
    side: NDArray[np.float64] = (np.arange(points, dtype=float) + 0.5) * spacing - light.radius_mm
    from_axis = np.hypot(side, side[:, None])
    shifted, pressure = on_face(pressed, side, np.minimum(from_axis, light.radius_mm))
    slope_x, slope_y = slopes(shifted, side)
    there = (light if by is None else by).at(side, side, displacement_mm=shifted, slope_x=slope_x, slope_y=slope_y)
    inside = from_axis < light.radius_mm
    there = np.asarray(there, dtype=float)
    fraction = np.where(inside, real_contact(pressure, saturation_kpa), 0.0)
    left = 1.0 if by is not None else light.remaining(there[inside], fraction[inside])
    out = light.mean_per_mm2 * spacing**2 * there * fraction * left
    fine = (bins, points // bins, bins, points // bins)
    total, weighted = (part.reshape(fine).sum(axis=(1, 3)) for part in (out, out * shifted))
    return total, weighted / np.maximum(total, np.finfo(float).tiny)
