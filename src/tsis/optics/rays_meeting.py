"""One meeting of a ray with a wall, the face or an interface: where it is, how it stands, what becomes of the light."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.model.compiled import inlined
from tsis.optics.rays_surface import height_and_slopes, way_to_surface

if TYPE_CHECKING:
    from tsis.optics.rays_scene import Scene

Vector = tuple[float, float, float]
WALL = -1  # what is met, when it is no interface


@inlined
def reflectance(cosine: float, here: float, there: float) -> tuple[float, float]:
    """Share of unpolarised light that an interface reflects (Fresnel), and the cosine of what goes through."""
    ratio = here / there
    flat2 = ratio * ratio * (1.0 - cosine * cosine)
    if flat2 >= 1.0:
        return 1.0, 0.0
    through = np.sqrt(1.0 - flat2)
    # Amplitudes of both polarizations, (a - b) / (a + b) each, over one denominator: divisions take most of the time.
    s_less, s_more = ratio * cosine - through, ratio * cosine + through
    p_less, p_more = cosine - ratio * through, cosine + ratio * through
    both = s_more * p_more
    return 0.5 * ((s_less * p_more) ** 2 + (p_less * s_more) ** 2) / (both * both), through


@inlined
def mirrored(direction: Vector, normal: Vector, cosine: float) -> Vector:
    """A direction after reflection; the normal points to where the ray came from."""
    turn = 2.0 * cosine
    return direction[0] + turn * normal[0], direction[1] + turn * normal[1], direction[2] + turn * normal[2]


@inlined
def refracted(direction: Vector, normal: Vector, cosine: float, through: float, ratio: float) -> Vector:
    """A direction after refraction (Snell), ``ratio`` being the index before over that behind."""
    bend = ratio * cosine - through
    return (
        ratio * direction[0] + bend * normal[0],
        ratio * direction[1] + bend * normal[1],
        ratio * direction[2] + bend * normal[2],
    )


@inlined
def next_meeting(scene: Scene, medium: int, last: int, position: Vector, direction: Vector) -> tuple[int, float]:
    """What a ray in a medium meets first, the wall or an interface, and the way there."""
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
    """The point that was met, freed of rounding, the normal towards the ray there, and the face's slopes."""
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
    """Refractive index behind what a ray in a medium meets."""
    if met <= 0 or met == len(scene.indices):
        return scene.outside
    return float(scene.indices[met] if met > medium else scene.indices[met - 1])
