"""Shear force on a gel sensor from its markers, with an interval."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError
from tsis.mechanics.gel.contact import LARGEST_RATIO, shear_of_markers
from tsis.mechanics.gel.force import DRAWS, DrawnGel, drawn_gel
from tsis.model.content import ContentValue
from tsis.model.gel_sensor import GelSensor
from tsis.model.require import require_array, require_integer, require_number, require_type

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tsis.mechanics.gel.contact import Floats


FEWEST_MARKERS = 6
LEAST_EXPLAINED = 0.5
SHEAR_MODEL_SD = 0.05  # relative, by benchmarks/gel_shear.py (seed 503)
FARTHEST = 3.0  # radii from the contact's centre: beyond it the sides of the gel act, which the model lacks


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GelShear(ContentValue):
    """Shear force on a gel sensor.

    Attributes
    ----------
    force_n
        Components (x, y) on the gel at the best values of the gel.
    samples_n
        Forces for values of gel and traction that are possible, shape (draws, 2).
    explained
        Fraction of the markers' squared displacement that the traction explains.
    problems
        Reasons not to trust the force; empty when there is none.
    """

    force_n: tuple[float, float]
    samples_n: Floats
    explained: float
    problems: tuple[str, ...] = ()

    def interval_n(self, level: float = 0.9) -> tuple[tuple[float, float], tuple[float, float]]:
        """Intervals of both components."""
        edge = (1.0 - require_number("level", level, 0.01, 0.999)) / 2
        (left, below), (right, above) = np.quantile(self.samples_n, [edge, 1 - edge], axis=0)
        return (float(left), float(right)), (float(below), float(above))


def gel_shear(
    points_mm: ArrayLike,
    displacement_mm: ArrayLike,
    *,
    sensor: GelSensor,
    centre_mm: tuple[float, float],
    radius_mm: float,
    sd_mm: float = 0.01,
    draws: int = DRAWS,
    rng: np.random.Generator | None = None,
) -> GelShear:
    """Shear force from the displacement of markers, by the tangential Green's function of the bonded layer.

    The traction is a smooth random field inside the contact and zero outside it; its size is that of the largest
    evidence. A normal force moves markers too, evenly to all sides, which adds nothing to the sum.

    Parameters
    ----------
    points_mm, displacement_mm
        Places of markers on the untouched face and how far they moved, both along it, shape (n, 2).
    sensor
        The sensor with its gel.
    centre_mm, radius_mm
        The contact.
    sd_mm
        Standard deviation of a displacement along one axis.
    draws, rng
        As in `gel_force`.

    Raises
    ------
    InputError
        When there are fewer than 6 markers, or a value is out of range.
    """
    require_type("sensor", sensor, GelSensor)
    points, moved = (
        require_array(n, v, ndim=2) for n, v in (("points_mm", points_mm), ("displacement_mm", displacement_mm))
    )
    if points.shape != moved.shape or points.shape[1] != 2 or len(points) < FEWEST_MARKERS:
        raise InputError(
            f"points_mm and displacement_mm must have the shape (n, 2) with n at least {FEWEST_MARKERS}; got "
            f"{points.shape} and {moved.shape}: use a gel with more markers"
        )
    radius = require_number("radius_mm", radius_mm, 0.05, 100.0, hint="millimetres")
    sd = require_number("sd_mm", sd_mm, 1e-5, 1.0, hint="millimetres")
    rng = rng or np.random.default_rng(0)
    relative = points - np.asarray(centre_mm, dtype=float)
    near = np.hypot(*relative.T) < FARTHEST * radius
    if np.count_nonzero(near) >= FEWEST_MARKERS:
        relative, moved = relative[near], moved[near]
    best = DrawnGel(sensor.young_kpa.best, min(sensor.poisson.best, LARGEST_RATIO), sensor.thickness_mm.best)
    mean, _, explained = shear_of_markers(relative, moved, radius, sd, **asdict(best))
    gels = [
        DrawnGel(best.young_kpa, min(poisson, LARGEST_RATIO), thickness)
        for thickness in dict.fromkeys(sensor.thickness_mm.limits)
        for poisson in dict.fromkeys(sensor.poisson.limits)
    ]
    solved = [shear_of_markers(relative, moved, radius, sd, **asdict(gel))[:2] for gel in gels]
    samples = np.empty((require_integer("draws", draws, 20, 100_000), 2))
    for number in range(len(samples)):
        share = rng.dirichlet(np.ones(len(solved)))  # between the limits of thickness and Poisson's ratio
        centre, spread = (sum(part * one[k] for part, one in zip(share, solved, strict=True)) for k in (0, 1))
        scale = drawn_gel(sensor, rng).young_kpa / best.young_kpa
        error = rng.normal(0.0, 2.0 * sensor.scale_uncertainty)
        spread = np.hypot(spread, SHEAR_MODEL_SD * np.hypot(*centre))
        samples[number] = (centre + spread * rng.standard_normal(2)) * scale * np.exp(error)
    return GelShear(
        force_n=(float(mean[0]), float(mean[1])),
        samples_n=require_array("samples_n", samples, ndim=2),
        explained=explained,
        problems=_shear_problems(sensor, explained, relative, radius),
    )


def _shear_problems(sensor: GelSensor, explained: float, relative: Floats, radius: float) -> tuple[str, ...]:
    problems = []
    if sensor.shape != "flat":
        problems.append(f"the gel of {sensor.name} is {sensor.shape}, and the model is a flat layer")
    if explained < LEAST_EXPLAINED:
        problems.append(
            f"the traction explains {explained:.0%} of the markers' movement: check the contact and the markers"
        )
    if np.count_nonzero(np.hypot(*relative.T) < 1.5 * radius) < FEWEST_MARKERS:
        problems.append("fewer than 6 markers lie at the contact")
    return tuple(problems)
