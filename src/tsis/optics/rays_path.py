"""The ways of single rays, to look at and to check."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.model.check import LARGEST_SEED, require_integer
from tsis.optics import rays_kernel
from tsis.optics.rays_emission import emitted, lamps
from tsis.optics.rays_scene import scene

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from tsis.model import PressField, PressMap, Probe
    from tsis.optics.rays_scene import Scene

LONGEST = 200  # points
MOST_PATHS = 10_000


def trace_paths(
    probe: Probe, pressed: PressField | PressMap | None = None, *, rays: int = 40, seed: int = 1, lamp: int = 0
) -> tuple[NDArray[np.float64], ...]:
    """The ways of some rays of one lamp.

    Parameters
    ----------
    probe, pressed
        As `tsis.optics.trace_rays` takes them.
    rays
        How many, in [1, 10000].
    seed
        Seed of their starts and of their choices.
    lamp
        Which of the lit lamps, counted from 0.

    Returns
    -------
    For each ray its points, shape (points, 4): x, y, z in mm and the power with which it leaves the point, one at the
    lamp. At the last point it ends or has left.

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
    chosen = require_integer("lamp", lamp, 0, len(shining.share) - 1)
    rng = np.random.default_rng(require_integer("seed", seed, 0, LARGEST_SEED))

    def path() -> NDArray[np.float64]:
        position, direction = emitted(shining, chosen, *rng.random(4).tolist())
        return follow_path(view, position, direction, chance=int(rng.integers(2**63)))

    return tuple(path() for _ in range(count))


def follow_path(view: Scene, position: ArrayLike, direction: ArrayLike, *, chance: int = 1) -> NDArray[np.float64]:
    """The way of one ray of power one, shape (points, 4)."""
    points = np.empty((LONGEST, 4))
    nowhere = np.empty((0, 2))
    record = rays_kernel.Record(
        totals=np.zeros(rays_kernel.TALLIES),
        maps=np.zeros((rays_kernel.MAPS, 1, 1)),
        slopes=nowhere,
        tilted=np.zeros((0, 1, 1)),
        path=points,
    )
    start, along = (tuple(np.asarray(part, dtype=float).tolist()) for part in (position, direction))
    count = rays_kernel.follow(view, start, along, 1.0, np.uint64(chance), record)
    return points[:count].copy()
