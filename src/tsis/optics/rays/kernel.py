"""Following a ray through the probe: its start at a lamp, intersections, reflection and refraction.

Starts are positions on a lamp's face from an even sequence, with directions by the lamp's cosine law. A ray meets wall,
face and interfaces.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tsis.compiled import fused, inlined
from tsis.optics.rays.geometry import contact_fraction, height_and_slopes, way_to_surface

if TYPE_CHECKING:
    from tsis.model.probe import Probe
    from tsis.optics.angles import Floats
    from tsis.optics.rays.geometry import Scene


# Fractional parts of the powers of 1/g, where g^5 = g + 1: the most even additive sequence in four dimensions.
_GOLDEN = 1.1673039782614187
STRIDES = tuple(int((_GOLDEN**-power % 1.0) * 2**53) << 11 for power in (1, 2, 3, 4))


class Lamps(NamedTuple):
    """Lit lamps, one a row: position (x, y, z), axis (x, y, z), radius, exponent and fraction of the power."""

    position: Floats
    axis: Floats
    radius: Floats
    exponent: Floats
    power_fraction: Floats


def lamps(probe: Probe) -> Lamps:
    """The lit lamps of a probe."""
    lit = [led for led in probe.leds if led.power > 0]
    azimuth, aim = (np.radians([getattr(led, name) for led in lit]) for name in ("azimuth_deg", "aim_deg"))
    height = np.array([probe.led_height_mm(led) for led in lit])
    power = np.array([led.power for led in lit])
    out_x, out_y = np.cos(azimuth), np.sin(azimuth)
    return Lamps(
        position=np.column_stack([probe.radius_mm * out_x, probe.radius_mm * out_y, height]),
        axis=np.column_stack([-out_x * np.cos(aim), -out_y * np.cos(aim), np.sin(aim)]),
        radius=np.array([led.diameter_mm / 2 for led in lit]),
        exponent=np.array([led.exponent for led in lit]),
        power_fraction=power / power.sum(),
    )


@inlined
def scrambled(number: np.uint64) -> np.uint64:
    """Pseudo-random number by splitmix64 (Steele, Lea and Flood 2014)."""
    number = np.uint64(number + np.uint64(0x9E3779B97F4A7C15))
    number = np.uint64((number ^ (number >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9))
    number = np.uint64((number ^ (number >> np.uint64(27))) * np.uint64(0x94D049BB133111EB))
    return np.uint64(number ^ (number >> np.uint64(31)))


@inlined
def unit(number: np.uint64) -> float:
    """A number in [0, 1) from the upper 53 bits."""
    return float(np.float64(number >> np.uint64(11)) * 2.0**-53)


@inlined
def emitted(
    lamps: Lamps, lamp: int, u: float, v: float, s: float, t: float
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Position and direction of a ray of a lamp from four numbers in [0, 1)."""
    out, polar = lamps.radius[lamp] * np.sqrt(u), 2 * np.pi * v
    px, py, pz = lamps.position[lamp, 0], lamps.position[lamp, 1], lamps.position[lamp, 2]
    from_axis = np.hypot(px, py)
    # The emitting face lies in the wall's tangent plane, which spans z and the horizontal tangent.
    along, up = out * np.cos(polar), out * np.sin(polar)
    x, y, z = px - along * py / from_axis, py + along * px / from_axis, pz + up
    cosine = (1.0 - s) ** (1.0 / (lamps.exponent[lamp] + 1.0))
    sine, around = np.sqrt(max(0.0, 1.0 - cosine * cosine)), 2 * np.pi * t
    ax, ay, az = lamps.axis[lamp, 0], lamps.axis[lamp, 1], lamps.axis[lamp, 2]
    # Two directions across the axis: a horizontal one, which exists because no lamp aims upwards, and the product.
    flat = np.hypot(ax, ay)
    hx, hy = -ay / flat, ax / flat
    vx, vy, vz = -az * hy, az * hx, ax * hy - ay * hx
    c, q = sine * np.cos(around), sine * np.sin(around)
    return (x, y, z), (cosine * ax + c * hx + q * vx, cosine * ay + c * hy + q * vy, cosine * az + q * vz)


Vector = tuple[float, float, float]
WALL = -1  # index of the wall among the intersected surfaces


@inlined
def reflectance(cosine: float, here: float, there: float) -> tuple[float, float]:
    """Reflected fraction of unpolarised light at an interface (Fresnel), and the cosine of the refracted ray."""
    ratio = here / there
    flat2 = ratio * ratio * (1.0 - cosine * cosine)
    if flat2 >= 1.0:
        return 1.0, 0.0
    through = np.sqrt(1.0 - flat2)
    # Amplitudes of both polarizations, (a - b) / (a + b) each, with one denominator: divisions are slow.
    s_less, s_more = ratio * cosine - through, ratio * cosine + through
    p_less, p_more = cosine - ratio * through, cosine + ratio * through
    both = s_more * p_more
    return 0.5 * ((s_less * p_more) ** 2 + (p_less * s_more) ** 2) / (both * both), through


@inlined
def mirrored(direction: Vector, normal: Vector, cosine: float) -> Vector:
    """A direction after reflection; the normal points to the incident side."""
    twice = 2.0 * cosine
    return direction[0] + twice * normal[0], direction[1] + twice * normal[1], direction[2] + twice * normal[2]


@inlined
def refracted(direction: Vector, normal: Vector, cosine: float, through: float, ratio: float) -> Vector:
    """A direction after refraction (Snell); ``ratio`` is the index before the interface over the index behind it."""
    bend = ratio * cosine - through
    return (
        ratio * direction[0] + bend * normal[0],
        ratio * direction[1] + bend * normal[1],
        ratio * direction[2] + bend * normal[2],
    )


@inlined
def next_meeting(scene: Scene, medium: int, last: int, position: Vector, direction: Vector) -> tuple[int, float]:
    """First surface that a ray in a medium intersects, the wall or an interface, and the distance."""
    x, y, _ = position
    dx, dy, _ = direction
    flat2 = dx * dx + dy * dy
    inward = x * dx + y * dy
    way = np.inf
    if flat2 > 0.0:
        root = inward * inward - flat2 * (x * x + y * y - scene.radius * scene.radius)
        way = max((-inward + np.sqrt(max(root, 0.0))) / flat2, 0.0)
    met = WALL
    for k in range(medium, medium + 2):
        side = 1.0 if k == medium else -1.0
        to = way_to_surface(scene.face, scene.level[k], scene.pull[k], side, position, direction, way, last == k)
        if to < way:
            way, met = to, k
    return met, way


@inlined
def stand_at(scene: Scene, medium: int, met: int, position: Vector) -> tuple[Vector, Vector, float, float]:
    """The intersection corrected for rounding, the normal towards the ray, and the face's slopes."""
    x, y, _ = position
    if met == WALL:
        inverse = 1.0 / np.sqrt(x * x + y * y)
        nx, ny = -x * inverse, -y * inverse
        return (-nx * scene.radius, -ny * scene.radius, position[2]), (nx, ny, 0.0), 0.0, 0.0
    side = 1.0 if met == medium else -1.0
    pull = scene.pull[met]
    if pull == 0.0:
        return (x, y, scene.level[met]), (0.0, 0.0, side), 0.0, 0.0
    height, slope_x, slope_y = height_and_slopes(scene.face, x, y)
    tilt_x, tilt_y = pull * slope_x, pull * slope_y
    size = side / np.sqrt(1.0 + tilt_x * tilt_x + tilt_y * tilt_y)
    return (x, y, scene.level[met] + pull * height), (-tilt_x * size, -tilt_y * size, size), slope_x, slope_y


@inlined
def index_behind(scene: Scene, medium: int, met: int) -> float:
    """Refractive index behind the surface that a ray in a medium intersects."""
    if met <= 0 or met == len(scene.indices):
        return scene.outside
    return float(scene.indices[met] if met > medium else scene.indices[met - 1])


# Indices of the tally; all but the number of meetings are fractions of the lamps' power.
MISSED, REFLECTED, SIDE, GLASS, FACE, CONTACT, ABSORBED, CUT, CAMERA, BEYOND, MEETINGS = range(11)
TALLIES = 11
# Maps of power over the face.
ARRIVING, FLUX_X, FLUX_Y, LOST, COUPLED = range(5)
MAPS = 5
_STRIDES = np.array(STRIDES, dtype=np.uint64)


class Record(NamedTuple):
    """Results of rays: the tally, maps (5, n, n), light on tilted faces (k, n, n), points of a path (m, 4)."""

    totals: Floats
    maps: Floats
    slopes: Floats
    tilted: Floats
    path: Floats


@fused
def trace_batch(scene: Scene, lamps: Lamps, seed: int, batch: int, rays: int, record: Record) -> None:
    """Trace ``rays`` rays of each lamp; they start at the points of an even sequence, shifted by ``seed``."""
    key = scrambled(np.uint64(scrambled(np.uint64(seed)) + np.uint64(batch)))
    for lamp in range(len(lamps.power_fraction)):
        lamp_key = scrambled(np.uint64(key + np.uint64(lamp)))
        weight = lamps.power_fraction[lamp] / rays
        shift = [scrambled(np.uint64(lamp_key + np.uint64(part))) for part in range(1, 5)]
        for ray in range(rays):
            u = unit(np.uint64(np.uint64(ray) * _STRIDES[0] + shift[0]))
            v = unit(np.uint64(np.uint64(ray) * _STRIDES[1] + shift[1]))
            s = unit(np.uint64(np.uint64(ray) * _STRIDES[2] + shift[2]))
            t = unit(np.uint64(np.uint64(ray) * _STRIDES[3] + shift[3]))
            position, direction = emitted(lamps, lamp, u, v, s, t)
            follow(
                scene, position, direction, weight, scrambled(np.uint64(lamp_key ^ scrambled(np.uint64(ray)))), record
            )


@inlined
def follow(scene: Scene, position: Vector, direction: Vector, weight: float, chance: np.uint64, record: Record) -> int:
    """Follow one ray from a lamp to its end; returns the number of points in ``record.path``."""
    totals, path = record.totals, record.path
    points = _note(path, 0, position, weight)
    weak = weight * scene.weak
    medium, position, direction, weight = _enter(scene, position, direction, weight, totals)
    if medium < 0:
        return points
    last = WALL
    for _ in range(scene.most_meetings):
        points = _note(path, points, position, weight)
        totals[MEETINGS] += 1.0
        met, way = next_meeting(scene, medium, last, position, direction)
        there = (position[0] + way * direction[0], position[1] + way * direction[1], position[2] + way * direction[2])
        position, normal, slope_x, slope_y = stand_at(scene, medium, met, there)
        if scene.absorption > 0.0:
            transmitted = weight * np.exp(-scene.absorption * way)
            totals[ABSORBED] += weight - transmitted
            weight = transmitted
        before = weight
        last = met
        cosine = max(-(direction[0] * normal[0] + direction[1] * normal[1] + direction[2] * normal[2]), 0.0)
        here, behind = scene.indices[medium], index_behind(scene, medium, met)
        back, through = reflectance(cosine, here, behind)
        if met == 0:
            weight -= _arrive(scene, record, position, slope_x, slope_y, direction, weight, back)
        elif met == WALL or met == len(scene.indices):
            lost = weight * (1.0 - back)
            totals[SIDE if met == WALL else GLASS] += lost
            if met != WALL and here * np.sqrt(max(0.0, 1.0 - cosine * cosine)) <= scene.aperture:
                totals[CAMERA] += lost
            weight -= lost
        elif back < 1.0:
            chance = scrambled(chance)
            if unit(chance) >= back:
                direction = refracted(direction, normal, cosine, through, here / behind)
                medium += 1 if met > medium else -1
                continue
        if weight < weak:
            totals[CUT] += weight
            chance = scrambled(chance)
            if unit(chance) * weak >= weight:
                return _note(path, points, position, before)
            weight = weak
            totals[CUT] -= weight
        direction = mirrored(direction, normal, cosine)
        if met == 0 and len(record.slopes) > 0:
            _record_reflected(scene, record, position, slope_x, slope_y, direction, weight, cosine)
    totals[CUT] += weight
    return _note(path, points, position, weight)


@inlined
def _enter(
    scene: Scene, position: Vector, direction: Vector, weight: float, totals: Floats
) -> tuple[int, Vector, Vector, float]:
    """Entry through the side wall: the medium (-1 for a missed probe), and position, direction and power inside."""
    x, y, z = position
    dx, dy, dz = direction
    flat2 = dx * dx + dy * dy
    inward = x * dx + y * dy
    root = inward * inward - flat2 * (x * x + y * y - scene.radius * scene.radius)
    if root <= 0.0 or inward >= 0.0:
        totals[MISSED] += weight
        return -1, position, direction, weight
    way = (-inward - np.sqrt(root)) / flat2
    x, y, z = x + dx * way, y + dy * way, z + dz * way
    low = scene.face.lowest
    if scene.face.highest > low:
        low, _, _ = height_and_slopes(scene.face, x, y)
    if z <= low or z >= scene.level[-1]:
        totals[MISSED] += weight
        return -1, position, direction, weight
    medium = 0
    while z > scene.level[medium + 1] + scene.pull[medium + 1] * low:
        medium += 1
    normal = (x / scene.radius, y / scene.radius, 0.0)
    cosine = -(dx * normal[0] + dy * normal[1])
    index = scene.indices[medium]
    back, through = reflectance(cosine, scene.outside, index)
    totals[REFLECTED] += weight * back
    weight -= weight * back
    direction = refracted(direction, normal, cosine, through, scene.outside / index)
    # In a flat stack n sin(angle from the axis) is constant; a lower layer of smaller index reflects the ray.
    if index * index * (1.0 - direction[2] * direction[2]) > scene.thinnest[medium] ** 2:
        totals[BEYOND] += weight
    return medium, (x, y, z), direction, weight


@inlined
def _arrive(
    scene: Scene,
    record: Record,
    position: Vector,
    slope_x: float,
    slope_y: float,
    direction: Vector,
    weight: float,
    back: float,
) -> float:
    """Record the light that arrives at the face; returns the light that leaves there."""
    row, column = _bin(scene, record, position)
    dx, dy, dz = direction
    into = dx * slope_x + dy * slope_y - dz  # per area of the face projected along the axis
    record.maps[ARRIVING, row, column] += weight
    record.maps[FLUX_X, row, column] += weight * dx / into
    record.maps[FLUX_Y, row, column] += weight * dy / into
    for k in range(len(record.slopes)):
        caught = into + dx * record.slopes[k, 0] + dy * record.slopes[k, 1]
        if caught > 0.0:
            record.tilted[k, row, column] += weight * caught / into
    coupled = weight * contact_fraction(scene.face, position[0], position[1]) if scene.face.touched else 0.0
    lost = (weight - coupled) * (1.0 - back)
    record.totals[CONTACT] += coupled
    record.totals[FACE] += lost
    record.maps[COUPLED, row, column] += coupled
    record.maps[LOST, row, column] += lost
    return float(coupled + lost)


@inlined
def _record_reflected(
    scene: Scene,
    record: Record,
    position: Vector,
    slope_x: float,
    slope_y: float,
    direction: Vector,
    weight: float,
    cosine: float,
) -> None:
    """Record the light on steeper faces from light that this face has reflected upwards."""
    row, column = _bin(scene, record, position)
    dx, dy, dz = direction
    into = cosine * np.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
    for k in range(len(record.slopes)):
        caught = dx * (slope_x + record.slopes[k, 0]) + dy * (slope_y + record.slopes[k, 1]) - dz
        if caught > 0.0:
            record.tilted[k, row, column] += weight * caught / into


@inlined
def _bin(scene: Scene, record: Record, position: Vector) -> tuple[int, int]:
    bins = record.maps.shape[1]
    scale = 0.5 * bins / scene.radius
    column, row = int((position[0] + scene.radius) * scale), int((position[1] + scene.radius) * scale)
    return min(max(row, 0), bins - 1), min(max(column, 0), bins - 1)


@inlined
def _note(path: Floats, points: int, position: Vector, weight: float) -> int:
    if points >= len(path):
        return points
    path[points, 0], path[points, 1], path[points, 2], path[points, 3] = position[0], position[1], position[2], weight
    return points + 1
