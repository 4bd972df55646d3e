"""Rendered frames of a gel sensor pressed by a ball: a bonded elastic layer, lamps at the sides, blur, noise.

The gel is an elastic layer bonded to a rigid backing, the ball is rigid and slides. The pressure follows from
the layer's compliance in wavenumbers (Johnson, Contact Mechanics, 1985, chapter 5), so that the face outside the
contact falls or bulges as thickness and Poisson's ratio demand. Light is Lambertian with a sheen, from lamps at finite
distances, or white light absorbed by the depth.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.mechanics.gel.contact import GelGrid
from tsis.model.gel_sensor import GelSensor
from tsis.model.probe import Layer
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.press import PressField


PRESSURES = 5  # terms (1 - r²)^(1/2), (3/2), ... of the pressure
LARGEST_POISSON = 0.494  # of the solver of finite strain
MARGIN = 1.4  # contact radii between the centre of a contact and the border of the frame
MARKER_RADIUS, MARKER_DARKNESS = 0.17, 0.85  # of the pitch, and of the light
FINEST, WAVENUMBERS = 150.0, 3000  # largest wavenumber times the contact's radius, and their number


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GelBallPress:
    """The face of a bonded gel under a rigid ball.

    Attributes
    ----------
    contact_radius_mm, depth_mm
        Radius of the contact, and travel of the ball's apex below the untouched face.
    radius_mm, face_mm
        Depth of the face below its untouched plane over the distance from the axis; positive is deeper.
    """

    contact_radius_mm: float
    depth_mm: float
    radius_mm: NDArray[np.float64]
    face_mm: NDArray[np.float64]


def ball_press(ball_radius_mm: float, contact_radius_mm: float, *, thickness_mm: float, poisson: float) -> GelBallPress:
    """The face when a ball touches it over a given radius; the modulus cancels.

    Raises
    ------
    InputError
        When the contact is wider than .95 of the ball, or a value lies outside its range.
    """
    require_number("ball_radius_mm", ball_radius_mm, 0.1, 100.0)
    a = require_number("contact_radius_mm", contact_radius_mm, 0.01, 0.95 * ball_radius_mm)
    k = (np.arange(WAVENUMBERS) + 0.5) * (FINEST / WAVENUMBERS)  # times the contact's radius
    kappa, w = 3 - 4 * poisson, np.minimum(k * (thickness_mm / a), 300.0)
    small, double = np.exp(-2 * w), np.exp(-4 * w)  # sinh and cosh divided by exp(2w), which overflows
    layer = (kappa * (1 - double) - 4 * w * small) / (kappa * (1 + double) + (1 + kappa**2 + 4 * w**2) * small)
    powers = np.arange(PRESSURES) + 0.5
    # Hankel transform of (1 - r²)^n, Sneddon: 2^n gamma(n + 1) J(n + 1, k) / k^(n + 1).
    transform = [
        2.0**n * scipy.special.gamma(n + 1) * scipy.special.jv(n + 1, k) / k ** (n + 1) * layer * (k[1] - k[0])
        for n in powers
    ]
    touched = np.linspace(0.0, 0.995, 60)
    shapes = scipy.special.j0(touched[:, None] * k) @ np.stack(transform, axis=1)
    shape = ball_radius_mm - np.sqrt(ball_radius_mm**2 - (a * touched) ** 2)
    # Depth inside is d - shape; these pressures end at zero on the edge, which sets d.
    solution = np.linalg.lstsq(np.column_stack([shapes, -np.ones(touched.size)]), -shape, rcond=1e-10)[0]
    depth = float(solution[-1])
    radius = np.concatenate([np.linspace(0.0, 3.0, 400), np.geomspace(3.03, 30.0, 60)]) * a
    face = scipy.special.j0(radius[:, None] / a * k) @ (np.stack(transform, axis=1) @ solution[:-1])
    inside = radius <= a
    face[inside] = depth - (ball_radius_mm - np.sqrt(ball_radius_mm**2 - radius[inside] ** 2))
    return GelBallPress(contact_radius_mm=a, depth_mm=depth, radius_mm=radius, face_mm=face)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GelLight:
    """Lamps and camera of a rendering; `random_gel_light` draws them.

    Attributes
    ----------
    azimuth_rad, elevation_rad, colour
        Direction of each lamp, shape (n,), and its red, green and blue, shape (n, 3).
    near
        Fall of the light with the distance from the lamp, over one width of the face; 0 for a lamp at infinity.
    sheen
        Strength of the mirror-like part.
    ambient
        Light from all sides, grey levels.
    vignetting
        Fall of the light from the middle of the frame to its corners, a fraction.
    texture
        The pattern of the untouched face, relative, shape of the frame.
    blur_px, noise_grey, drift
        Blur of the optics, noise of a pixel, relative drift of the lamps since the reference.
    absorption_per_mm
        White light: relative change of the light per mm of depth.
    """

    azimuth_rad: NDArray[np.float64]
    elevation_rad: NDArray[np.float64]
    colour: NDArray[np.float64]
    near: float
    sheen: float
    ambient: float
    texture: NDArray[np.float64] = field(repr=False)
    blur_px: float
    noise_grey: float
    drift: NDArray[np.float64]
    absorption_per_mm: float
    vignetting: float = 0.0


def random_gel_light(shape: tuple[int, int], rng: np.random.Generator, *, size_px: float) -> GelLight:
    """Lamps that no estimator knows: three or four of them, mixed colours, uneven, with texture, blur and noise."""
    count = int(rng.integers(3, 5))
    colour = np.abs(rng.normal(0.12, 0.08, (count, 3)))
    for lamp in range(count):
        colour[lamp, lamp % 3] += rng.uniform(0.7, 1.1)
    elevation = np.radians(rng.uniform(20.0, 50.0, count))
    colour /= (colour * np.sin(elevation)[:, None]).sum(axis=0).max()  # the camera's exposure
    texture = scipy.ndimage.gaussian_filter(rng.normal(size=shape), size_px * 2.0)
    texture *= rng.uniform(0.02, 0.08) / max(float(texture.std()), 1e-12)
    return GelLight(
        azimuth_rad=rng.uniform(0, 2 * np.pi) + 2 * np.pi * np.arange(count) / count + rng.normal(0, 0.15, count),
        elevation_rad=elevation,
        colour=colour,
        near=float(rng.uniform(0.0, 0.5)),
        sheen=float(rng.uniform(0.0, 0.15)),
        ambient=float(rng.uniform(5.0, 40.0)),
        texture=texture,
        blur_px=float(rng.uniform(0.5, 1.5) * max(size_px / 20.0, 0.5)),
        noise_grey=float(rng.uniform(0.7, 2.5)),
        drift=rng.normal(0.0, 0.01, 3),
        absorption_per_mm=float(rng.uniform(0.25, 0.5)),
        vignetting=float(rng.uniform(0.0, 0.3)),
    )


def gel_depth_mm(
    press: GelBallPress | None, sensor: GelSensor, columns: int, rows: int, centre_px: tuple[float, float]
) -> NDArray[np.float64]:
    """Depth of the face at each pixel, mm; zeros without a press."""
    require_type("sensor", sensor, GelSensor)
    scale = sensor.known_scale(columns, rows)
    if press is None:
        return np.zeros((rows, columns))
    y, x = np.mgrid[:rows, :columns]
    distance = np.hypot((x - centre_px[0]) * scale[0], (y - centre_px[1]) * scale[1])
    return np.asarray(np.interp(distance, press.radius_mm, press.face_mm, right=0.0))


def marker_ink(sensor: GelSensor, shift_mm: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """Ink of the printed markers at each pixel, from 0 to 1, shape (rows, columns); zeros without markers.

    ``shift_mm`` is how far (x, y) each point of the untouched face moved along it, shape (2, rows, columns).
    """
    (columns, rows), scale, pitch = sensor.image_px, sensor.mm_per_pixel, sensor.marker_pitch_mm
    ink = np.zeros((rows, columns))
    if scale is None or pitch is None:
        return ink
    across, down = (
        np.arange(pitch / 2, count * side, pitch) / side for count, side in zip((columns, rows), scale, strict=True)
    )
    reach = [int(2 * MARKER_RADIUS * pitch / side) + 2 for side in scale]
    for row, column in product(down, across):
        moved = np.zeros(2) if shift_mm is None else shift_mm[:, int(row), int(column)]
        middle = column + moved[0] / scale[0], row + moved[1] / scale[1]
        left, top = (max(int(part) - around, 0) for part, around in zip(middle, reach, strict=True))
        part = ink[top : top + 2 * reach[1], left : left + 2 * reach[0]]
        y, x = np.mgrid[: part.shape[0], : part.shape[1]]
        distance = np.hypot((x + left - middle[0]) * scale[0], (y + top - middle[1]) * scale[1])
        edge = (MARKER_RADIUS * pitch - distance) / scale[0] + 0.5  # a pixel on the edge is covered in part
        np.maximum(part, np.clip(edge, 0.0, 1.0), out=part)
    return ink


def render_gel(
    depth_mm: NDArray[np.float64],
    sensor: GelSensor,
    light: GelLight,
    rng: np.random.Generator,
    *,
    drift: bool = True,
    shift_mm: NDArray[np.float64] | None = None,
) -> NDArray[np.uint8]:
    """The frame of a face of that depth, shape (rows, columns, 3), 8 bits; ``shift_mm`` as in `marker_ink`."""
    rows, columns = depth_mm.shape
    sx, sy = sensor.scale_of(columns, rows) or (1.0, 1.0)
    slope_y, slope_x = np.gradient(depth_mm, sy, sx)
    long = np.sqrt(1.0 + slope_x**2 + slope_y**2)
    normal = np.stack([slope_x / long, slope_y / long, 1.0 / long], axis=-1)
    y, x = np.mgrid[:rows, :columns]
    u, v = (x - columns / 2) / columns, (y - rows / 2) / columns
    level = np.zeros((rows, columns, 3))
    if sensor.light == "rgb":
        for azimuth, elevation, colour in zip(light.azimuth_rad, light.elevation_rad, light.colour, strict=True):
            lamp = np.array(
                [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
            )
            shade = np.maximum(normal @ lamp, 0.0)
            half = lamp + np.array([0.0, 0.0, 1.0])
            shine = light.sheen * np.maximum(normal @ (half / np.linalg.norm(half)), 0.0) ** 20
            far = np.exp(light.near * (u * np.cos(azimuth) + v * np.sin(azimuth)) * 2.0)
            level += (far * (shade + shine))[..., None] * colour * 140.0
        level *= (1.0 + light.texture)[..., None]
    else:
        sign = 1.0 if sensor.pressed == "brighter" else -1.0
        base = 160.0 * (1.0 + light.texture) * np.exp(-light.near * (u**2 + v**2))
        change = np.tanh(light.absorption_per_mm * depth_mm * 1.2) / 1.2
        level += (base * np.maximum(1.0 + sign * change, 0.02))[..., None]
    level *= 1.0 - MARKER_DARKNESS * marker_ink(sensor, shift_mm)[..., None]
    if drift:
        level *= 1.0 + light.drift
    level += light.ambient
    level *= (1.0 - light.vignetting * (u**2 + v**2) / (0.25 + (rows / columns / 2) ** 2))[..., None]
    level = scipy.ndimage.gaussian_filter(level, (light.blur_px, light.blur_px, 0.0))
    level += rng.normal(0.0, light.noise_grey, level.shape)
    return np.clip(np.rint(level), 0, 255).astype(np.uint8)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RenderedPress:
    """A rendered press with its truth.

    Attributes
    ----------
    sensor
        The sensor, its scale exact.
    reference, frame
        Frames of the untouched and of the pressed sensor, shape (rows, columns, 3), 8 bits.
    ball_radius_mm, centre_px, radius_px
        The ball, and its contact.
    depth_mm
        Depth of the face, shape (rows, columns).
    force_n, shear_n
        Normal force of the press, None where the modulus cancelled; and shear force (x, y) on the gel.
    """

    sensor: GelSensor
    reference: NDArray[np.uint8]
    frame: NDArray[np.uint8]
    ball_radius_mm: float
    centre_px: tuple[float, float]
    radius_px: float
    depth_mm: NDArray[np.float64]
    force_n: float | None = None
    shear_n: tuple[float, float] = (0.0, 0.0)


def random_gel_press(
    sensor: GelSensor,
    rng: np.random.Generator,
    *,
    ball_radius_mm: float | None = None,
    light: GelLight | None = None,
    thickness_mm: float | None = None,
) -> RenderedPress:
    """A ball of 2 to 10 mm diameter pressed somewhere, on a gel and under lamps that are drawn too unless given."""
    columns, rows = sensor.image_px
    scale = sensor.known_scale(columns, rows)
    ball = float(rng.uniform(1.0, 5.0)) if ball_radius_mm is None else ball_radius_mm
    thickness = float(rng.uniform(*sensor.thickness_mm.limits)) if thickness_mm is None else thickness_mm
    widest = min(2.5, 0.28 * min(columns * scale[0], rows * scale[1]))
    touched = float(np.clip(ball * rng.uniform(0.3, 0.8), 0.5, min(widest, 0.9 * ball)))
    press = ball_press(
        ball, touched, thickness_mm=thickness, poisson=float(np.clip(rng.uniform(*sensor.poisson.limits), 0.0, 0.499))
    )
    radius_px = touched / float(np.sqrt(scale[0] * scale[1]))
    margin = 1.3 * radius_px
    centre = float(rng.uniform(margin, columns - margin)), float(rng.uniform(margin, rows - margin))
    lamps = random_gel_light((rows, columns), rng, size_px=radius_px) if light is None else light
    flat = gel_depth_mm(None, sensor, columns, rows, centre)
    depth = gel_depth_mm(press, sensor, columns, rows, centre)
    return RenderedPress(
        sensor=sensor,
        reference=render_gel(flat, sensor, lamps, rng, drift=False),
        frame=render_gel(depth, sensor, lamps, rng),
        ball_radius_mm=ball,
        centre_px=centre,
        radius_px=radius_px,
        depth_mm=depth,
    )


def rendered_series(sensor: GelSensor, count: int, *, ball_radius_mm: float, seed: int) -> list[RenderedPress]:
    """Presses of one ball on one sensor: the same lamps and gel, other places and depths."""
    rng = np.random.default_rng(seed)
    columns, rows = sensor.image_px
    light = random_gel_light((rows, columns), rng, size_px=0.08 * columns)
    thickness = float(rng.uniform(*sensor.thickness_mm.limits))
    return [
        random_gel_press(sensor, rng, ball_radius_mm=ball_radius_mm, light=light, thickness_mm=thickness)
        for _ in range(count)
    ]


def random_gel(sensor: GelSensor, rng: np.random.Generator) -> Layer:
    """A gel within the sensor's limits, the modulus even in its logarithm."""
    thickness = float(rng.uniform(*sensor.thickness_mm.limits))
    young, poisson = rng.uniform(*np.log(sensor.young_kpa.limits)), rng.uniform(*sensor.poisson.limits)
    return Layer(thickness_mm=thickness, young_kpa=float(np.exp(young)), poisson=float(min(poisson, LARGEST_POISSON)))


def random_place(sensor: GelSensor, radius_px: float, rng: np.random.Generator) -> tuple[float, float]:
    """Where a contact of that radius lies well inside the frame, pixels."""
    ends = [size - 1 for size in sensor.image_px]
    margins = [min(MARGIN * radius_px, 0.5 * end) for end in ends]
    x, y = (float(rng.uniform(margin, end - margin)) for margin, end in zip(margins, ends, strict=True))
    return x, y


def marker_drag_mm(
    field: PressField, sensor: GelSensor, gel: Layer, centre_px: tuple[float, float], shear: tuple[float, float]
) -> NDArray[np.float64] | None:
    """Movement (x, y) of the face by a press and by drag, which follows the pressure, at small strain.

    Shape (2, rows, columns); None without markers or scale. ``shear`` (x, y) is the drag over the pressure.
    """
    (columns, rows), scale = sensor.image_px, sensor.mm_per_pixel
    if sensor.marker_pitch_mm is None or scale is None:
        return None
    y, x = np.mgrid[:rows, :columns]
    distance = np.hypot((x - centre_px[0]) * scale[0], (y - centre_px[1]) * scale[1])
    pressure = np.interp(distance, field.radius_mm, field.pressure_kpa, right=0.0)
    grid = GelGrid((rows, columns), scale, gel.young_kpa, gel.poisson, gel.thickness_mm)
    return grid.displacement_mm(pressure, np.multiply.outer(np.asarray(shear), pressure))[:2]
