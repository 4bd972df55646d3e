"""How fast and how exact the tracer is, and how well the camera's smooth light agrees with it on dents of no fit.

    python -m benchmarks.rays [--rays 2e7]

`benchmarks.speed` has the speed on a clear cylinder beside Mitsuba's.
"""

from __future__ import annotations

import os
import sys
from dataclasses import astuple, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench, timed

import tsis
from tsis.mechanics import press
from tsis.mechanics.small_strain.rigid_ball import indent
from tsis.model.press import PressField, PressMap
from tsis.model.probe import FOUR_LEDS, Glass, Led, Probe
from tsis.optics.face_light import irradiance, leaving_light
from tsis.optics.rays.geometry import tip_press
from tsis.optics.rays.reference import WAYS_OUT, trace_photons
from tsis.optics.rays.tracing import trace_rays

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

PROBE, DOMED = tsis.load_probe("tsis-2011"), tsis.load_probe("tsis-domed")
LEVEL = replace(PROBE, name="level lamps", leds=FOUR_LEDS)  # at half height, whose light crosses the probe once
CLEAR = replace(LEVEL, glass=Glass(refractive_index=1.41))  # one medium, as the peer's cylinder
SPEED_RAYS, PHOTONS = 2e6, 5000
BINS, STEP_MM = 24, 0.1
TOUCHED = 0.2  # of the largest light that leaves, below which a bin counts as the contact's fringe
INNER = 0.8  # of the face's radius, as far as presses are read
# Radius mm, force N and middle of spheres; none of them, nor their like, was used in a fit.
SPHERES = (
    (2.0, 0.1, (0.0, 0.0)),
    (4.0, 0.1, (2.5, 2.5)),
    (6.0, 0.5, (0.0, 0.0)),
    (8.0, 0.3, (3.0, -2.0)),
    (10.0, 0.8, (0.0, 0.0)),
    (12.0, 0.6, (-1.0, 4.0)),
    (14.0, 1.2, (0.0, 0.0)),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Speed:
    """A line of the table of speeds."""

    program: str
    per_second: float
    outcome: str


def speeds() -> Iterator[Speed]:
    """Rays a second of this tracer."""
    cores = os.cpu_count() or 1
    sphere = sphere_press(10.0, 0.8, (0.0, 0.0))
    for name, probe, pressed in (
        ("clear cylinder", CLEAR, None),
        ("level lamps, glass", LEVEL, None),
        ("the same under a sphere", LEVEL, sphere),
        ("the catalog's lamps", PROBE, None),
    ):
        for threads in sorted({1, 2, cores}):
            seconds = timed(partial(trace_rays, probe, pressed, rays=SPEED_RAYS, threads=threads))()
            found = trace_rays(probe, pressed, rays=1e5, threads=threads)
            closed = abs(sum(astuple(found.tally)) - 1)
            yield Speed(
                program=f"tsis, {name}, {threads} threads",
                per_second=SPEED_RAYS / seconds,
                outcome=f"{found.meetings:.2f} meetings a ray after it entered; tally closed to {closed:.1e}",
            )


def reference_scores() -> dict[str, float]:
    """Differences of fast and plain tracer over their standard errors, on a dented stack of three indices."""
    layers = tuple(
        replace(layer, refractive_index=n) for layer, n in zip(PROBE.layers, (1.41, 1.44, 1.39), strict=True)
    )
    probe = replace(PROBE, layers=layers, leds=(Led(half_angle_deg=45.0), Led(azimuth_deg=140.0, height_mm=9.5)))
    dent = sphere_press(10.0, 0.8, (0.0, 0.0))
    slow = trace_photons(probe, dent, photons=PHOTONS, rng=np.random.default_rng(1))
    fast = trace_rays(probe, dent, rays=SPEED_RAYS)
    scores = {}
    for name in WAYS_OUT:
        share = getattr(fast.tally, name)
        spread = np.hypot(np.sqrt(share * (1 - share) / PHOTONS), getattr(fast.standard_error, name))
        scores[name] = float((getattr(slow, name) - share) / spread) if spread > 0 else 0.0
    return scores


def sphere_press(radius_mm: float, force_n: float, middle_mm: tuple[float, float]) -> PressField | PressMap:
    """A rigid sphere on the layered probe; beside the axis its dent is that of the middle, moved."""
    found = indent(PROBE, sphere_radius_mm=radius_mm, force_n=force_n)
    centred = tip_press(
        found.radius_mm, found.face_displacement_mm, contact_radius_mm=found.contact_radius_mm, force_n=force_n
    )
    if middle_mm == (0.0, 0.0):
        return centred
    side = np.arange(-PROBE.radius_mm, PROBE.radius_mm + STEP_MM / 2, STEP_MM)
    from_middle = np.hypot(side - middle_mm[0], side[:, None] - middle_mm[1])
    return PressMap(
        x_mm=side,
        y_mm=side,
        face_displacement_mm=np.interp(from_middle, centred.radius_mm, centred.face_displacement_mm),
        pressure_kpa=np.interp(from_middle, centred.radius_mm, centred.pressure_kpa),
        approach_mm=centred.approach_mm,
        force_n=force_n,
    )


def held_out() -> Iterator[tuple[str, Probe, PressField | PressMap]]:
    """Presses whose light no fit has seen."""
    for probe in (LEVEL, PROBE):
        for radius, force, middle in SPHERES:
            name = f"{probe.name}: sphere {radius:g} mm, {force:g} N, at {middle[0]:g}, {middle[1]:g} mm"
            yield name, probe, sphere_press(radius, force, middle)
    yield "level lamps: tissue with inclusion, 1 N", LEVEL, press(LEVEL, tsis.load_phantom("hardness-100"), force_n=1.0)
    yield "tissue with inclusion, 1 N", PROBE, press(PROBE, tsis.load_phantom("hardness-100"), force_n=1.0)
    yield "the same under the dome, 0.5 N", DOMED, press(DOMED, tsis.load_phantom("hardness-100"), force_n=0.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """How the light that leaves by the camera's formula differs from the traced light, per bin."""

    surface: str
    bins: int
    mean: float
    rms: float
    rays_noise: float
    first_order: float


def agreements(rays: float) -> Iterator[tuple[Agreement, NDArray[np.float64]]]:
    """Each held-out surface, and its errors bin by bin."""
    light = {probe.name: irradiance(probe) for probe in (LEVEL, PROBE, DOMED)}
    for name, probe, pressed in held_out():
        found = trace_rays(probe, pressed, rays=rays, seed=2026, bins=BINS)
        model, _ = leaving_light(light[probe.name], pressed, saturation_kpa=20.0, bins=BINS)
        inside = np.hypot(found.x_mm, found.y_mm[:, None]) < INNER * probe.radius_mm
        bins = inside & (found.coupled > TOUCHED * found.coupled[inside].max())
        noise = np.sqrt(np.mean((found.coupled_error[bins] / found.coupled[bins]) ** 2))
        error = model[bins] / found.coupled[bins] - 1
        near = light[probe.name].near_undented()
        linear = leaving_light(light[probe.name], pressed, saturation_kpa=20.0, bins=BINS, by=near)[0][bins]
        yield (
            Agreement(
                surface=name,
                bins=int(bins.sum()),
                mean=float(error.mean()),
                rms=float(np.sqrt((error**2).mean())),
                rays_noise=float(noise),
                first_order=float(np.sqrt(((linear / found.coupled[bins] - 1) ** 2).mean())),
            ),
            error,
        )


def main() -> int:
    """Measure and print."""
    bench = Bench(__doc__, rays=20000000.0)
    lines = [(line.program, f"{line.per_second / 1e6:.2f}", line.outcome) for line in speeds()]
    bench.table("Speed", ("program", "million rays/s", "outcome"), lines)
    scores = [(name, f"{score:+.2f}") for name, score in reference_scores().items()]
    title = f"Fast tracer against {PHOTONS:,} single photons, dented stack of three indices"
    bench.table(title, ("share", "difference / standard error"), scores)
    found = list(agreements(bench.rays))
    rows = [
        (
            one.surface,
            str(one.bins),
            *(f"{value:+.2%}" for value in (one.mean, one.rms, one.rays_noise, one.first_order)),
        )
        for one, _ in found
    ]
    for lamps in (True, False):  # the level lamps and the catalog's apart: their light is of two kinds
        errors = np.concatenate([errors for one, errors in found if one.surface.startswith("level") == lamps])
        label = "all bins, level lamps" if lamps else "all bins, the catalog's lamps"
        rms = np.sqrt((errors**2).mean())
        rows.append((label, str(len(errors)), f"{errors.mean():+.2%}", f"{rms:+.2%}", "", ""))
    heads = ("surface of no fit", "bins", "mean error", "RMS error", "of it noise of the rays", "RMS, first order only")
    bench.table("Light by the camera's formula against traced light through contact", heads, rows)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
