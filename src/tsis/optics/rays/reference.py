"""A readable reference of the fast tracer, one photon at a time.

A photon is never split: random numbers decide at each surface whether it is reflected, refracted, coupled out by
contact or absorbed on the way. The face is a cubic spline here, and intersections are searched along the ray. Only the
table of heights and the lamps' emission law are common with the fast tracer.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.optics import angles as snell
from tsis.optics.rays.geometry import media, pressed_face
from tsis.optics.rays.tracing import Tally

if TYPE_CHECKING:
    from typing import Any

    from tsis.model.press import PressField, PressMap
    from tsis.model.probe import Led, Probe
    from tsis.optics.angles import Floats


if TYPE_CHECKING:
    Vector = Floats

SAMPLES = 200  # along a ray between two walls
AWAY_MM = 1e-9  # offset from a ray's start, so that the start is no intersection
WAYS_OUT = ("missed", "reflected", "side", "glass", "face", "contact", "absorbed")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Photon:
    """Position, direction and medium of a photon, counted from the face; -1 is outside."""

    position: Vector
    direction: Vector
    medium: int = -1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReferenceSurface:
    """The face or an interface above it, at the height ``level + pull * height of the face``."""

    level: float
    pull: float
    face: scipy.interpolate.RectBivariateSpline

    def height(self, x: Floats, y: Floats) -> Floats:
        """Height at positions of any shape, mm."""
        return np.asarray(self.level + self.pull * self.face(x, y, grid=False))

    def upward_normal(self, position: Vector) -> Vector:
        """Unit normal towards the glass."""
        x, y, _ = position
        steep = [self.pull * float(self.face(x, y, dx=dx, dy=1 - dx, grid=False)) for dx in (1, 0)]
        normal = np.array([-steep[0], -steep[1], 1.0])
        return np.asarray(normal / np.linalg.norm(normal))

    def way(self, photon: Photon, longest: float) -> float:
        """Distance to the first intersection within ``longest``, else infinity."""

        def above(way: Any) -> Any:
            x, y, z = (photon.position[i] + way * photon.direction[i] for i in range(3))
            return z - self.height(x, y)

        samples = np.linspace(AWAY_MM, longest, SAMPLES)
        crossed = np.flatnonzero(np.diff(np.sign(above(samples))))
        if not len(crossed):
            return np.inf
        return float(scipy.optimize.brentq(above, samples[crossed[0]], samples[crossed[0] + 1], xtol=1e-14))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReferenceProbe:
    """A probe for single photons."""

    radius: float
    indices: list[float]
    outside: float
    absorption: float
    surfaces: list[ReferenceSurface]
    contact_fraction: scipy.interpolate.RectBivariateSpline
    paths: list[list[Vector]] = field(default_factory=list)

    def fate(self, photon: Photon, rng: np.random.Generator) -> str:
        """Follow a photon from a lamp to its end, one of `WAYS_OUT`, and append its path to ``paths``."""
        path = [photon.position]
        self.paths.append(path)
        state = self._enter(photon, rng)
        while isinstance(state, Photon):
            path.append(state.position)
            state = self._go_on(state, rng)
        return state

    def _enter(self, photon: Photon, rng: np.random.Generator) -> Photon | str:
        way = self._way_to_wall(photon, nearest=True)
        position = photon.position + way * photon.direction
        if not np.isfinite(way) or not self.surfaces[0].height(*position[:2]) < position[2] < self.surfaces[-1].level:
            return "missed"
        medium = max(k for k, surface in enumerate(self.surfaces) if surface.height(*position[:2]) <= position[2])
        inward = np.array([-position[0], -position[1], 0.0]) / self.radius
        index = self.indices[medium]
        if rng.random() < reflected(float(photon.direction @ inward), self.outside, index):
            return "reflected"
        return Photon(position=position, direction=bent(photon.direction, inward, self.outside, index), medium=medium)

    def _way_to_wall(self, photon: Photon, *, nearest: bool) -> float:
        position, along = photon.position[:2], photon.direction[:2]
        ways = np.roots([along @ along, 2 * position @ along, position @ position - self.radius**2])
        if np.iscomplexobj(ways) or position @ along > 0 > self.radius - np.linalg.norm(position):
            return np.inf
        return float(ways.min() if nearest else ways.max())

    def _go_on(self, photon: Photon, rng: np.random.Generator) -> Photon | str:
        """The photon after its next intersection, or its end."""
        to_wall = self._way_to_wall(photon, nearest=False)
        below, above = (self.surfaces[k].way(photon, to_wall) for k in (photon.medium, photon.medium + 1))
        way = min(to_wall, below, above)
        if rng.random() > np.exp(-self.absorption * way):
            return "absorbed"
        position = photon.position + way * photon.direction
        if way == to_wall:
            towards, behind, end = np.array([position[0], position[1], 0.0]) / self.radius, -1, "side"
        elif way == below:
            towards, behind, end = -self.surfaces[photon.medium].upward_normal(position), photon.medium - 1, "face"
        else:
            towards, behind, end = self.surfaces[photon.medium + 1].upward_normal(position), photon.medium + 1, "glass"
        if end == "face" and behind < 0 and rng.random() < self.contact_fraction(position[0], position[1], grid=False):
            return "contact"
        if behind == len(self.indices):
            behind = -1
        here, there = self.indices[photon.medium], self.outside if behind < 0 else self.indices[behind]
        if rng.random() < reflected(float(photon.direction @ towards), here, there):
            back = photon.direction - 2 * (photon.direction @ towards) * towards
            return Photon(position=position, direction=back, medium=photon.medium)
        if behind < 0:
            return end
        return Photon(position=position, direction=bent(photon.direction, towards, here, there), medium=behind)


def reflected(cosine: float, here: float, there: float) -> float:
    """Reflected fraction of unpolarised light."""
    angle = float(np.degrees(np.arccos(min(max(cosine, 0.0), 1.0))))
    result = snell.fresnel(angle, index_from=here, index_to=there)
    return float(result.reflected_s + result.reflected_p) / 2


def bent(direction: Vector, towards: Vector, here: float, there: float) -> Vector:
    """Direction behind an interface: its part along the interface changes by Snell's law."""
    along = here / there * (direction - (direction @ towards) * towards)
    return np.asarray(along + np.sqrt(1 - along @ along) * towards)


def reference_probe(
    probe: Probe,
    pressed: PressField | PressMap | None = None,
    *,
    saturation_kpa: float = 20.0,
    index_outside: float = 1.0,
    absorption_per_mm: float = 0.0,
) -> ReferenceProbe:
    """A probe under the press ``pressed``."""
    side, height, fraction = pressed_face(probe, pressed, saturation_kpa)
    face = scipy.interpolate.RectBivariateSpline(side, side, height.T)
    indices, levels = media(probe)
    pulls = np.maximum(1 - levels / probe.thickness_mm, 0.0)
    return ReferenceProbe(
        radius=probe.radius_mm,
        indices=indices.tolist(),
        outside=index_outside,
        absorption=absorption_per_mm,
        surfaces=[
            ReferenceSurface(level=level, pull=pull, face=face)
            for level, pull in zip(levels.tolist(), pulls.tolist(), strict=True)
        ],
        contact_fraction=scipy.interpolate.RectBivariateSpline(side, side, fraction.T, kx=1, ky=1),
    )


def shine(led: Led, probe: Probe, rng: np.random.Generator) -> Photon:
    """A photon of a lamp, drawn by rejection."""
    azimuth, aim = np.radians([led.azimuth_deg, led.aim_deg])
    outward = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    up, layer = np.array([0.0, 0.0, 1.0]), np.array([-outward[1], outward[0], 0.0])
    axis = -np.cos(aim) * outward + np.sin(aim) * up
    while True:
        spot = rng.uniform(-led.diameter_mm / 2, led.diameter_mm / 2, 2)
        if np.hypot(*spot) <= led.diameter_mm / 2:
            break
    while True:
        direction = rng.standard_normal(3)
        direction /= np.linalg.norm(direction)
        if rng.random() < max(direction @ axis, 0.0) ** led.exponent:
            break
    centre = probe.radius_mm * outward + probe.led_height_mm(led) * up
    return Photon(position=centre + spot[0] * layer + spot[1] * up, direction=direction)


def trace_photons(
    probe: Probe,
    pressed: PressField | PressMap | None = None,
    *,
    photons: int,
    rng: np.random.Generator,
    saturation_kpa: float = 20.0,
    index_outside: float = 1.0,
    absorption_per_mm: float = 0.0,
) -> Tally:
    """Ends of ``photons`` photons, as fractions."""
    scene = reference_probe(
        probe,
        pressed,
        saturation_kpa=saturation_kpa,
        index_outside=index_outside,
        absorption_per_mm=absorption_per_mm,
    )
    power = np.array([led.power for led in probe.leds])
    chosen = rng.choice(len(power), size=photons, p=power / power.sum())
    ends = Counter(scene.fate(shine(probe.leds[i], probe, rng), rng) for i in chosen)
    return Tally(cut_off=0.0, **{name: ends[name] / photons for name in WAYS_OUT})
