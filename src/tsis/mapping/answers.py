"""From sampled lumps to the map: lumps with intervals, probabilities, modulus, blind zone, and where to press next."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.compiled import one_blas_thread
from tsis.mapping.flags import CONTRAST_NOT_IDENTIFIED, LOOSE_CONTRAST
from tsis.mapping.lump_map import Lump, NextPlace
from tsis.mapping.posterior import own_signal_variance, shared_signal_errors
from tsis.mapping.signals import DEPTH, LOG_CONTRAST, LOG_DIAMETER, LUMP_COLUMNS, X, Y
from tsis.model.estimate import Estimate

if TYPE_CHECKING:
    from tsis.mapping.posterior import BlockLikelihood, Fit, Region
    from tsis.mapping.prior import MapPrior
    from tsis.mapping.signals import Floats
    from tsis.model.flag import Finding

SAME_LUMP_MM = 4.5  # lumps of two states this near are the same one
AREA_MM = 10.0
BLIND_CONTRAST = 5.0
SEEN = 5.75  # signal over noise that shows a lump nine times in ten: sqrt(2 * 10) + 1.28, ten being the prior's odds
BLIND_STEP_MM = 5.0
TOPS_MM = (2.5, 4.0, 6.0, 8.0, 11.0, 15.0, 19.0)
SIZES_MM = (4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0, 18.0)
PAINTED = 400  # states
PLACES = 5  # that are named next
NEXT_STEP_MM = 5.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cluster:
    """One lump over the states: its samples (n, columns), and the fraction of states that have it."""

    samples: Floats
    probability: float


def clusters(states: tuple[Floats, ...]) -> list[Cluster]:
    """Lumps that states have in common, the most probable first; each state gives a cluster at most one lump."""
    owner = np.concatenate([np.full(len(lumps), number) for number, lumps in enumerate(states)] or [np.zeros(0, int)])
    rows = np.concatenate(states) if len(owner) else np.zeros((0, LUMP_COLUMNS))
    left, found = np.ones(len(rows), dtype=bool), []
    while left.any():
        places = rows[left][:, :3]
        chosen = places[:: max(1, len(places) // 300)]
        near = (np.linalg.norm(chosen[:, None] - places[None], axis=2) < SAME_LUMP_MM).sum(axis=1)
        middle = chosen[int(near.argmax())]
        for _ in range(3):
            distance = np.linalg.norm(rows[:, :3] - middle, axis=1)
            inside = left & (distance < SAME_LUMP_MM)
            middle = np.median(rows[inside, :3], axis=0)
        members = np.flatnonzero(inside)
        members = members[np.argsort(distance[members])]
        _, first = np.unique(owner[members], return_index=True)
        members = members[first]
        probability = len(members) / len(states)
        if probability < 0.02:
            break
        found.append(Cluster(samples=rows[members], probability=probability))
        left[members] = False
    return sorted(found, key=lambda one: -one.probability)


def lump_of(cluster: Cluster, number: int, prior: MapPrior, rng: np.random.Generator) -> tuple[Lump, list[Finding]]:
    """A lump of the map with its intervals, and what is to be said of it."""
    rows = cluster.samples
    diameter, contrast = np.exp(rows[:, LOG_DIAMETER]), np.exp(rows[:, LOG_CONTRAST])
    tissue = prior.tissue_young_kpa * np.exp(rng.normal(0.0, prior.tissue_young_sd, len(rows)))
    samples = {
        "x_mm": rows[:, X],
        "y_mm": rows[:, Y],
        "centre_depth_mm": rows[:, DEPTH],
        "depth_mm": rows[:, DEPTH] - diameter / 2,
        "diameter_mm": diameter,
        "contrast": contrast,
        "young_kpa": contrast * tissue,
    }
    wide = {
        "x_mm": 10.0,
        "y_mm": 10.0,
        "centre_depth_mm": (prior.depth_mm[1] - prior.depth_mm[0]) / np.sqrt(12),
        "depth_mm": (prior.depth_mm[1] - prior.depth_mm[0]) / np.sqrt(12),
        "diameter_mm": (prior.diameter_mm[1] - prior.diameter_mm[0]) / np.sqrt(12),
        "contrast": (prior.contrast[1] - prior.contrast[0]) / np.sqrt(12),
        "young_kpa": prior.tissue_young_kpa * (prior.contrast[1] - prior.contrast[0]) / np.sqrt(12),
    }
    name = f"lump {number}"
    findings: list[Finding] = []
    flags: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    above: float | None = None
    low, high = np.quantile(contrast, [0.05, 0.95])
    if high / low > LOOSE_CONTRAST or high > 0.9 * prior.contrast[1]:
        above = float(low)
        finding = CONTRAST_NOT_IDENTIFIED.finding(lump=name, bound=above)
        findings.append(finding)
        flags = ("contrast_not_identified", "young_kpa_not_identified")
        notes = (finding[1], f"The modulus of {name} lies above {above * prior.tissue_young_kpa:.3g} kPa.")
    estimate = Estimate(
        samples=samples, prior_sd=wide, presence=cluster.probability, flags=flags, notes=notes, prior=str(prior)
    )
    return Lump(name=name, probability=cluster.probability, estimate=estimate, contrast_above=above), findings


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Voxels:
    """Centres of the voxels."""

    x_mm: Floats
    y_mm: Floats
    depth_mm: Floats

    @classmethod
    def of(cls, low: Floats, high: Floats, thickness_mm: float, voxel_mm: float) -> Voxels:
        """Voxels of a region down to the slab's support."""
        axes: list[Floats] = []
        for start, end in ((low[0], high[0]), (low[1], high[1]), (0.0, thickness_mm)):
            count = max(2, int(np.ceil((end - start) / voxel_mm)))
            axes.append(np.asarray((start + end) / 2 + voxel_mm * (np.arange(count) - (count - 1) / 2)))
        return cls(x_mm=axes[0], y_mm=axes[1], depth_mm=axes[2])

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of voxels along depth, y and x."""
        return len(self.depth_mm), len(self.y_mm), len(self.x_mm)


def painted(states: tuple[Floats, ...], voxels: Voxels) -> tuple[Floats, Floats, Floats]:
    """Probability that a voxel lies in a lump, and the first two moments of the contrast there, zero elsewhere."""
    probability, first, second = (np.zeros(voxels.shape, dtype=float) for _ in range(3))
    chosen = states[:: max(1, len(states) // PAINTED)]
    for lumps in chosen:
        here = np.zeros(voxels.shape)
        for lump in lumps:
            radius = np.exp(lump[LOG_DIAMETER]) / 2
            parts = [
                np.flatnonzero(np.abs(axis - centre) <= radius)
                for axis, centre in (
                    (voxels.depth_mm, lump[DEPTH]),
                    (voxels.y_mm, lump[Y]),
                    (voxels.x_mm, lump[X]),
                )
            ]
            if not all(len(part) for part in parts):
                continue
            z, y, x = parts
            square = (
                ((voxels.depth_mm[z] - lump[DEPTH]) ** 2)[:, None, None]
                + ((voxels.y_mm[y] - lump[Y]) ** 2)[:, None]
                + (voxels.x_mm[x] - lump[X]) ** 2
            )
            box = np.ix_(z, y, x)
            here[box] = np.where(square <= radius**2, np.exp(lump[LOG_CONTRAST]), here[box])
        probability += here > 0
        first += here
        second += here**2
    return probability / len(chosen), first / len(chosen), second / len(chosen)


def area_probability(states: tuple[Floats, ...], voxels: Voxels) -> Floats:
    """Probability of the centre of a lump under a square of `AREA_MM` around each point."""
    total = np.zeros(voxels.shape[1:])
    for lumps in states:
        here = np.zeros(total.shape, dtype=bool)
        for lump in lumps:
            beside = np.abs(voxels.x_mm - lump[X]) <= AREA_MM / 2
            here |= (np.abs(voxels.y_mm - lump[Y]) <= AREA_MM / 2)[:, None] & beside
        total += here
    return total / len(states)


def uneven_modulus(likelihood: BlockLikelihood, lumps: Floats, voxels: Voxels) -> tuple[Floats, Floats]:
    """Posterior mean and variance of the logarithm of the tissue's modulus in each voxel, on a grid twice as coarse."""
    seen = likelihood.observation
    residual = seen.values - likelihood.signal(lumps)
    weights = likelihood.log_weights(residual)
    number, at = (int(part) for part in np.unravel_index(weights.argmax(), weights.shape))
    kind, sd = likelihood.kinds[number], float(likelihood.sds[at])
    coarse = [_ends(axis, 4.0) for axis in (voxels.depth_mm, voxels.y_mm, voxels.x_mm)]
    z, y, x = np.meshgrid(*coarse, indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    with one_blas_thread():
        cross = seen.field.with_points(kind.length_mm, points, seen.places_mm, seen.angle, seen.force_n)
        turned = kind.turn @ residual.ravel()
        precision = 1 / (1 + sd**2 * kind.size)
        rotated = cross @ kind.turn.T
        mean = sd**2 * (rotated @ (precision * turned))
        variance = np.maximum(sd**2 - sd**4 * (rotated**2 @ precision), 0.0)
    shape = z.shape
    return tuple(_refined(part.reshape(shape), coarse, voxels) for part in (mean, variance))  # type: ignore[return-value]


def _ends(axis: Floats, step: float) -> Floats:
    return np.linspace(axis[0], axis[-1], max(2, int(np.ceil((axis[-1] - axis[0]) / step)) + 1))


def _refined(values: Floats, coarse: list[Floats], voxels: Voxels) -> Floats:
    for number, (knots, axis) in enumerate(zip(coarse, (voxels.depth_mm, voxels.y_mm, voxels.x_mm), strict=True)):
        cell = np.clip(np.searchsorted(knots, axis) - 1, 0, len(knots) - 2)
        part = np.clip((axis - knots[cell]) / (knots[cell + 1] - knots[cell]), 0.0, 1.0)
        part = part.reshape([-1 if one == number else 1 for one in range(values.ndim)])
        values = (1 - part) * np.take(values, cell, number) + part * np.take(values, cell + 1, number)
    return values


def visibility(likelihood: BlockLikelihood, sd: float, length_mm: float, places_xy: Floats, contrast: float) -> Floats:
    """Signal over noise of lumps of one contrast under points (n, 2), shape (tops, points, sizes)."""
    kind = min(likelihood.kinds, key=lambda one: abs(np.log(one.length_mm / length_mm)))
    root = np.sqrt(1 + sd**2 * kind.size)
    result = np.zeros((len(TOPS_MM), len(places_xy), len(SIZES_MM)))
    with one_blas_thread():
        for i, top in enumerate(TOPS_MM):
            for k, size in enumerate(SIZES_MM):
                if top + size > likelihood.prior.thickness_mm - 0.3:
                    continue
                signals = [
                    likelihood.signal(np.array([[x, y, top + size / 2, np.log(size), np.log(contrast)]])).ravel()
                    for x, y in places_xy.tolist()
                ]
                turned = (np.array(signals) @ kind.turn.T) / root
                result[i, :, k] = np.sqrt((turned**2).sum(axis=1))
    return result


def blind_diameter(seen: Floats, grid: tuple[Floats, Floats], voxels: Voxels) -> Floats:
    """Least visible diameter with the top at each voxel's depth, from `visibility` over a grid of (x, y)."""
    x, y = grid
    sizes = np.log(np.array(SIZES_MM))
    least: Floats = np.full(seen.shape[:2], np.inf)
    for i, j in np.ndindex(seen.shape[0], seen.shape[1]):
        line = np.maximum.accumulate(seen[i, j])
        if line[-1] >= SEEN:
            first = int(np.argmax(line >= SEEN))
            if first == 0:
                least[i, j] = SIZES_MM[0]
            else:
                part = np.log(SEEN / line[first - 1]) / np.log(line[first] / line[first - 1])
                least[i, j] = np.exp(sizes[first - 1] + part * (sizes[first] - sizes[first - 1]))
    by_place = least.reshape(len(TOPS_MM), len(y), len(x))
    levels, rows, columns = (
        np.abs(knots[:, None] - axis).argmin(axis=0)
        for knots, axis in ((np.array(TOPS_MM), voxels.depth_mm), (y, voxels.y_mm), (x, voxels.x_mm))
    )
    return np.asarray(by_place[np.ix_(levels, rows, columns)])


def next_places(
    likelihood: BlockLikelihood,
    region: Region,
    states: tuple[Floats, ...],
    fit: Fit,
    rng: np.random.Generator,
) -> list[NextPlace]:
    """Places of the largest expected gain of information on the lumps, seen and not yet seen.

    The gain is that of a linear Gaussian model: half the log determinant of what the posterior's lumps would change at
    a place over the noise, the uneven tissue and the error of the lumps' signal there. ``states`` are without the error
    of the kernel that all presses share, since a further press tells nothing of it: a lump that is known as well as
    the model allows draws no more presses. Lumps of the prior that the scan would not have shown count with their
    probability.
    """
    seen = likelihood.observation
    sd = float(likelihood.sds[fit.sd])
    kind = likelihood.kinds[min(fit.kind, len(likelihood.kinds) - 1)]
    axes = [np.arange(region.low[axis], region.high[axis] + 1e-6, NEXT_STEP_MM) for axis in (0, 1)]
    grid = np.array([(x, y) for y in axes[1] for x in axes[0]])
    force = np.full(len(grid), float(np.median(seen.force_n)))
    angle = np.zeros(len(grid))
    chosen = states[:: max(1, len(states) // 40)]
    signals = np.array([seen.table.signals(lumps, grid, angle, force) for lumps in chosen])
    hidden, weight = [], []
    root = np.sqrt(1 + sd**2 * kind.size)
    for _ in range(60):
        lump = region.drawn(rng)
        if lump[DEPTH] + np.exp(lump[LOG_DIAMETER]) / 2 > region.thickness_mm - 0.3:
            continue
        turned = (kind.turn @ likelihood.signal(lump[None]).ravel()) / root
        hidden.append(seen.table.signals(lump[None], grid, angle, force))
        weight.append(np.exp(-0.5 * min(float(turned @ turned), 200.0)))
    share = region.expected * np.array(weight) / len(weight)
    single = seen.field.covariance(kind.length_mm, np.zeros((1, 2)), np.zeros(1), force[:1], np.zeros(1))
    noise = sd**2 * single + np.diag(seen.white.mean(axis=0) + (0.01 * seen.scale_kpa) ** 2)
    harmonic = np.array([output[0] for output in seen.table.shapes.outputs])
    shared = shared_signal_errors(harmonic, sd, float(np.median(seen.strain_error)))
    gains = np.empty(len(grid))
    for number in range(len(grid)):
        mean = signals[:, number].mean(axis=0)
        change = signals[:, number] - mean
        by_harmonic = shared * mean * (harmonic == np.unique(harmonic)[:, None])
        errs = np.diag(own_signal_variance(mean, sd))
        inverse = np.linalg.inv(np.linalg.cholesky(noise + errs + by_harmonic.T @ by_harmonic))
        spread = change.T @ change / len(change)
        new = np.array([one[number] for one in hidden])
        spread += (new * share[:, None]).T @ new
        gains[number] = 0.5 * np.linalg.slogdet(np.eye(len(noise)) + inverse @ spread @ inverse.T)[1]
    best: list[int] = []
    for index in np.argsort(-gains).tolist():
        if all(np.hypot(*(grid[index] - grid[other])) >= 1.5 * NEXT_STEP_MM for other in best):
            best.append(index)
        if len(best) == PLACES:
            break
    return [NextPlace(x_mm=float(grid[k, 0]), y_mm=float(grid[k, 1]), gain_nats=float(gains[k])) for k in best]
