"""The scene of the tracers from a probe and a press: the pressed face on their grid, and where rays meet it.

Heights of the face and of the interfaces above it are a quadratic spline. Some dents have a closed form.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy

from tsis.compiled import fused, inlined
from tsis.errors import InputError
from tsis.model.press import MN_PER_N, PressField, PressMap
from tsis.model.probe import Probe
from tsis.model.require import require_type
from tsis.optics.angles import real_contact

if TYPE_CHECKING:
    from tsis.optics.angles import Floats


CELLS = 120  # of the grid along the face's radius
MARGIN = 3  # of its points beyond the wall


def face_grid(radius_mm: float) -> tuple[Floats, Floats]:
    """Coordinates along one side of the tracer's grid, mm, and distances from the axis, limited to the wall's."""
    side: Floats = radius_mm / CELLS * np.arange(-CELLS - MARGIN, CELLS + MARGIN + 1.0)
    return side, np.minimum(np.hypot(side, side[:, None]), radius_mm)


def on_face(pressed: PressField | PressMap, side: Floats, from_axis: Floats) -> tuple[Floats, Floats]:
    """Displacement and pressure at the tracer's grid, constant beyond the face's edge."""
    if isinstance(pressed, PressField):
        # Mirrored through the axis, so that the face is smooth there.
        radius, values = pressed.radius_mm, pressed.face_displacement_mm
        spline = scipy.interpolate.CubicSpline(
            np.concatenate([-radius[:0:-1], radius]), np.concatenate([values[:0:-1], values])
        )
        at = np.minimum(from_axis, radius[-1])
        return np.asarray(spline(at)), np.interp(at, radius, pressed.pressure_kpa)
    outside = np.hypot(pressed.x_mm, pressed.y_mm[:, None]) > from_axis.max()
    nearest = scipy.ndimage.distance_transform_edt(outside, return_distances=False, return_indices=True)

    def at_grid(values: Floats, order: int) -> Floats:
        along_y, along_x = (min(order, count - 1) for count in values.shape)
        spline = scipy.interpolate.RectBivariateSpline(
            pressed.y_mm, pressed.x_mm, values[tuple(nearest)], kx=along_y, ky=along_x, s=0
        )
        y, x = (np.clip(side, ends[0], ends[-1]) for ends in (pressed.y_mm, pressed.x_mm))
        return np.asarray(spline(y, x))

    return at_grid(pressed.face_displacement_mm, 3), at_grid(pressed.pressure_kpa, 1)


def slopes(displacement_mm: Floats, side: Floats) -> tuple[Floats, Floats]:
    """Derivatives of a displacement by x and y on an even square grid."""
    step = float(side[1] - side[0])
    return np.gradient(displacement_mm, step, axis=1), np.gradient(displacement_mm, step, axis=0)


def evenly_raised_face(radius_mm: float, displacement_mm: float) -> PressField:
    """An evenly displaced face without contact."""
    radius = np.linspace(0.0, radius_mm, 9)
    return PressField(
        radius_mm=radius,
        face_displacement_mm=np.full(9, displacement_mm),
        pressure_kpa=np.zeros(9),
        approach_mm=displacement_mm,
        force_n=0.0,
    )


def evenly_pressed_face(radius_mm: float, pressure_kpa: float) -> PressField:
    """A level face under an even pressure."""
    force_n = pressure_kpa * np.pi * radius_mm**2 / MN_PER_N
    return replace(evenly_raised_face(radius_mm, 0.0), pressure_kpa=np.full(9, pressure_kpa), force_n=force_n)


def hertz_dent(
    radius_mm: float,
    *,
    tip_radius_mm: float,
    depth_mm: float,
    peak_pressure_kpa: float,
    offset_mm: tuple[float, float] = (0.0, 0.0),
) -> PressMap:
    """The dent of a sphere in a half-space (Hertz), over a face of ``radius_mm``, with a peak pressure."""
    side, _ = face_grid(radius_mm)
    radius = np.hypot(side - offset_mm[0], side[:, None] - offset_mm[1])
    contact = np.sqrt(tip_radius_mm * depth_mm)
    out = np.maximum(radius, contact)
    level = np.sqrt(np.maximum(out**2 - contact**2, 0.0))  # rounding may make it negative at the edge
    beyond = (2 * contact**2 - out**2) * np.arcsin(contact / out) + contact * level
    inside = depth_mm - radius**2 / (2 * tip_radius_mm)
    return PressMap(
        x_mm=side,
        y_mm=side,
        face_displacement_mm=np.where(radius < contact, inside, beyond / (np.pi * tip_radius_mm)),
        pressure_kpa=peak_pressure_kpa * np.sqrt(np.maximum(1 - (radius / contact) ** 2, 0.0)),
        approach_mm=depth_mm,
        force_n=2 / 3 * peak_pressure_kpa * np.pi * contact**2 / MN_PER_N,
    )


def tip_press(radius_mm: Floats, displacement_mm: Floats, *, contact_radius_mm: float, force_n: float) -> PressField:
    """A sphere pressed on the middle of a face: a given displacement with the pressure of Hertz."""
    peak_kpa = 1.5 * force_n * MN_PER_N / (np.pi * contact_radius_mm**2)
    inside = np.maximum(1 - (radius_mm / contact_radius_mm) ** 2, 0.0)
    return PressField(
        radius_mm=radius_mm,
        face_displacement_mm=displacement_mm,
        pressure_kpa=peak_kpa * np.sqrt(inside),
        approach_mm=float(displacement_mm[0]),
        force_n=force_n,
    )


SMALLEST_STEP_MM = 0.1  # a ray that cuts a surface over a shorter distance misses it
AFTER_BOUNCE_MM = 1e-7
ROUNDING_MM = 1e-11
POLISHES = 60


class Heights(NamedTuple):
    """The face's height above its undeformed apex, and the fraction of real contact, over a square grid."""

    start: float
    spacing: float
    coefficients: Floats  # of the quadratic spline through the heights
    contact_fraction: Floats
    lowest: float
    highest: float
    steepest: float
    touched: bool


def heights(side_mm: Floats, height_mm: Floats, fraction: Floats) -> Heights:
    """The smooth surface through heights on an even square grid."""
    spacing = float(side_mm[1] - side_mm[0])
    coefficients = np.ascontiguousarray(scipy.ndimage.spline_filter(height_mm, order=2, mode="mirror"))
    along_x = np.abs(np.diff(coefficients, axis=1)).max() / spacing
    along_y = np.abs(np.diff(coefficients, axis=0)).max() / spacing
    return Heights(
        start=float(side_mm[0]),
        spacing=spacing,
        coefficients=coefficients,
        contact_fraction=np.ascontiguousarray(fraction),
        lowest=float(coefficients.min()),
        highest=float(coefficients.max()),
        steepest=float(np.hypot(along_x, along_y)),
        touched=bool((fraction > 0).any()),
    )


@inlined
def height_and_slopes(face: Heights, x: float, y: float) -> tuple[float, float, float]:
    """Height of the face and its derivatives by x and y."""
    u, v = (x - face.start) / face.spacing, (y - face.start) / face.spacing
    column, row = int(u + 0.5), int(v + 0.5)
    s, t = u - column, v - row
    value = along_x = along_y = 0.0
    for j in range(-1, 2):
        weight, change = _spline(j, t)
        line = slope = 0.0
        for i in range(-1, 2):
            here, here_change = _spline(i, s)
            coefficient = face.coefficients[row + j, column + i]
            line += here * coefficient
            slope += here_change * coefficient
        value += weight * line
        along_x += weight * slope
        along_y += change * line
    return value, along_x / face.spacing, along_y / face.spacing


@inlined
def _spline(part: int, s: float) -> tuple[float, float]:
    """One of the three pieces of the quadratic B-spline that cover a point, and its derivative."""
    if part < 0:
        return 0.5 * (0.5 - s) ** 2, s - 0.5
    if part > 0:
        return 0.5 * (0.5 + s) ** 2, s + 0.5
    return 0.75 - s * s, -2.0 * s


@inlined
def contact_fraction(face: Heights, x: float, y: float) -> float:
    """Fraction of real contact, linear between grid points."""
    u, v = (x - face.start) / face.spacing, (y - face.start) / face.spacing
    column, row = int(u), int(v)
    s, t = u - column, v - row
    lower = (1 - s) * face.contact_fraction[row, column] + s * face.contact_fraction[row, column + 1]
    upper = (1 - s) * face.contact_fraction[row + 1, column] + s * face.contact_fraction[row + 1, column + 1]
    return float((1 - t) * lower + t * upper)


@inlined
def way_to_surface(
    face: Heights,
    level: float,
    pull: float,
    side: float,
    position: tuple[float, float, float],
    direction: tuple[float, float, float],
    limit: float,
    leaving: bool,
) -> float:
    """Distance along a ray to the surface ``level + pull * height``, infinite beyond ``limit``.

    ``side`` is 1 for a ray above the surface and -1 below it; ``leaving`` is True when the ray starts on it.
    """
    if pull != 0.0 and face.highest > face.lowest:
        return _way_to_curved(face, level, pull, side, position, direction, limit, leaving)
    closing = -side * direction[2]
    if closing <= 0.0 or leaving:
        return np.inf
    way = max(side * (position[2] - level - pull * face.lowest), 0.0) / closing
    return way if way < limit else np.inf


@fused
def _way_to_curved(
    face: Heights,
    level: float,
    pull: float,
    side: float,
    position: tuple[float, float, float],
    direction: tuple[float, float, float],
    limit: float,
    leaving: bool,
) -> float:
    """Distance to a curved surface: steps limited by the steepest slope, then a bracketed search."""
    x, y, z = position
    dx, dy, dz = direction
    closing = -side * dz
    nearest = level + pull * (face.highest if side > 0 else face.lowest)
    way = AFTER_BOUNCE_MM if leaving else 0.0
    free = side * (z - nearest)
    if free > 0.0:
        if closing <= 0.0:
            return np.inf
        way = max(way, free / closing)
    fastest = pull * face.steepest * np.sqrt(dx * dx + dy * dy) + closing
    if fastest <= 0.0:
        return np.inf
    before, gap_before, started = way, 0.0, False
    while before < limit:
        way = min(way, limit)
        height, _, _ = height_and_slopes(face, x + dx * way, y + dy * way)
        gap = side * (z + dz * way - level - pull * height)
        if gap <= 0.0:
            if not started:
                return way
            return _crossing(face, level, pull, side, position, direction, before, gap_before, way, gap)
        if closing <= 0.0 and side * (z + dz * way - nearest) > 0.0:
            return np.inf
        before, gap_before, started = way, gap, True
        way += max(gap / fastest, SMALLEST_STEP_MM)
    return np.inf


@fused
def _crossing(
    face: Heights,
    level: float,
    pull: float,
    side: float,
    position: tuple[float, float, float],
    direction: tuple[float, float, float],
    above: float,
    gap_above: float,
    below: float,
    gap_below: float,
) -> float:
    """The intersection between two distances, by regula falsi (Illinois)."""
    x, y, z = position
    dx, dy, dz = direction
    last = 0
    way = above
    for _ in range(POLISHES):
        way = (above * gap_below - below * gap_above) / (gap_below - gap_above)
        height, _, _ = height_and_slopes(face, x + dx * way, y + dy * way)
        gap = side * (z + dz * way - level - pull * height)
        if abs(gap) < ROUNDING_MM:
            break
        if gap > 0.0:
            above, gap_above = way, gap
            if last == 1:
                gap_below *= 0.5
            last = 1
        else:
            below, gap_below = way, gap
            if last == -1:
                gap_above *= 0.5
            last = -1
    return way


THINNEST = 0.05  # least remaining fraction of the layers' thickness under a dent
WEAK = 0.1  # fraction of its first power below which a ray ends at random or continues with this power
MOST_MEETINGS = 1000
APERTURE = 0.1  # numerical, of the camera's lens


class Scene(NamedTuple):
    """The probe for the tracers: media from the face up, each between two interfaces, glass last.

    Interface ``k`` lies at ``level[k] + pull[k] * height``: layers under a dent are compressed in proportion.
    """

    radius: float
    level: Floats
    pull: Floats
    indices: Floats
    thinnest: Floats  # lowest index from the face up to each medium
    outside: float
    absorption: float
    face: Heights
    aperture: float
    weak: float
    most_meetings: int


def scene(
    probe: Probe,
    pressed: PressField | PressMap | None,
    *,
    saturation_kpa: float = 20.0,
    index_outside: float = 1.0,
    absorption_per_mm: float = 0.0,
    aperture: float = APERTURE,
) -> Scene:
    """The scene of a probe under the press ``pressed``."""
    require_type("probe", probe, Probe)
    if pressed is not None and not isinstance(pressed, PressField | PressMap):
        raise InputError(f"pressed must be a PressField, a PressMap or None; got {pressed!r:.80}")
    side, height, fraction = pressed_face(probe, pressed, saturation_kpa)
    thickness = probe.thickness_mm
    rest = float(thickness - height.max())
    if rest < THINNEST * thickness:
        raise InputError(
            f"face_displacement_mm must leave {THINNEST:.0%} of the layers' {thickness:g} mm; it leaves {rest:.3g} mm"
        )
    indices, levels = media(probe)
    return Scene(
        radius=probe.radius_mm,
        level=levels,
        pull=np.maximum(1.0 - levels / thickness, 0.0),
        indices=indices,
        thinnest=np.minimum.accumulate(indices),
        outside=index_outside,
        absorption=absorption_per_mm,
        face=heights(side, height, fraction),
        aperture=aperture,
        weak=WEAK,
        most_meetings=MOST_MEETINGS,
    )


def pressed_face(
    probe: Probe, pressed: PressField | PressMap | None, saturation_kpa: float
) -> tuple[Floats, Floats, Floats]:
    """Coordinates along one side of the tracer's grid, and there the face's height and its real contact."""
    side, from_axis = face_grid(probe.radius_mm)
    height = probe.sag_mm(from_axis)
    if pressed is None:
        return side, height, np.zeros(from_axis.shape)
    displacement, pressure = on_face(pressed, side, from_axis)
    return side, height + displacement, real_contact(pressure, saturation_kpa)


def media(probe: Probe) -> tuple[Floats, Floats]:
    """Refractive indices from the face up and the levels between them; neighbours of equal index are one medium."""
    parts = [(layer.refractive_index, layer.thickness_mm) for layer in probe.layers]
    parts.append((probe.glass.refractive_index, probe.glass.thickness_mm))
    indices: list[float] = []
    levels, top = [0.0], 0.0
    for index, thickness in parts:
        top += thickness
        if indices and indices[-1] == index:
            levels[-1] = top
        else:
            indices.append(index)
            levels.append(top)
    return np.array(indices), np.array(levels)
