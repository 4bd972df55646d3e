"""The light on the face from inside, by position, displacement and slope.

Rays are traced to the untouched face, the evenly raised face, and the face under a few dents, and are cached on disk.
The counts become smooth by the lamps' symmetries, polynomials in the slope, and splines over the face.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.__about__ import LARGEST_SEED
from tsis.compiled import one_blas_thread
from tsis.errors import InputError
from tsis.files.cache import content_key, read_cached_arrays, write_cached_arrays
from tsis.model.calibration import LightMap
from tsis.model.press import PressField, PressMap, interpolation_matrix, require_ascending
from tsis.model.probe import Probe
from tsis.model.require import require_array, require_integer, require_number, require_type
from tsis.optics import angles as inputs
from tsis.optics.angles import real_contact
from tsis.optics.rays.geometry import (
    evenly_pressed_face,
    evenly_raised_face,
    face_grid,
    hertz_dent,
    on_face,
    scene,
    slopes,
)
from tsis.optics.rays.kernel import ARRIVING, COUPLED, FLUX_X, FLUX_Y
from tsis.optics.rays.tracing import trace_batches

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from numpy.typing import ArrayLike

    from tsis.model.press import PressField, PressMap
    from tsis.optics.angles import Floats
    from tsis.optics.rays.tracing import Batches


RINGS = (0.1, 0.2, 0.3, 0.4)  # slopes of the recorded tilted faces
DIRECTIONS = 8  # of slopes over half a turn; the flux gives the other half
POWERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (4, 0), (3, 1), (2, 2), (1, 3), (0, 4))
INTERVALS = 16  # of the splines, across the face
SUBPOINTS = 4  # of a bin's mean, along each side
STIFFNESS = 1e-4  # weight of the splines' second differences, relative to the counts


def watched_slopes() -> Floats:
    """Slopes (x, y) of the recorded tilted faces, shape (k, 2)."""
    angles = np.arange(DIRECTIONS) * np.pi / DIRECTIONS
    return np.concatenate([size * np.column_stack([np.cos(angles), np.sin(angles)]) for size in RINGS])


def powers(slope_x: Floats, slope_y: Floats) -> Floats:
    """The `POWERS` of slopes, along a new first axis."""
    return np.stack([slope_x**i * slope_y**j for i, j in POWERS])


def slope_terms(level: Floats, flux: Floats, tilted: Floats) -> Floats:
    """Coefficients of the `POWERS` of the slopes, from light (..., n, n), flux (..., 2, n, n) and tilted faces.

    Let p be a direction's horizontal part over its drop. A face tilted by s receives ``max(0, 1 + p s)`` of the falling
    light and ``max(0, p s - 1)`` of the light reflected upwards. Their sum is ``p s + max(1, |p s|)``: a linear term,
    which is exactly the flux, and an even term, which is fitted.
    """
    slopes = watched_slopes()
    even = tilted - level[..., None, :, :] - np.einsum("kp,...pij->...kij", slopes, flux)
    fit = np.linalg.pinv(powers(*slopes.T)[3:].T)
    return np.concatenate([level[..., None, :, :], flux, np.einsum("tk,...kij->...tij", fit, even)], axis=-3)


def symmetries(probe: Probe) -> list[Floats]:
    """Rotations by right angles and mirrors that map the lamps onto themselves, as 2 x 2 matrices."""
    rotation, mirror = np.array([[0.0, -1.0], [1.0, 0.0]]), np.diag([1.0, -1.0])
    candidates = [np.linalg.matrix_power(rotation, k) @ flip for k in range(4) for flip in (np.eye(2), mirror)]
    lit = [led for led in probe.leds if led.power > 0]
    azimuth = np.radians([led.azimuth_deg for led in lit])
    position = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    kind = [(probe.led_height_mm(led), led.aim_deg, led.half_angle_deg, led.diameter_mm, led.power) for led in lit]
    equal = np.array([[item == other for other in kind] for item in kind])

    def is_symmetry(matrix: Floats) -> bool:
        difference = np.abs((position @ matrix.T)[:, None, :] - position[None, :, :]).max(axis=2)
        return bool(((difference < 1e-9) & equal).any(axis=1).all())

    return [matrix for matrix in candidates if is_symmetry(matrix)]


def symmetrised(level: Floats, flux: Floats, tilted: Floats, matrices: list[Floats]) -> tuple[Floats, Floats, Floats]:
    """Means over symmetries of the maps, the flux and the slopes."""
    slopes, count = watched_slopes(), level.shape[-1]
    x, y = np.meshgrid(*2 * [np.arange(count) - (count - 1) / 2])
    images = []
    for matrix in matrices:
        # A map at a bin takes the value at the bin that the symmetry maps to it, with its slope.
        origin_x, origin_y = (
            np.rint(part + (count - 1) / 2).astype(int) for part in np.einsum("qp,qij->pij", matrix, [x, y])
        )
        origin = slopes @ matrix
        difference = np.abs(origin[:, None, None, :] - np.stack([slopes, -slopes])[None]).max(axis=3)
        opposite, index = np.divmod(difference.reshape(len(slopes), -1).argmin(axis=1), len(slopes))
        along = np.einsum("kp,...pij->...kij", slopes[index], flux)
        light = tilted[..., index, :, :] - 2 * opposite[:, None, None] * along
        images.append(
            (
                level[..., origin_y, origin_x],
                np.einsum("pq,...qij->...pij", matrix, flux)[..., origin_y, origin_x],
                light[..., origin_y, origin_x],
            )
        )
    first, second, third = (np.mean(part, axis=0) for part in zip(*images, strict=True))
    return first, second, third


def smooth(maps: Floats, radius_mm: float, nodes: Floats) -> Floats:
    """Values at ``nodes`` (along x and y) of cubic splines whose means over bins fit ``maps`` (..., n, n).

    The fit omits bins across the wall; nodes beyond the wall have the value at the wall.
    """
    bins = maps.shape[-1]
    size = 2 * radius_mm / bins
    inner = (np.arange(bins * SUBPOINTS) + 0.5) * size / SUBPOINTS - radius_mm
    along = _splines(inner, radius_mm).reshape(bins, SUBPOINTS, -1).mean(axis=1)
    corner = np.abs((np.arange(bins) + 0.5) * size - radius_mm) + size / 2
    whole = np.hypot(corner, corner[:, None]) <= radius_mm
    design = np.einsum("ia,jb->ijab", along, along)[whole].reshape(np.count_nonzero(whole), -1)
    count = along.shape[1]
    bent = np.diff(np.eye(count), n=2, axis=0)
    roughness = np.kron(bent.T @ bent, np.eye(count)) + np.kron(np.eye(count), bent.T @ bent)
    values = maps[..., whole].reshape(-1, design.shape[0]).T
    solved = np.linalg.solve(design.T @ design + STIFFNESS * roughness, design.T @ values)
    x, y = np.meshgrid(nodes, nodes)
    pull = radius_mm / np.maximum(np.hypot(x, y), radius_mm)
    at_x, at_y = (_splines((part * pull).ravel(), radius_mm) for part in (x, y))
    result = np.einsum("pa,pb,abm->mp", at_y, at_x, solved.reshape(count, count, -1), optimize=True)
    return np.asarray(result.reshape(*maps.shape[:-2], *x.shape))


def _splines(at: Floats, radius_mm: float) -> Floats:
    """Cubic B-splines over the face's width, shape (len(at), count)."""
    ends = np.linspace(-radius_mm, radius_mm, INTERVALS + 1)
    knots = np.concatenate([[-radius_mm] * 3, ends, [radius_mm] * 3])
    return np.asarray(scipy.interpolate.BSpline.design_matrix(np.clip(at, -radius_mm, radius_mm), knots, 3).toarray())


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
    ``tsis.optics.face_light.POWERS``: the light on a level face, the flux of light along the face, and even terms
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


FORMAT_VERSION = 2
RAISED = (0.0, 0.08, 0.16)  # of the layers' thickness
# Depth over the thickness; tip's radius and the position of its middle over the face's radius.
DENTS = ((0.04, 0.4, 0.0, 0.0), (0.08, 0.6, 0.2, 0.1), (0.13, 0.8, 0.0, 0.0), (0.06, 0.5, -0.15, 0.25))
SATURATION_KPA = 1.0  # the dents' peak pressure: the lift is fitted at nearly full contact
BINS, NODES = 48, 49
GROUPS = 8  # of batches; their spread gives the error
FEWEST_RAYS, MOST_RAYS = 10**5, 10**10


def irradiance(
    probe: Probe,
    *,
    rays: float = 4_000_000,
    seed: int = 1,
    index_outside: float = 1.0,
    absorption_per_mm: float = 0.0,
    progress: Callable[[int, int], None] | None = None,
    cached: bool = True,
) -> Irradiance:
    """Trace the light on a probe's face, or load it from the disk cache.

    Three quarters of the rays go through the untouched probe and two probes with an evenly raised face. Their light on
    tilted faces is recorded, averaged over the symmetries of the lamps and smoothed by splines. The last quarter goes
    through a level contact and four dents; it gives one number each for the loss of light by contact and for the
    reflection from a dent's flanks.

    Parameters
    ----------
    probe
        The probe with its lamps.
    rays
        Total number of rays, in [1e5, 1e10].
    seed
        Seed of their starts, a whole number from 0.
    index_outside
        Refractive index around the probe, in [1, 5].
    absorption_per_mm
        Absorption of layers and glass, in [0, 10].
    progress
        Called with (parts done, parts in all).
    cached
        Whether to read and write the disk cache; its key is the content of all arguments above.

    Raises
    ------
    InputError
        When a value lies outside its range or the face is dark.
    """
    require_type("probe", probe, Probe)
    rays = require_integer("rays", rays, FEWEST_RAYS, MOST_RAYS)
    seed = require_integer("seed", seed, 0, LARGEST_SEED)
    medium = {
        "index_outside": inputs.require_refractive_index("index_outside", index_outside),
        "absorption_per_mm": require_number("absorption_per_mm", absorption_per_mm, 0.0, 10.0),
    }
    key = content_key({"format": FORMAT_VERSION, "probe": _optical(probe), "rays": float(rays), "seed": seed, **medium})
    arrays = read_cached_arrays("irradiance", key) if cached else None
    if arrays is not None:
        fields: dict[str, Any] = {name: value if value.ndim else float(value) for name, value in arrays.items()}
        return Irradiance(**fields)
    with one_blas_thread():
        result = _traced(probe, rays / (len(RAISED) + 1), seed, medium, progress or (lambda _done, _total: None))
    if cached:
        write_cached_arrays("irradiance", key, {name: getattr(result, name) for name in Irradiance.__slots__})
    return result


def _optical(probe: Probe) -> dict[str, Any]:
    """The fields of a probe that its light depends on."""
    return {
        "radius_mm": probe.radius_mm,
        "layers": [(layer.thickness_mm, layer.refractive_index) for layer in probe.layers],
        "face_curvature_mm": probe.face_curvature_mm,
        "glass": asdict(probe.glass),
        "leds": [asdict(led) for led in probe.leds],
    }


def _traced(
    probe: Probe, rays: float, seed: int, medium: dict[str, float], progress: Callable[[int, int], None]
) -> Irradiance:
    """The light from ``rays`` rays for each of the raised faces, and as many for all dents."""
    parts = len(RAISED) + 1 + len(DENTS)
    steps = iter(range(1, parts + 1))

    def traced(pressed: PressField | PressMap, rays: float, slopes: Floats) -> Batches:
        view = scene(probe, pressed, saturation_kpa=SATURATION_KPA, aperture=0.0, **medium)
        result = trace_batches(view, probe, rays=rays, seed=seed, bins=BINS, slopes=slopes)
        progress(next(steps), parts)
        return result

    raised = np.array(RAISED) * probe.thickness_mm
    levels = [traced(evenly_raised_face(probe.radius_mm, height), rays, watched_slopes()) for height in raised]
    touched = traced(evenly_pressed_face(probe.radius_mm, SATURATION_KPA), rays / len(DENTS), np.empty((0, 2)))
    fraction = real_contact(np.array(SATURATION_KPA), SATURATION_KPA).item()
    arriving = [result.maps[:, ARRIVING].sum() / len(result.maps) for result in (levels[0], touched)]
    _check_lit(min(arriving))
    light = replace(_smoothed(probe, raised, levels), depletion=(arriving[0] / arriving[1] - 1) / fraction)
    logs, depths = [], []
    for depth, tip, x, y in DENTS:
        dent = hertz_dent(
            probe.radius_mm,
            tip_radius_mm=tip * probe.radius_mm,
            depth_mm=depth * probe.thickness_mm,
            peak_pressure_kpa=SATURATION_KPA,
            offset_mm=(x * probe.radius_mm, y * probe.radius_mm),
        )
        coupled = traced(dent, rays / len(DENTS), np.empty((0, 2))).maps[:, COUPLED].mean(axis=0).sum()
        model, displacement = leaving_light(light, dent, saturation_kpa=SATURATION_KPA, bins=1)
        _check_lit(min(coupled, model.item()))
        logs.append(np.log(coupled / model.item()))
        depths.append(displacement.item())
    return replace(light, lift_per_mm=float(np.dot(depths, logs) / np.dot(depths, depths)))


def _smoothed(probe: Probe, raised: Floats, levels: list[Batches]) -> Irradiance:
    """The light on evenly raised faces, from their rays."""
    matrices, nodes = symmetries(probe), np.linspace(-probe.radius_mm, probe.radius_mm, NODES)
    terms = []
    for result in levels:
        maps, tilted = (_grouped(part) for part in (result.maps, result.tilted))
        flux = maps[:, FLUX_X : FLUX_Y + 1]
        even = symmetrised(maps[:, ARRIVING], flux, tilted, matrices)
        terms.append(smooth(slope_terms(*even), probe.radius_mm, nodes))
    inside = np.hypot(nodes, nodes[:, None]) <= probe.radius_mm
    mean = float(terms[0][:, 0].mean(axis=0)[inside].mean())
    _check_lit(mean)
    spread = terms[0][:, 0].std(axis=0, ddof=1)[inside] / np.sqrt(GROUPS)
    return Irradiance(
        radius_mm=probe.radius_mm,
        nodes_mm=nodes,
        displacement_mm=raised,
        terms=np.array([grouped.mean(axis=0) for grouped in terms]) / mean,
        lift_per_mm=0.0,
        depletion=0.0,
        mean_per_mm2=mean / (2 * probe.radius_mm / BINS) ** 2,
        error=float(np.sqrt((spread**2).mean()) / mean),
    )


def _check_lit(light: float) -> None:
    if light <= 0:
        raise InputError("leds must light the face of the probe; hardly any ray reaches it from inside")


def _grouped(batches: Floats) -> Floats:
    """Means of groups of batches, shape (groups, ...)."""
    return np.asarray(batches.reshape(GROUPS, -1, *batches.shape[1:]).mean(axis=1))
