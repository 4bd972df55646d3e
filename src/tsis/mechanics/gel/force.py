"""Newtons from a depth map of a gel sensor, with an interval."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError, MechanicsError
from tsis.mechanics.gel.contact import LARGEST_RATIO, GelGrid
from tsis.model.content import ContentValue
from tsis.model.gel_sensor import GelSensor
from tsis.model.require import require_array, require_integer, require_number, require_type

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from tsis.mechanics.gel.contact import Floats


SMALLEST_DEPTH_MM = 0.03  # shallower pixels count as untouched
CERTAIN = 3.0  # standard deviations of a depth that count as untouched
SHALLOW = 0.05  # of the deepest point
SMOOTHING_PX = 2.0
LARGE_STRAIN = 2.6  # of the correction; benchmarks/gel_force.py measures it by finite strain
DEEPEST, LARGEST_CORRECTION = 0.35, 1.35  # depth over thickness, and correction, to which it was measured
MODEL_SD = 0.03  # of the layer's model against finite strain in shallow presses
DRAW_PX = 100  # pixels along the longer side of the grid of a draw
DRAWS = 200


BEYOND_SAMPLES = 1.5  # times the least and greatest of the possible forces: a known force lies between
MOST_SCATTER = 0.3  # standard deviation of the logarithms of known over computed forces


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DepthErrors:
    """Standard deviations of a depth map: relative error of its scale, and error of its zero in mm."""

    scale_sd: float = 0.05
    offset_sd_mm: float = 0.01

    def __post_init__(self) -> None:
        require_number("scale_sd", self.scale_sd, 0.0, 1.0)
        require_number("offset_sd_mm", self.offset_sd_mm, 0.0, 10.0, hint="millimetres")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ForceScale:
    """Factor on the force that known weights gave, and its relative standard deviation.

    It replaces what is not known of the gel's modulus, thickness and Poisson's ratio. ``problems`` are reasons not to
    trust it, and with it no force that it scales.
    """

    factor: float
    relative_sd: float
    problems: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require_number("factor", self.factor, 1e-3, 1e3)
        require_number("relative_sd", self.relative_sd, 0.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GelForce(ContentValue):
    """Normal force on a gel sensor.

    Attributes
    ----------
    force_n
        Force at the best values of the gel.
    samples_n
        Force for values of gel and depth that are possible, ascending.
    pressure_kpa
        Pressure over the pixels at the best values.
    contact_area_mm2, deepest_mm
        Of the pressed pixels.
    strain_correction
        Factor for large strain in `force_n` and the pressure.
    problems
        Reasons not to trust the force; empty when there is none.
    """

    force_n: float
    samples_n: Floats
    pressure_kpa: Floats
    contact_area_mm2: float
    deepest_mm: float
    strain_correction: float
    problems: tuple[str, ...] = ()

    def interval_n(self, level: float = 0.9) -> tuple[float, float]:
        """Interval of the force that holds it with a probability of ``level``."""
        edge = (1.0 - require_number("level", level, 0.01, 0.999)) / 2
        low, high = np.quantile(self.samples_n, [edge, 1 - edge])
        return float(low), float(high)


def gel_force(
    depth_mm: ArrayLike,
    *,
    sensor: GelSensor,
    contact: NDArray[np.bool_] | None = None,
    sd_mm: ArrayLike | None = None,
    errors: DepthErrors | None = None,
    scale: ForceScale | None = None,
    smoothing_px: float = SMOOTHING_PX,
    draws: int = DRAWS,
    rng: np.random.Generator | None = None,
) -> GelForce:
    """Pressure and normal force from a depth map.

    Parameters
    ----------
    depth_mm
        Depth of the gel's face below the untouched face in mm, positive where pressed, shape (rows, columns).
    sensor
        The sensor with its gel; the map has the size of its frames.
    contact
        Pixels that may touch; by default those deeper than 0.03 mm, than a twentieth of the deepest, and than three
        times ``sd_mm``.
    sd_mm
        Standard deviation of each depth (`tsis.imaging.depth.DepthMap.sd_mm`): what lies within it is no contact.
    errors
        Errors of the depth map.
    scale
        What known weights gave (`gel_force_scale`).
    smoothing_px
        Standard deviation of the Gaussian that smooths the depth first, in [0, 20] pixels.
    draws
        Values of gel and depth to try, at least 20.
    rng
        Random generator of the draws; a fixed seed by default, so that a map has one answer.

    Raises
    ------
    InputError
        When the map has not the size of the sensor's frames, nothing is pressed in, or a value is out of range.
    MechanicsError
        When the pressure does not converge.
    """
    require_type("sensor", sensor, GelSensor)
    draws = require_integer("draws", draws, 20, 100_000)
    errors, rng = errors or DepthErrors(), rng or np.random.default_rng(0)
    depth, pixel = _checked(depth_mm, sensor, smoothing_px)
    touching = _contact(depth, contact, None if sd_mm is None else require_array("sd_mm", sd_mm, ndim=2))
    best = DrawnGel(sensor.young_kpa.best, min(sensor.poisson.best, LARGEST_RATIO), sensor.thickness_mm.best)
    pressure, force, correction = _press(depth, touching, pixel, best)
    factor = 1.0 if scale is None else scale.factor
    step = max(1, round(max(depth.shape) / DRAW_PX))
    coarse, coarse_touching = _binned(depth, step), _binned(touching.astype(float), step) > 0.5
    if not coarse_touching.any():
        step, coarse, coarse_touching = 1, depth, touching
    coarse_pixel = (pixel[0] * step, pixel[1] * step)
    reference = _press(coarse, coarse_touching, coarse_pixel, best)[1]
    samples = np.empty(draws)
    for number in range(draws):
        gel = best if scale is not None else drawn_gel(sensor, rng)
        if scale is None:
            size = float(np.exp(rng.normal(0.0, sensor.scale_uncertainty)))
            spread = float(np.exp(rng.normal(0.0, MODEL_SD)))
        else:
            size, spread = 1.0, float(np.exp(rng.normal(0.0, scale.relative_sd)))
        moved = coarse * np.exp(rng.normal(0.0, errors.scale_sd)) + rng.normal(0.0, errors.offset_sd_mm)
        part = coarse_touching & (moved > 0)
        if not part.any():
            samples[number] = 0.0
            continue
        _, drawn, large = _press(moved, part, (coarse_pixel[0] * size, coarse_pixel[1] * size), gel)
        samples[number] = drawn * spread * (1 + (large - 1) * rng.uniform(0.5, 1.5)) / large
    samples *= factor * force / reference
    samples.sort()
    pressed = pressure > 0
    return GelForce(
        force_n=force * factor,
        samples_n=require_array("samples_n", samples, ndim=1),
        pressure_kpa=require_array("pressure_kpa", pressure * factor, ndim=2),
        contact_area_mm2=float(pressed.sum()) * pixel[0] * pixel[1],
        deepest_mm=float(depth[touching].max()),
        strain_correction=correction,
        problems=(
            *_problems(sensor, pressed, float(depth[touching].max()) / best.thickness_mm, correction),
            *(() if scale is None else scale.problems),
        ),
    )


def gel_force_scale(forces: list[GelForce], known_n: list[float]) -> ForceScale:
    """Factor on the force from presses with known weights, with its standard deviation.

    One press leaves the press-to-press term at 10 %; more presses measure it, at least 3 %.

    Raises
    ------
    InputError
        When the numbers of presses and weights differ, or a force is not positive.
    """
    if not forces or len(forces) != len(known_n):
        raise InputError(f"known_n must give one force for each press; got {len(known_n)} for {len(forces)}")
    ratios: list[float] = []
    problems: dict[str, None] = {}
    for press, known in zip(forces, known_n, strict=True):
        require_number("known force", known, 1e-4, 1000.0, hint="newtons")
        ratios.append(float(np.log(known / require_number("force_n", press.force_n, 1e-9, 1e9))))
        problems |= dict.fromkeys(f"a press of a known force: {problem}" for problem in press.problems)
        low, high = press.samples_n[[0, -1]] * [1 / BEYOND_SAMPLES, BEYOND_SAMPLES]
        if not low <= known <= high:
            problems[
                f"a press of a known force of {known:.3g} N has {low:.2g} to {high:.2g} N by the limits of the gel: "
                "check the unit (newtons), the depth map and the sensor"
            ] = None
    count = len(ratios)
    scatter = 0.10 if count == 1 else max(0.03, float(np.std(ratios, ddof=1)))
    if scatter > MOST_SCATTER:
        problems[
            f"the presses of known forces scatter by {100 * scatter:.0f} % about one factor, more than "
            f"{100 * MOST_SCATTER:.0f} %: check each force and its depth map"
        ] = None
    return ForceScale(
        factor=float(np.exp(np.mean(ratios))),
        relative_sd=min(1.0, scatter * float(np.sqrt(1 + 1 / count))),
        problems=tuple(problems),
    )


@dataclass(frozen=True)
class DrawnGel:
    """A gel of the joint prior of modulus, Poisson's ratio and thickness."""

    young_kpa: float
    poisson: float
    thickness_mm: float


def _press(
    depth: Floats, contact: NDArray[np.bool_], pixel: tuple[float, float], gel: DrawnGel
) -> tuple[Floats, float, float]:
    """Pressure and force, corrected for large strain, and the correction."""
    grid = GelGrid(depth.shape, pixel, gel.young_kpa, gel.poisson, gel.thickness_mm)
    result = pressure_from_depth(depth, grid, contact=contact)
    radius = np.sqrt(float((result.pressure_kpa > 0).sum()) * pixel[0] * pixel[1] / np.pi)
    deepest = min(float(depth[contact].max()) / gel.thickness_mm, 1.0)
    correction = min(1.0 + LARGE_STRAIN * deepest**2 * radius / gel.thickness_mm, 2.0)
    return result.pressure_kpa * correction, result.force_n * correction, correction


def _checked(depth_mm: ArrayLike, sensor: GelSensor, smoothing_px: float) -> tuple[Floats, tuple[float, float]]:
    depth = require_array("depth_mm", depth_mm, ndim=2)
    pixel = sensor.scale_of(depth.shape[1], depth.shape[0])
    if pixel is None:
        raise InputError(f"mm_per_pixel of {sensor.name} is not known; put it into the sensor's file")
    require_number("smoothing_px", smoothing_px, 0.0, 20.0)
    return (scipy.ndimage.gaussian_filter(depth, smoothing_px) if smoothing_px else depth), pixel


def _contact(depth: Floats, contact: NDArray[np.bool_] | None, sd_mm: Floats | None) -> NDArray[np.bool_]:
    deepest = float(depth.max())
    if sd_mm is not None and sd_mm.shape != depth.shape:
        raise InputError(f"sd_mm must have the shape {depth.shape} of the depth map; got {sd_mm.shape}")
    if contact is None:
        contact = depth > max(SMALLEST_DEPTH_MM, SHALLOW * deepest)
        if sd_mm is not None:
            contact = contact & (depth > CERTAIN * sd_mm)
    elif contact.shape != depth.shape:
        raise InputError(f"contact must have the shape {depth.shape} of the depth map; got {contact.shape}")
    result = np.asarray(contact & (depth > 0))
    if not result.any():
        raise InputError(
            f"no pixel is pressed in by more than {SMALLEST_DEPTH_MM:g} mm and its uncertainty; the deepest is "
            f"{deepest:.3g} mm: give the depth in millimetres, positive into the gel"
        )
    return result


def _problems(sensor: GelSensor, pressed: NDArray[np.bool_], deepest: float, correction: float) -> tuple[str, ...]:
    problems = []
    if sensor.shape != "flat":
        problems.append(f"the gel of {sensor.name} is {sensor.shape}, and the model is a flat layer")
    if pressed[[0, -1]].any() or pressed[:, [0, -1]].any():
        problems.append("the contact reaches the border of the map, and the force beyond it is not seen")
    if deepest > DEEPEST:
        problems.append(
            f"the press is {100 * deepest:.0f} % of the gel's thickness deep, more than the correction for large "
            "strain was measured for"
        )
    elif correction > LARGEST_CORRECTION:
        problems.append(
            f"large strain raises the force {correction:.2f} times, more than the {LARGEST_CORRECTION:g} times that "
            "were measured"
        )
    return tuple(problems)


def drawn_gel(sensor: GelSensor, rng: np.random.Generator) -> DrawnGel:
    """Values of the gel between their limits: modulus and thickness even in their logarithm."""
    young, thickness = (
        float(np.exp(rng.uniform(*np.log(value.limits)))) for value in (sensor.believed_young_kpa, sensor.thickness_mm)
    )
    low, high = sensor.poisson.limits
    return DrawnGel(young, float(rng.uniform(low, min(high, LARGEST_RATIO))), thickness)


def _binned(values: Floats, step: int) -> Floats:
    """Means over squares of pixels."""
    rows, columns = values.shape[0] // step, values.shape[1] // step
    cut = values[: rows * step, : columns * step]
    return np.asarray(cut.reshape(rows, step, columns, step).mean(axis=(1, 3)))


TOLERANCE = 1e-3  # of the depth inside the contact, relative to the deepest point
MOST_STEPS = 600
MN_PER_N = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GelPressure:
    """Pressure over the pixels.

    Attributes
    ----------
    pressure_kpa
        Never negative, zero outside the contact.
    force_n
        Its sum over the pixels.
    residual_mm
        Largest difference of the depth inside the contact from the prescribed one.
    steps
        Steps of conjugate gradients.
    """

    pressure_kpa: Floats
    force_n: float
    residual_mm: float
    steps: int


def pressure_from_depth(
    depth_mm: Floats, grid: GelGrid, *, contact: NDArray[np.bool_], tolerance: float = TOLERANCE
) -> GelPressure:
    """Pressure that pushes the gel's face to a depth inside a contact and touches nothing outside it.

    Inside the contact the pressure is positive where the face lies at the prescribed depth, and zero where the gel lies
    deeper than prescribed by the pressure around it. The result is that of a rigid frictionless body of this shape.

    Parameters
    ----------
    depth_mm
        Depth of the face below the untouched face, mm, over the pixels of the grid.
    grid
        The gel.
    contact
        Pixels that may touch the object; a few pixels too many do no harm.
    tolerance
        Largest difference of the depth in the contact, relative to the deepest point.

    Raises
    ------
    InputError
        When the shapes differ, or no pixel of the contact is deeper than the untouched face.
    MechanicsError
        When the iteration does not converge.

    Notes
    -----
    Conjugate gradients with an active set after Polonsky and Keer, Wear 231 (1999) 206, for a given displacement;
    directions are smoothed by the inverse of the Green's function.
    """
    depth_mm = require_array("depth_mm", depth_mm, ndim=2)  # finite numbers
    if depth_mm.shape != grid.shape or contact.shape != grid.shape:
        raise InputError(f"depth and contact must have the grid's shape {grid.shape}; got {depth_mm.shape}")
    target = np.where(contact, depth_mm, 0.0)
    deepest = float(target.max(initial=0.0))
    if deepest <= 0:
        raise InputError("no pixel of the contact is pressed in: give the depth as positive millimetres into the gel")
    stiffness = 1.0 / grid.compliance.normal
    pressure = np.maximum(np.where(contact, grid.back(stiffness * grid.spectrum(target)), 0.0), 0.0)
    direction, former, restart = np.zeros_like(pressure), 1.0, True
    for step in range(MOST_STEPS):
        gap = np.where(contact, grid.depth_mm(pressure) - target, 0.0)  # negative: not yet deep enough
        touching = contact & (pressure > 0)
        active = touching | (contact & (gap < 0))
        error = float(np.abs(gap, where=active, out=np.zeros_like(gap)).max())
        if error <= tolerance * deepest:
            return _result(pressure, grid, error, step)
        gap *= active
        smooth = np.where(active, grid.back(stiffness * grid.spectrum(gap)), 0.0)
        now = float((gap * smooth).sum())
        direction = smooth + (0.0 if restart else now / former) * direction
        direction *= active
        former = now
        curvature = float((direction * grid.depth_mm(direction)).sum())
        length = float((gap * direction).sum()) / curvature
        moved = pressure - length * direction
        restart = bool((moved < 0).any())
        pressure = np.maximum(moved, 0.0)
    raise MechanicsError(
        f"the pressure did not converge in {MOST_STEPS} steps ({error:.2g} mm left): smooth the depth map, or give the "
        "contact"
    )


def _result(pressure: Floats, grid: GelGrid, error: float, steps: int) -> GelPressure:
    pixel_mm2 = grid.mm_per_pixel[0] * grid.mm_per_pixel[1]
    pressure.setflags(write=False)
    return GelPressure(
        pressure_kpa=pressure, force_n=float(pressure.sum()) * pixel_mm2 / MN_PER_N, residual_mm=error, steps=steps
    )
