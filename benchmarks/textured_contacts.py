"""Contacts of textured balls, foams and soft edges in rendered frames: how many are good, and how right is the radius?

    python -m benchmarks.textured_contacts --seed 8801 --presses 12

Each press draws its object, texture, gel, lamps, blur and noise. `pressed` solves the contact of a rough object, rigid
or soft, with a bonded gel layer by conjugate gradients on a grid (Polonsky and Keer 1999), which no estimator of
contacts uses; its radius is that of the area of the contact with the gaps between touching asperities closed.
`imprinted` adds a texture to the dent of a smooth ball, whose radius is exact. A soft edge is a smooth ball's dent
blurred by 0.1 to 0.3 of the radius, or one under a pressure that falls to zero smoothly, as under a ball with a soft
skin; the radius of the latter is Hertz's of the same second moment of the pressure. Frames are shaded by
`tsis.virtual.gel_frames`.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
import scipy
from benchmarks.harness import Bench, Goal
from rich.progress import track

from tsis.catalog.sensors import load_sensor
from tsis.imaging.gel_contact import contacts
from tsis.virtual.gel_frames import ball_press, gel_depth_mm, random_gel_light, render_gel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.gel_sensor import GelSensor

SENSORS = ("gelsight-mini", "gelsight-wedge", "9dtact")
KINDS = ("smooth ball", "textured ball", "soft textured ball", "foam", "imprint", "soft edge")
WIDTH_90 = 1.645
MOST_STEPS, LEFT = 250, 2e-3  # of the conjugate gradients; the gap that may be left, of the deepest
CLOSED = 0.2  # of the radius: gaps between asperities that count as touched


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TexturedPress:
    """A rendered press and its truth."""

    kind: str
    sensor: GelSensor
    reference: NDArray[np.uint8]
    frame: NDArray[np.uint8]
    centre_px: tuple[float, float]
    radius_px: float


def roughness(shape: tuple[int, int], wave_px: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """A random relief of a wavelength, of unit standard deviation."""
    noise = rng.normal(size=shape)
    relief = scipy.ndimage.gaussian_filter(noise, 0.2 * wave_px) - scipy.ndimage.gaussian_filter(noise, 0.4 * wave_px)
    return np.asarray(relief / relief.std())


def dimples(shape: tuple[int, int], wave_px: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Three waves at 60 degrees, as of dimples, of unit standard deviation."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    turn, phase = rng.uniform(0, np.pi), rng.uniform(0, 2 * np.pi, 3)
    waves = [
        np.cos(2 * np.pi * (x * np.cos(turn + k * np.pi / 3) + y * np.sin(turn + k * np.pi / 3)) / wave_px + phase[k])
        for k in range(3)
    ]
    relief = np.sum(waves, axis=0)
    return np.asarray(relief / relief.std())


def cells(shape: tuple[int, int], wave_px: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Open cells between walls, as of a cut foam: distance from the walls, negative, of unit standard deviation."""
    count = max(int(shape[0] * shape[1] / wave_px**2), 4)
    seeds = rng.uniform(0, 1, (count, 2)) * shape
    y, x = np.mgrid[: shape[0], : shape[1]]
    near = np.asarray(scipy.spatial.cKDTree(seeds).query(np.stack([y, x], axis=-1), k=2)[0])
    wall = np.minimum(near[..., 1] - near[..., 0], 0.6 * wave_px)
    relief = -scipy.ndimage.gaussian_filter(wall, 0.06 * wave_px)
    return np.asarray((relief - relief.mean()) / relief.std())


def layer(wave: NDArray[np.float64], poisson: float, thickness: float) -> NDArray[np.float64]:
    """Normal compliance of a bonded layer of unit plane-strain modulus (Johnson, Contact Mechanics, 5.8)."""
    kappa, w = 3 - 4 * poisson, np.minimum(wave * thickness, 300.0)
    small, double = np.exp(-2 * w), np.exp(-4 * w)
    ratio = (kappa * (1 - double) - 4 * w * small) / (kappa * (1 + double) + (1 + kappa**2 + 4 * w**2) * small)
    return np.asarray(2.0 * ratio / np.maximum(wave, 1e-9))


def pressed(
    height: NDArray[np.float64], depth: float, side: float, *, poisson: float, thickness: float, softness: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depth of the face, mm, and pressure, under a body of that height whose share of the compliance is ``softness``.

    ``height`` is that of the body above its lowest point, mm, and ``depth`` its travel.
    """
    shape = tuple(scipy.fft.next_fast_len(int(1.6 * size), real=True) for size in height.shape)
    y, x = scipy.fft.fftfreq(shape[0], side), scipy.fft.rfftfreq(shape[1], side)
    wave = 2 * np.pi * np.hypot(y[:, None], x)
    gel = layer(wave, poisson, thickness)
    body = softness / (1 - softness) * 2.0 / np.maximum(wave, 0.5 * wave[0, 1])
    gel[0, 0] = gel[0, 1]

    def moved(pressure: NDArray[np.float64], compliance: NDArray[np.float64]) -> NDArray[np.float64]:
        spread = scipy.fft.irfft2(compliance * scipy.fft.rfft2(pressure, s=shape), s=shape)
        return np.asarray(spread[: height.shape[0], : height.shape[1]])

    wanted = depth - height
    pressure, direction, former = np.where(wanted > 0, 0.3 * wanted, 0.0), np.zeros_like(height), 1.0
    for _ in range(MOST_STEPS):
        gap = wanted - moved(pressure, gel + body)  # positive: the bodies overlap
        active = (pressure > 0) | (gap > 0)
        gap = np.where(active, gap, 0.0)
        if np.abs(gap).max() < LEFT * depth:
            break
        now = float((gap**2).sum())
        direction = np.where(active, gap + now / former * direction, 0.0)
        length = float((gap * direction).sum() / (direction * moved(direction, gel + body)).sum())
        following = pressure + length * direction
        former = now if (following >= 0).all() else np.inf
        pressure = np.maximum(following, 0.0)
    return moved(pressure, gel), pressure


def drawn_press(kind: str, name: str, rng: np.random.Generator) -> TexturedPress:
    """A press of a kind on a sensor of the catalog."""
    sensor = load_sensor(name)
    columns, rows = sensor.image_px
    if columns > 320 and sensor.resampled:
        raise ValueError(f"{name} must have at most 320 columns")
    side = float(np.mean(sensor.known_scale(columns, rows)))
    ball = float(rng.uniform(2.5, 8.0))
    touched = float(np.clip(ball * rng.uniform(0.25, 0.6), 1.0, min(3.2, 0.3 * rows * side)))
    thickness = float(rng.uniform(*sensor.thickness_mm.limits))
    poisson = float(min(rng.uniform(*sensor.poisson.limits), 0.495))
    size = touched / side
    x, y = (float(rng.uniform(1.35 * size, end - 1.35 * size)) for end in (columns, rows))
    centre = x, y
    down, across = np.mgrid[:rows, :columns]
    away = np.hypot(across - x, down - y) * side
    wave = float(rng.uniform(0.1, 0.45)) * touched
    relief = (dimples if rng.uniform() < 0.4 else roughness)((rows, columns), wave / side, rng)
    slope = float(np.exp(rng.uniform(*np.log((0.1, 0.5)))))  # root mean square of the texture's slope
    smooth = ball_press(ball, touched, thickness_mm=thickness, poisson=poisson)
    dent = gel_depth_mm(smooth, sensor, columns, rows, centre)
    radius = size
    if kind == "imprint":
        falling = np.maximum(1 - (away / touched) ** 2, 0.0) ** float(rng.choice([0.0, 0.25, 0.5]))
        falling = scipy.ndimage.gaussian_filter(falling * (away < touched), 1.0)
        dent = dent + falling * relief * slope * wave / (2 * np.pi)
    elif kind == "soft edge":
        if rng.uniform() < 0.5:
            dent = scipy.ndimage.gaussian_filter(dent, float(rng.uniform(0.1, 0.3)) * size)
        else:
            power = float(rng.uniform(0.6, 1.2))
            dent = soft_edge(away, touched, dent.max(), side, poisson, thickness, power)
            radius *= float(np.sqrt(2.5 / (power + 2.0)))  # Hertz's radius of the same second moment
    elif kind != "smooth ball":
        softness = float(rng.uniform(0.3, 0.7)) if kind != "textured ball" else 0.0
        if kind == "foam":
            relief, slope, softness = (
                cells((rows, columns), wave / side, rng),
                1.3 * slope,
                float(rng.uniform(0.5, 0.8)),
            )
        height = ball - np.sqrt(np.maximum(ball**2 - np.minimum(away, 0.99 * ball) ** 2, 0.0))
        height = height + relief * slope * wave / (2 * np.pi)
        height -= height[away < 1.2 * touched].min()
        dent, pressure = pressed(height, smooth.depth_mm, side, poisson=poisson, thickness=thickness, softness=softness)
        radius = outline_radius(pressure > 0.02 * pressure.max(), CLOSED * size)
    light = random_gel_light((rows, columns), rng, size_px=size)
    return TexturedPress(
        kind=kind,
        sensor=sensor,
        reference=render_gel(np.zeros((rows, columns)), sensor, light, rng, drift=False),
        frame=render_gel(dent, sensor, light, rng),
        centre_px=centre,
        radius_px=radius,
    )


def soft_edge(
    away: NDArray[np.float64], edge: float, deepest: float, side: float, poisson: float, thickness: float, power: float
) -> NDArray[np.float64]:
    """Depth under a pressure ``(1 - (r / edge)²)^power``; the power is 1/2 under a ball of Hertz."""
    pressure = np.maximum(1 - (away / edge) ** 2, 0.0) ** power
    shape = tuple(scipy.fft.next_fast_len(2 * size, real=True) for size in away.shape)
    wave = 2 * np.pi * np.hypot(scipy.fft.fftfreq(shape[0], side)[:, None], scipy.fft.rfftfreq(shape[1], side))
    compliance = layer(wave, poisson, thickness)
    compliance[0, 0] = compliance[0, 1]
    dent = scipy.fft.irfft2(compliance * scipy.fft.rfft2(pressure, s=shape), s=shape)[: away.shape[0], : away.shape[1]]
    return np.asarray(dent * deepest / dent.max())


def outline_radius(touching: NDArray[np.bool_], gap_px: float) -> float:
    """Radius of the circle with the area of the contact, gaps of that width closed."""
    grown = scipy.ndimage.distance_transform_edt(~touching) <= gap_px
    closed = scipy.ndimage.distance_transform_edt(scipy.ndimage.binary_fill_holes(grown)) > gap_px
    labels, _ = scipy.ndimage.label(closed)
    return float(np.sqrt(np.bincount(labels.ravel())[1:].max() / np.pi))


def main() -> int:
    """Print a row for each kind, and the goals."""
    bench = Bench(__doc__, seed=8801, presses=12, kinds=[*KINDS], sensors=[*SENSORS], each=False)
    rows, every, times = [], [], []
    for kind in bench.kinds:
        found = []
        for number in track(range(bench.presses), kind, disable=not sys.stderr.isatty()):
            rng = np.random.default_rng([bench.seed, KINDS.index(kind), number])
            made = drawn_press(kind, bench.sensors[number % len(bench.sensors)], rng)
            start = perf_counter()
            (contact,) = contacts([made.frame], sensor=made.sensor, reference=made.reference)
            times.append(perf_counter() - start)
            error = contact.radius_px / made.radius_px - 1.0
            found.append((contact.good, error, error * made.radius_px / contact.radius_sd_px))
            if bench.each:
                print(
                    f"{kind} {number} {made.sensor.name}: radius {made.radius_px:.1f} px, error {error:+.1%}, "
                    f"explained {contact.explained:.2f}, sd {contact.radius_sd_px / contact.radius_px:.1%}",
                    *contact.reasons,
                )  # fmt: skip
        rows.append(row(kind, found))
        every += found
    textured = every if len(bench.kinds) == 1 else every[bench.presses * (bench.kinds[0] == "smooth ball") :]
    rows.append(row("all", every))
    heads = ("object", "presses", "good", "within 5 %", "median size of the error", "bias", "90 % holds")
    bench.table("Contacts of textured objects", heads, rows)
    good = [error for is_good, error, _ in textured if is_good]
    return bench.end(
        [
            Goal(name="textured: good, %", value=100 * len(good) / len(textured), least=85.0),
            Goal(name="textured and good: within 5 %, %", value=100 * float(np.mean(np.abs(good) < 0.05)), least=85.0),
            Goal(name="median time of a frame, s", value=float(np.median(times)), most=0.1, form="{:.2f}"),
        ]
    )


def row(name: str, found: list[tuple[bool, float, float]]) -> tuple[str, ...]:
    """A row of the table."""
    error, z = np.array([row[1:] for row in found if row[0]]).reshape(-1, 2).T
    if error.size == 0:
        return (name, str(len(found)), "0 %", "-", "-", "-", "-")
    return (
        name, str(len(found)), f"{error.size / len(found):.0%}", f"{np.mean(np.abs(error) < 0.05):.0%}",
        f"{np.median(np.abs(error)):.1%}", f"{np.median(error):+.1%}", f"{np.mean(np.abs(z) < WIDTH_90):.0%}",
    )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
