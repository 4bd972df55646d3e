"""How well a moved change stands for an inclusion beside the axis, against the press in three dimensions.

    python -m benchmarks.off_axis                    # some minutes; needs NGSolve (the extra fem3d)
    python -m benchmarks.off_axis --fine --offsets 1 3    # takes ten times as long an offset
    python -m benchmarks.off_axis --dome             # seconds

With ``--dome`` the pressure under the domed probe is compared with kernels: what a weak sphere beside the axis changes
by Fourier elements, whose points sample the sphere to some per cent. The last column compares with what an estimate
states as the standard deviation (`tsis.inclusion`, 1.25).

A flat probe presses spheres at 1 N. Each cell is "worst ring / root mean square over the rings" in per cent: of
pressure as a share of the mean pressure, of displacement as a share of the change's peak on the axis.
"""

from __future__ import annotations

import itertools
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench
from benchmarks.misplaced import SphereField
from benchmarks.worlds import FINE_MESH
from scipy.interpolate import RectBivariateSpline

import tsis
from tsis.imaging.rendering import render
from tsis.imaging.sensor import Sensor, expose
from tsis.inclusion.checks.position import APPARENT_FRACTION, inclusion_position
from tsis.inclusion.frames import ring_edges
from tsis.inclusion.posterior.rings import off_axis_profile
from tsis.mechanics import press
from tsis.mechanics.solid import SolidResolution, press_solid
from tsis.mechanics.tissue_field import TissueFieldResponse
from tsis.virtual.probe import nominal_calibration

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from tsis.model.press import PressMap

PROBE = tsis.load_probe("tsis-2011")
PLAIN = tsis.Phantom(young_kpa=5.0, thickness_mm=30.0)
SPHERES = ((10.0, 5.0, 100.0), (5.0, 5.0, 80.0), (8.0, 8.0, 60.0))  # diameter_mm, depth_mm, young_kpa
OFFSETS_MM = (0.5, 1.0, 2.0, 3.0)
DOMED_SPHERES = ((6.0, 4.0), (10.0, 5.0), (8.0, 8.0))  # diameter_mm, depth_mm
INNER = 0.8  # of the face's radius, on which the estimate's rings lie
FINE = SolidResolution(face=0.08, rim=0.06, inclusion=0.2, growth=0.35)
RADIUS_MM = np.linspace(0.0, PROBE.radius_mm, 121)
MEAN_KPA = 1000.0 / (np.pi * PROBE.radius_mm**2)
ANGLES = 2 * np.pi * (np.arange(180) + 0.5) / 180
FRAMES = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """Errors of one sphere at one offset, (worst, rms) in per cent each."""

    sphere: tuple[float, float, float]
    offset_mm: float
    quantity: str
    change: tuple[float, float]
    left_on_axis: tuple[float, float]
    only_moved: tuple[float, float]
    moved: tuple[float, float]
    of_change: tuple[float, float]
    from_profile: tuple[float, float]
    place_mm: float


def solved(sphere: tuple[float, float, float], offset_mm: float, resolution: SolidResolution | None) -> PressMap:
    diameter, depth, young = sphere
    lump = tsis.Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=young, offset_mm=(offset_mm, 0.0))
    phantom = tsis.Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=lump)
    return press_solid(PROBE, phantom, force_n=1.0, resolution=resolution, threads=1)


def turned(radius_mm: NDArray[np.float64], pressed: PressMap, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means over circles around the axis."""
    at = RectBivariateSpline(pressed.y_mm, pressed.x_mm, values)
    x, y = radius_mm[:, None] * np.cos(ANGLES), radius_mm[:, None] * np.sin(ANGLES)
    return np.asarray(at(y, x, grid=False).mean(axis=1))


def rings() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Radii (rings, 6) of the estimate's rings and their weights in the means over the rings' areas."""
    edges = ring_edges(PROBE)
    nodes, weights = np.polynomial.legendre.leggauss(6)
    radius = edges[:-1, None] + np.diff(edges)[:, None] / 2 * (nodes + 1)
    weight = radius * weights
    return radius, weight / weight.sum(axis=1, keepdims=True)


def rows(
    offsets_mm: tuple[float, ...],
    resolution: SolidResolution | None,
    spheres: tuple[tuple[float, float, float], ...] = SPHERES,
) -> Iterator[Row]:
    radius, weight = rings()

    def of_profile(profile: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray((weight * np.interp(radius, RADIUS_MM, profile)).sum(axis=1))

    bare = press(PROBE, PLAIN, force_n=1.0)
    for sphere in spheres:
        middle = solved(sphere, 0.0, resolution)
        plain = bare.on_grid(middle.x_mm, middle.y_mm)
        diameter, depth, young = sphere
        lump = tsis.Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=young)
        round_press = press(PROBE, tsis.Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=lump), force_n=1.0)
        for offset in offsets_mm:
            beside = solved(sphere, offset, resolution)
            place = seen_at(beside, plain, bare)
            for name in ("pressure_kpa", "face_displacement_mm"):
                still = getattr(plain, name)
                on_axis = turned(RADIUS_MM, middle, getattr(middle, name) - still)
                true = turned(radius.ravel(), beside, getattr(beside, name) - still).reshape(radius.shape)
                truth = (weight * true).sum(axis=1)
                known = np.interp(RADIUS_MM, round_press.radius_mm, getattr(round_press, name) - getattr(bare, name))
                unit = MEAN_KPA if name == "pressure_kpa" else float(np.abs(of_profile(on_axis)).max())

                def size(ring: NDArray[np.float64], unit: float = unit) -> tuple[float, float]:
                    return float(100 * np.abs(ring).max() / unit), float(100 * np.sqrt(np.mean(ring**2)) / unit)

                moved = of_profile(off_axis_profile(RADIUS_MM, offset) @ on_axis)
                alike = of_profile(on_axis)
                yield Row(
                    sphere=sphere,
                    offset_mm=offset,
                    quantity=name.split("_")[-2],
                    change=size(alike),
                    left_on_axis=size(alike - truth),
                    only_moved=size(moved * (1 - (offset / PROBE.radius_mm) ** 2) - truth),
                    moved=size(moved - truth),
                    of_change=size(moved - truth, unit=float(np.abs(alike).max())),
                    from_profile=size(of_profile(off_axis_profile(RADIUS_MM, offset) @ known) - truth),
                    place_mm=place,
                )


def seen_at(pressed: PressMap, plain: PressMap, bare: tsis.PressField) -> float:
    """Mean distance from the axis at which frames of the press show the change."""
    sensor, rng = Sensor(), np.random.default_rng(1)
    answer = nominal_calibration(sensor)
    below = render(bare, sensor, answer)
    light = np.maximum(below + render(pressed, sensor, answer) - render(plain, sensor, answer), 0.0)

    def frame(shone: NDArray[np.float64]) -> tsis.TactileImage:
        return tsis.TactileImage(grey=expose(shone, sensor, rng), mm_per_pixel=sensor.mm_per_pixel, force_n=1.0)

    places = [
        inclusion_position(frame(light), frame(below), answer, radius_mm=PROBE.radius_mm).x_mm for _ in range(FRAMES)
    ]
    return APPARENT_FRACTION * float(np.mean(places))


def under_a_dome(offsets_mm: tuple[float, ...]) -> Iterator[tuple[tuple[float, float], float, float, float, float]]:
    """Diameter and depth, offset, force, and the worst and root mean square error of the pressure over its peak."""
    slab = TissueFieldResponse(
        tsis.load_probe("tsis-domed"),
        young_kpa=PLAIN.young_kpa,
        thickness_mm=PLAIN.thickness_mm,
        poisson=PLAIN.poisson,
        inclusion=None,
        mesh=FINE_MESH,
    )
    kernel, inner = slab.response(0), INNER * slab.radius_mm[-1] > RADIUS_MM
    for diameter, depth in DOMED_SPHERES:
        for offset, force in itertools.product(offsets_mm, (0.5, 1.0)):
            beside, on_axis = (
                np.interp(RADIUS_MM, slab.radius_mm, (force * kernel.pressure_kpa[0] + kernel.pressure_kpa[1]) @ inside)
                for inside in (
                    SphereField(
                        radius_mm=diameter / 2, depth_mm=depth + diameter / 2, offset_mm=place, angle=0.0
                    ).harmonic(0, kernel.radius_mm, kernel.depth_mm)[0]
                    for place in (offset, 1e-6)
                )
            )
            error = (off_axis_profile(RADIUS_MM, offset) @ on_axis - beside)[inner] / np.abs(beside[inner]).max()
            yield (diameter, depth), offset, force, float(np.abs(error).max()), float(np.sqrt(np.mean(error**2)))


def print_dome(bench: Bench) -> None:
    """Print `under_a_dome`."""
    rows = []
    for (diameter, depth), offset, force, worst, rms in under_a_dome(tuple(bench.offsets)):
        square = (offset / RADIUS_MM[-1]) ** 2
        of_square = f"{worst / square:.2f} / {rms / square:.2f}"
        peak = f"{100 * worst:.1f} / {100 * rms:.1f}"
        rows.append((f"d {diameter:g} h {depth:g}", f"{offset:g} mm", f"{force:g} N", peak, of_square))
    heads = ("sphere", "offset", "force", "worst / rms, %", "worst / rms over (offset/R)²")
    bench.table("pressure under tsis-domed, errors over the peak of the change", heads, rows)


def main() -> int:
    """Measure and print."""
    bench = Bench(__doc__, fine=False, offsets=[*OFFSETS_MM], dome=False)
    if bench.dome:
        print_dome(bench)
        return bench.end()
    cells = []
    for row in rows(tuple(bench.offsets), FINE if bench.fine else None):
        parts = (row.change, row.left_on_axis, row.only_moved, row.moved, row.of_change, row.from_profile)
        sphere = "d {:g} h {:g} E {:g}".format(*row.sphere)
        errors = [f"{worst:.3f} / {rms:.3f}" for worst, rms in parts]
        cells.append((sphere, f"{row.offset_mm:g} mm", row.quantity, *errors, f"{row.place_mm:.3f} mm"))
    heads = ("change", "left on the axis", "moved", "moved and grown", "of the change", "by the round model")
    bench.table("worst ring / rms, per cent", ("sphere", "offset", "", *heads, "seen at"), cells)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
