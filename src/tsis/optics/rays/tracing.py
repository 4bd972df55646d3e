"""Tracing the light of a probe's lamps: its balance, and the light on the face."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.__about__ import LARGEST_SEED
from tsis.model.require import require_integer, require_number
from tsis.optics import angles as inputs
from tsis.optics.rays import kernel as rays_kernel
from tsis.optics.rays.geometry import APERTURE, scene
from tsis.optics.rays.kernel import emitted, lamps

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from tsis.model.press import PressField, PressMap
    from tsis.model.probe import Probe
    from tsis.optics.angles import Floats
    from tsis.optics.rays.geometry import Scene


BATCHES = 32  # with independent starts: their spread gives the error, and threads process them in parallel
FEWEST_RAYS, MOST_RAYS = 1000, 10**12
MOST_BINS = 256
LONGEST = 200  # points of a path
MOST_PATHS = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """Balance of the light, as fractions of the lamps' power; `missed` to `cut_off` add up to one.

    Attributes
    ----------
    missed
        Missed the probe.
    reflected
        Reflected by the side wall from outside.
    side, glass
        Left through the side wall, and through the glass towards the camera.
    face
        Left through the face into air; zero without a dent at the indices of silicone.
    contact
        Left through real contact.
    absorbed
        Absorbed by layers and glass.
    cut_off
        Power of weak rays that ended at random, less the power added to those that continued; near zero, of either
        sign.
    """

    missed: float
    reflected: float
    side: float
    glass: float
    face: float
    contact: float
    absorbed: float
    cut_off: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TracedLight:
    """Results of tracing rays through a probe.

    Attributes
    ----------
    tally, standard_error
        Balance of the light, and the standard errors of its fractions.
    into_camera
        Fraction of the lamps' power that leaves the glass within the camera's numerical aperture.
    out_of_range
        Fraction that enters above a layer whose index is below ``n sin(angle from the axis)``: without a dent it never
        reaches the face.
    meetings
        Mean number of intersections of a ray with walls, interfaces and face.
    rays
        Number of rays.
    x_mm, y_mm
        Centres of the maps' bins, shape (n,) each.
    arriving
        Light on the face from inside in each bin, counted at each intersection, as a fraction of the lamps' power,
        shape (n, n), rows along y.
    coupled, lost
        Light that leaves the face through contact and into air, as ``arriving``.
    flux_x, flux_y
        Horizontal flux along the face in the bins, per flux into it, times ``arriving``; shape (n, n).
    batches
        The maps of each batch, shape (batches, 5, n, n), for standard errors of derived values.
    """

    tally: Tally
    standard_error: Tally
    into_camera: float
    out_of_range: float
    meetings: float
    rays: int
    x_mm: Floats
    y_mm: Floats
    arriving: Floats
    lost: Floats
    coupled: Floats
    flux_x: Floats
    flux_y: Floats
    batches: Floats

    @property
    def coupled_error(self) -> Floats:
        """Standard error of ``coupled`` in each bin, shape (n, n)."""
        spread = self.batches[:, rays_kernel.COUPLED].std(axis=0, ddof=1)
        return np.asarray(spread / np.sqrt(len(self.batches)))


def trace_rays(
    probe: Probe,
    pressed: PressField | PressMap | None = None,
    *,
    rays: float = 1_000_000,
    seed: int = 1,
    bins: int = 24,
    saturation_kpa: float = 20.0,
    index_outside: float = 1.0,
    absorption_per_mm: float = 0.0,
    numerical_aperture: float = APERTURE,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> TracedLight:
    """Trace the light of the lamps through layers and glass to the face and out again.

    Light is unpolarised at each intersection (Fresnel's mean of both polarisations, with total reflection). Layers
    under a dent are compressed in proportion. Of the light on the face, the fraction of real contact
    ``erf(0.886 p / saturation)`` leaves through it; the rest meets air behind a smooth face with the dent's slope. The
    same seed gives the same light on any number of threads.

    Parameters
    ----------
    probe
        The probe with its lamps.
    pressed
        Displacement of the face and contact pressure; None is an untouched probe.
    rays
        Number of rays, in [1e3, 1e12]; rounded up to a multiple of lamps and batches.
    seed
        Seed of the starts, a whole number from 0.
    bins
        Number of the maps' bins along each side of the square around the face, in [1, 256].
    saturation_kpa
        Pressure of complete contact by extrapolation of the initial growth, in [1e-6, 1e6].
    index_outside
        Refractive index around the probe and behind the face without contact, in [1, 5].
    absorption_per_mm
        Absorption of layers and glass, in [0, 10].
    numerical_aperture
        Numerical aperture of the camera on the axis, in [0, 1].
    threads
        Number of threads, in [1, 256]; one a core when None.
    progress
        Called with (batches done, batches in all).

    Raises
    ------
    InputError
        When a value lies outside its range, the dent is deeper than the layers or no light enters.

    Examples
    --------
    >>> import tsis
    >>> tally = trace_rays(tsis.load_probe("tsis-2011"), rays=4000).tally
    >>> round(sum(getattr(tally, name) for name in tally.__slots__), 12), tally.contact
    (1.0, 0.0)
    """
    count = require_integer("rays", rays, FEWEST_RAYS, MOST_RAYS)
    size = require_integer("bins", bins, 1, MOST_BINS)
    view = scene(
        probe,
        pressed,
        saturation_kpa=require_number("saturation_kpa", saturation_kpa, 1e-6, 1e6, hint="kilopascals"),
        index_outside=inputs.require_refractive_index("index_outside", index_outside),
        absorption_per_mm=require_number("absorption_per_mm", absorption_per_mm, 0.0, 10.0),
        aperture=require_number("numerical_aperture", numerical_aperture, 0.0, 1.0),
    )
    record = trace_batches(view, probe, rays=count, seed=seed, bins=size, threads=threads, progress=progress)
    return _light(probe, view, record)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Batches:
    """Records of all batches: totals (b, tallies), maps (b, 5, n, n) and tilted faces (b, k, n, n)."""

    totals: Floats
    maps: Floats
    tilted: Floats
    rays: int


def trace_batches(
    view: Scene,
    probe: Probe,
    *,
    rays: float,
    seed: int,
    bins: int,
    slopes: ArrayLike = (),
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Batches:
    """Trace batches of rays in parallel; also records the light on tilted faces of ``slopes`` (k, 2)."""
    start = require_integer("seed", seed, 0, LARGEST_SEED)
    workers = require_integer("threads", os.cpu_count() or 1 if threads is None else threads, 1, 256)
    tilts = np.asarray(slopes, dtype=float).reshape(-1, 2)
    shining = lamps(probe)
    rays_a_lamp = int(np.ceil(rays / (BATCHES * len(shining.power_fraction))))
    maps = np.zeros((BATCHES, rays_kernel.MAPS, bins, bins))
    tilted = np.zeros((BATCHES, len(tilts), bins, bins))
    totals = np.zeros((BATCHES, rays_kernel.TALLIES))

    def trace(batch: int) -> None:
        # A separate array, copied at the end: threads that write to one cache line wait for each other.
        counted = np.zeros(rays_kernel.TALLIES)
        record = rays_kernel.Record(
            totals=counted, maps=maps[batch], slopes=tilts, tilted=tilted[batch], path=np.empty((0, 4))
        )
        rays_kernel.trace_batch(view, shining, start, batch, rays_a_lamp, record)
        totals[batch] = counted

    with ThreadPoolExecutor(workers) as pool:
        for done, _ in enumerate(pool.map(trace, range(BATCHES)), start=1):
            if progress is not None:
                progress(done, BATCHES)
    return Batches(totals=totals, maps=maps, tilted=tilted, rays=rays_a_lamp * BATCHES * len(shining.power_fraction))


def _light(probe: Probe, view: Scene, batches: Batches) -> TracedLight:
    totals, maps = batches.totals.mean(axis=0), batches.maps.mean(axis=0)
    error = batches.totals.std(axis=0, ddof=1) / np.sqrt(BATCHES)
    bins = maps.shape[1]
    middles = (np.arange(bins) + 0.5) * (2 * probe.radius_mm / bins) - probe.radius_mm
    return TracedLight(
        tally=_tally(totals),
        standard_error=_tally(error),
        into_camera=float(totals[rays_kernel.CAMERA]),
        out_of_range=float(totals[rays_kernel.BEYOND]),
        meetings=float(batches.totals[:, rays_kernel.MEETINGS].sum() / batches.rays),
        rays=batches.rays,
        x_mm=middles,
        y_mm=middles,
        arriving=maps[rays_kernel.ARRIVING],
        lost=maps[rays_kernel.LOST],
        coupled=maps[rays_kernel.COUPLED],
        flux_x=maps[rays_kernel.FLUX_X],
        flux_y=maps[rays_kernel.FLUX_Y],
        batches=batches.maps,
    )


def _tally(totals: Floats) -> Tally:
    ends = totals[rays_kernel.MISSED : rays_kernel.CUT + 1]  # in the order of the fields
    return Tally(**dict(zip(Tally.__slots__, ends.tolist(), strict=True)))


def trace_paths(
    probe: Probe, pressed: PressField | PressMap | None = None, *, rays: int = 40, seed: int = 1, lamp: int = 0
) -> tuple[Floats, ...]:
    """The paths of some rays of one lamp.

    Parameters
    ----------
    probe, pressed
        Arguments of `tsis.optics.rays.tracing.trace_rays`.
    rays
        Number of rays, in [1, 10000].
    seed
        Seed of their starts and random choices.
    lamp
        Index of the lamp among the lit lamps, from 0.

    Returns
    -------
    The points of each ray, shape (points, 4): x, y, z in mm and the power behind the point, 1 at the lamp. At the last
    point the ray ends or has left.

    Raises
    ------
    InputError
        When a value lies outside its range.

    Examples
    --------
    >>> import tsis
    >>> (path,) = trace_paths(tsis.load_probe("tsis-2011"), rays=1)
    >>> path[0, 3].item(), path.shape[1]
    (1.0, 4)
    """
    view = scene(probe, pressed)
    count = require_integer("rays", rays, 1, MOST_PATHS)
    shining = lamps(probe)
    chosen = require_integer("lamp", lamp, 0, len(shining.power_fraction) - 1)
    rng = np.random.default_rng(require_integer("seed", seed, 0, LARGEST_SEED))

    def path() -> Floats:
        position, direction = emitted(shining, chosen, *rng.random(4).tolist())
        return follow_path(view, position, direction, chance=int(rng.integers(2**63)))

    return tuple(path() for _ in range(count))


def follow_path(view: Scene, position: ArrayLike, direction: ArrayLike, *, chance: int = 1) -> Floats:
    """The path of one ray of power 1, shape (points, 4)."""
    points = np.empty((LONGEST, 4))
    record = rays_kernel.Record(
        totals=np.zeros(rays_kernel.TALLIES),
        maps=np.zeros((rays_kernel.MAPS, 1, 1)),
        slopes=np.empty((0, 2)),
        tilted=np.zeros((0, 1, 1)),
        path=points,
    )
    start, along = (tuple(np.asarray(part, dtype=float).tolist()) for part in (position, direction))
    count = rays_kernel.follow(view, start, along, 1.0, np.uint64(chance), record)
    return points[:count].copy()
