"""Posterior of the lumps of one block of presses: likelihood under uneven tissue, greedy start, reversible jumps.

All that is linear and Gaussian, the noise, the nuisances and the tissue's field, is integrated out. For each kind of
field (a length, a spectrum) the numbers are turned so that noise and field are both diagonal; a standard deviation of
the field then costs a sum, and a lump a product of a matrix and a vector. The number of lumps, the lumps, the kind and
size of the field are sampled together (Green's reversible jump).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import one_blas_thread
from tsis.mapping.signals import DEPTH, LOG_CONTRAST, LOG_DIAMETER, LUMP_COLUMNS, X, Y
from tsis.mapping.uneven_field import LENGTHS_MM, tail_weights
from tsis.mechanics.lump_kernel import eshelby_factor

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.mapping.observation import Observation
    from tsis.mapping.prior import MapPrior
    from tsis.mapping.signals import Floats, Integers

    Mixture = tuple[tuple[float, float], ...]  # lengths and weights of Gaussian fields whose sum a field is

SDS = np.array([0.003, 0.01, 0.02, 0.03, 0.045, 0.065, 0.09, 0.12, 0.16, 0.21, 0.27, 0.35, 0.45, 0.6])
IMPROBABLE = 12.0  # kinds of field less probable by this log factor are left out of the sampling
MARGIN = 0.5  # of the face's radius: how far beyond the presses lumps are sought
CLEAR_OF_REFERENCE = 0.6  # of the face's radius: no lump's centre is nearer to a reference press
FIELD_ERROR = 0.07  # of the field's effect on each number: second order, and meshes
SIGNAL_ERROR = 0.04  # of a lump's signal: error of the model that differs between numbers
SHARED_ERROR = 0.04  # of a lump's signal in harmonic 0, half as much more in each further one: shared by all presses
UNEVEN_ERROR = 0.5  # of the field's standard deviation: a lump's signal depends on the tissue around it
# Errors of the kernel that all presses share, as solved scans show them: place and depth as parts of the depth,
# logarithms of the diameter at equal strength and of the strength
PLACE_ERROR, DEPTH_ERROR, RIDGE_ERROR, STRENGTH_ERROR = 0.02, 0.05, 0.05, 0.03
MOST_LUMPS = 12
MOST_KINDS = 3  # of field that are sampled
MIXED_MM = 5.0  # a field of a longer length comes also in equal parts with one of the shortest
CONTACT = 0.9  # of the sum of the radii: lumps do not overlap by more
# Two lumps that come from one: standard deviations of their distance along x, y and depth and of the logarithm of
# their contrasts' ratio, least share of the volume, and the farthest that become one
SPLIT_MM, SPLIT_LOG_CONTRAST, LEAST_SHARE, FARTHEST_MERGED_MM = np.array([6.0, 6.0, 3.0]), 0.5, 0.15, 16.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Region:
    """Where lumps may lie, and how probable they are there."""

    low: Floats  # of x, y, depth of the TOP, logarithms of diameter and contrast
    high: Floats
    thickness_mm: float
    expected: float
    closed_mm: Floats  # centres of discs without lumps, (n, 2)
    closed_radius_mm: float

    @classmethod
    def of(cls, observation: Observation, prior: MapPrior, *, expected: float) -> Region:
        """Around the presses."""
        margin = MARGIN * observation.radius_mm
        places = observation.places_mm
        ranges = [(places[:, axis].min() - margin, places[:, axis].max() + margin) for axis in (0, 1)]
        ranges += [prior.depth_mm, tuple(np.log(prior.diameter_mm)), tuple(np.log(prior.contrast))]
        low, high = np.array(ranges).T
        return cls(
            low=low,
            high=high,
            thickness_mm=prior.thickness_mm,
            expected=expected,
            closed_mm=places[observation.reference],
            closed_radius_mm=CLEAR_OF_REFERENCE * observation.radius_mm,
        )

    @property
    def log_density(self) -> float:
        """Logarithm of the density of one lump, number included."""
        return float(np.log(self.expected) - np.log(self.high - self.low).sum())

    def top_form(self, lump: Floats) -> Floats:
        """The lump by the depth of its top."""
        other = lump.copy()
        other[DEPTH] -= np.exp(lump[LOG_DIAMETER]) / 2
        return other

    def allows(self, lumps: Floats, number: int) -> bool:
        """Whether one of the lumps lies in the region and clear of the others."""
        lump = lumps[number]
        top = self.top_form(lump)
        if (top < self.low).any() or (top > self.high).any():
            return False
        radius = np.exp(lump[LOG_DIAMETER]) / 2
        if lump[DEPTH] + radius > self.thickness_mm - 0.3:
            return False
        if len(self.closed_mm) and np.hypot(*(self.closed_mm - lump[:2]).T).min() < self.closed_radius_mm:
            return False
        others = np.delete(lumps, number, axis=0)
        if not len(others):
            return True
        distance = np.sqrt(((others[:, :3] - lump[:3]) ** 2).sum(axis=1))
        return bool((distance > CONTACT * (radius + np.exp(others[:, LOG_DIAMETER]) / 2)).all())

    def drawn(self, rng: np.random.Generator) -> Floats:
        """A lump of the prior, bounds of the slab and neighbours apart."""
        lump = rng.uniform(self.low, self.high)
        lump[DEPTH] += np.exp(lump[LOG_DIAMETER]) / 2
        return lump

    def moved_inside(self, lump: Floats) -> Floats:
        """The nearest lump of the region, neighbours apart."""
        top = np.clip(self.top_form(lump), self.low + 1e-6, self.high - 1e-6)
        most = self.thickness_mm - 0.4 - top[DEPTH]
        top[LOG_DIAMETER] = min(top[LOG_DIAMETER], np.log(max(most, np.exp(self.low[LOG_DIAMETER]) + 1e-6)))
        top[DEPTH] += np.exp(top[LOG_DIAMETER]) / 2
        return np.asarray(top)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldKind:
    """One length and spectrum of the field: the turn that makes noise and field diagonal."""

    length_mm: float
    is_rough: bool
    log_root: float  # logarithm of the determinant of the root of the noise's covariance
    mixture: Mixture
    turn: Floats  # (n, n): turned numbers have the variance 1 + sd**2 * size
    size: Floats


def field_sds(prior: MapPrior) -> Floats:
    """Standard deviations of the field that are sampled, up to the prior's largest."""
    return np.append(SDS[prior.heterogeneity_sd * 0.99 > SDS], prior.heterogeneity_sd)


class BlockLikelihood:
    """Likelihood of lumps for one block of presses."""

    def __init__(
        self,
        observation: Observation,
        prior: MapPrior,
        *,
        length_mm: float | None = None,
        report: Callable[[], None] | None = None,
    ) -> None:
        """Of all kinds of field, or of those of one length, which takes a fifth of the time."""
        self.observation, self.prior = observation, prior
        lengths = LENGTHS_MM
        if length_mm is not None:
            lengths = LENGTHS_MM[sorted({0, int(np.abs(np.log(LENGTHS_MM / length_mm)).argmin())})]
        self.sds = field_sds(prior)
        width = np.gradient(self.sds) if len(self.sds) > 1 else np.ones(1)
        self.log_sd_weight = np.log(width / width.sum())
        with one_blas_thread():
            by_length = []
            for length in lengths.tolist():
                field = observation.field.covariance(
                    length,
                    observation.places_mm,
                    observation.angle,
                    observation.force_n,
                    observation.place_sd_mm,
                )
                by_length.append(field + FIELD_ERROR**2 * np.diag(np.diag(field)))
                if report is not None:
                    report()
        by = dict(zip(lengths.tolist(), by_length, strict=True))
        mixtures: list[tuple[float, bool, Mixture]] = [(length, False, ((length, 1.0),)) for length in by]
        if length_mm is None:
            rougher = LENGTHS_MM[1:].tolist()
            mixtures += [
                (length, True, tuple(zip(by, tail_weights(length).tolist(), strict=True))) for length in rougher
            ]
        short = float(lengths[0])  # beside unevenness of its own, what the model errs in from press to press
        mixtures += [(length, True, ((short, 0.5), (length, 0.5))) for length in by if length > MIXED_MM]
        self._fields = [
            (length, rough, mixture, sum((weight * by[one] for one, weight in mixture), np.zeros(1)))
            for length, rough, mixture in mixtures
        ]
        self._even_kinds = self._turned(observation.noise, range(len(self._fields)), report)
        self.kinds = self._even_kinds

    def _turned(
        self, noise: Floats, which: range | list[int], report: Callable[[], None] | None = None
    ) -> list[FieldKind]:
        with one_blas_thread():
            root = np.linalg.cholesky(noise)
            log_root = float(np.log(np.diag(root)).sum())
            inverse = scipy.linalg.lapack.dtrtri(root, lower=1)[0]
            kinds = []
            for index in which:
                length, rough, mixture, field = self._fields[index]
                size, vectors = np.linalg.eigh(inverse @ field @ inverse.T)
                kinds.append(
                    FieldKind(
                        log_root=log_root,
                        length_mm=length,
                        is_rough=rough,
                        mixture=mixture,
                        turn=np.ascontiguousarray(vectors.T @ inverse),
                        size=np.maximum(size, 0.0),
                    )
                )
                if report is not None:
                    report()
        return kinds

    def with_signal_error(self, lumps: Floats) -> None:
        """Add the error of the model for these lumps to the noise; only probable kinds of field remain.

        A part of it differs between numbers. The larger part is shared: what the kernel errs in one harmonic of one
        lump, near to it and far from it, is the same in all presses, so that no number of presses averages it away.
        """
        seen = self.observation
        signal = self.signal(lumps)
        self.kinds = self._even_kinds
        weights = self.log_weights(seen.values - signal)
        best = weights.max(axis=1)
        sd = float(self.sds[int(weights.max(axis=0).argmax())])
        order = np.argsort(-best)[:MOST_KINDS]
        kept = [int(index) for index in order if best[index] > best.max() - IMPROBABLE]
        noise = seen.noise + np.diag(own_signal_variance(signal, sd).ravel())
        harmonic = np.array([output[0] for output in seen.table.shapes.outputs])
        for lump in lumps:
            alone = self.signal(lump[None])
            far = np.hypot(*(seen.places_mm - lump[:2]).T) / seen.radius_mm
            for slope in (np.ones(len(far)), np.clip(far - 1.0, -1.0, 1.0)):
                columns = np.stack([alone * slope[:, None] * (harmonic == one) for one in np.unique(harmonic)])
                size = shared_signal_errors(np.unique(harmonic), sd, seen.strain_error)
                flat = (columns * size[:, :, None]).reshape(len(columns), -1)
                noise += flat.T @ flat
        self.kinds = self._turned(noise, kept)

    def field_at(self, kind: FieldKind, moved_mm: Sequence[Floats], weights: Floats) -> list[Floats]:
        """Numbers of the presses at other places, by a field of a kind and unit variance and the data's ``weights``."""
        seen = self.observation
        parts = [
            [
                weight * numbers
                for numbers in seen.field.predicted(
                    length, moved_mm, seen.places_mm, seen.angle, seen.force_n, seen.place_sd_mm, weights
                )
            ]
            for length, weight in kind.mixture
        ]
        return [np.sum(one, axis=0) for one in zip(*parts, strict=True)]

    def settle(self) -> None:
        """Drop what only a change of the signal's error needs: most of the memory."""
        self._fields, self._even_kinds = [], []

    def signal(self, lumps: Floats) -> Floats:
        """Changes by lumps, (presses, numbers)."""
        seen = self.observation
        return seen.table.signals(lumps, seen.places_mm, seen.angle, seen.force_n)

    def log_weights(self, residual: Floats) -> Floats:
        """Logarithm of the probability of each kind and standard deviation of the field times the likelihood."""
        result: Floats = np.empty((len(self.kinds), len(self.sds)))
        for number, kind in enumerate(self.kinds):
            result[number] = self.log_likelihoods(kind, kind.turn @ residual.ravel())
        return np.asarray(result + self.log_sd_weight)

    def log_likelihoods(self, kind: FieldKind, turned: Floats) -> Floats:
        """For all standard deviations."""
        variance = 1 + np.outer(self.sds**2, kind.size)
        return np.asarray(-0.5 * (np.log(variance) + turned**2 / variance).sum(axis=1) - kind.log_root)


def own_signal_variance(signals: Floats, sd: float) -> Floats:
    """Variance of the error of signals by lumps (..., numbers) that differs between numbers, in a field of this sd."""
    each = np.hypot(SIGNAL_ERROR, UNEVEN_ERROR * sd)
    return np.asarray(each**2 * (signals**2 + (signals**2).mean(axis=-1, keepdims=True) / 4))


def shared_signal_errors(harmonics: Floats, sd: float, strain_error: Floats | float = 0.0) -> Floats:
    """Errors of each harmonic of one lump's signal, relative to it, that all presses share, in a field of this sd.

    With the ``strain_error`` of each press the shape is (harmonics, presses).
    """
    shared = np.hypot(np.hypot(SHARED_ERROR, UNEVEN_ERROR * sd), strain_error)
    return np.asarray(np.multiply.outer(1 + harmonics / 2, shared))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """A most probable state: lumps, kind and standard deviation of the field."""

    lumps: Floats
    kind: int
    sd: int
    log_evidence: float
    spread: Floats  # covariance of each lump given the others, (lumps, columns, columns)
    log_weight: Floats  # of the kinds and standard deviations


STEPS = np.array([0.05, 0.05, 0.05, 0.01, 0.02])  # of numerical derivatives
ROUNDS = 12
STARTS = 3


def greedy_fit(
    likelihood: BlockLikelihood,
    region: Region,
    *,
    start: Floats | None = None,
    report: Callable[[], None] | None = None,
) -> tuple[Fit, Floats, Floats]:
    """Lumps added one by one as long as the evidence grows; the candidates and their gains beside.

    ``start`` has the lumps of an earlier fit (n, `LUMP_COLUMNS`), with which the search begins.
    """
    candidates = _candidates(region)
    signals = np.array([likelihood.signal(one[None]).ravel() for one in candidates])
    fit = _settled(likelihood, region, np.zeros((0, LUMP_COLUMNS)))
    if start is not None and len(start):
        inside = np.array([region.moved_inside(one) for one in start])
        likelihood.with_signal_error(inside)
        fit = _settled(likelihood, region, inside)
    while True:
        gain = _gains(likelihood, fit, signals)
        if len(fit.lumps) >= MOST_LUMPS:
            return fit, candidates, gain
        best: Fit | None = None
        for index in _apart(candidates, gain)[:STARTS]:
            tried = np.vstack([fit.lumps, candidates[index]])
            if not region.allows(tried, len(tried) - 1) or gain[index] < 2.0:
                continue
            found = _settled(likelihood, region, tried)
            if best is None or found.log_evidence > best.log_evidence:
                best = found
        if report is not None:
            report()
        if best is None or best.log_evidence <= fit.log_evidence:
            return fit, candidates, gain
        likelihood.with_signal_error(best.lumps)
        fit = _settled(likelihood, region, best.lumps)


def _candidates(region: Region) -> Floats:
    step = 4.0
    axes = [np.arange(region.low[axis] + step / 2, region.high[axis], step) for axis in (X, Y)]
    rows = []
    for depth in (5.0, 7.5, 10.0, 13.0, 17.0, 21.0):
        for size in (4.5, 8.0, 12.0):
            top = depth - size / 2
            if top < region.low[DEPTH] or depth + size / 2 > region.thickness_mm - 0.5 or top > region.high[DEPTH]:
                continue
            inside = np.clip(np.log(size), region.low[LOG_DIAMETER], region.high[LOG_DIAMETER])
            rows += [[x, y, depth, inside, np.log(6.0)] for x in axes[0] for y in axes[1]]
    contrast = np.clip(np.log(6.0), region.low[LOG_CONTRAST], region.high[LOG_CONTRAST])
    result = np.array(rows)
    result[:, LOG_CONTRAST] = contrast
    return result


def _gains(likelihood: BlockLikelihood, fit: Fit, signals: Floats) -> Floats:
    """Gain of the log likelihood by each candidate, its contrast free within a factor."""
    kind, sd = likelihood.kinds[fit.kind], likelihood.sds[fit.sd]
    root = np.sqrt(1 + sd**2 * kind.size)
    residual = likelihood.observation.values - likelihood.signal(fit.lumps)
    turned = (kind.turn @ residual.ravel()) / root
    with one_blas_thread():
        columns = (signals @ kind.turn.T) / root
    square = (columns**2).sum(axis=1)
    size = np.clip(columns @ turned / np.maximum(square, 1e-300), 0.4, 1.4)
    return np.asarray(size * (columns @ turned) - 0.5 * size**2 * square)


def _apart(candidates: Floats, gain: Floats) -> list[int]:
    """Best candidates that lie apart."""
    chosen: list[int] = []
    for index in np.argsort(-gain).tolist():
        if all(np.linalg.norm(candidates[index, :3] - candidates[other, :3]) > 5.0 for other in chosen):
            chosen.append(index)
        if len(chosen) >= STARTS:
            break
    return chosen


def _settled(likelihood: BlockLikelihood, region: Region, lumps: Floats) -> Fit:
    """Most probable lumps from a start, the field chosen in turn; Laplace's evidence."""
    seen = likelihood.observation
    lumps = lumps.copy()
    weights = likelihood.log_weights(seen.values - likelihood.signal(lumps))
    kind, sd = (int(part) for part in np.unravel_index(weights.argmax(), weights.shape))
    wide = (region.high - region.low) / 2
    damping, hessian = 1e-2, np.zeros((0, 0))
    count = len(lumps) * LUMP_COLUMNS

    def whitened(lumps: Floats) -> Floats:
        field = likelihood.kinds[kind]
        root = np.sqrt(1 + likelihood.sds[sd] ** 2 * field.size)
        return np.asarray((field.turn @ (seen.values - likelihood.signal(lumps)).ravel()) / root)

    for round_ in range(ROUNDS if count else 0):
        turned = whitened(lumps)
        value = better = float(0.5 * turned @ turned)
        field = likelihood.kinds[kind]
        root = np.sqrt(1 + likelihood.sds[sd] ** 2 * field.size)
        columns = np.zeros((seen.values.size, count))
        for number, lump in enumerate(lumps):
            alone = likelihood.signal(lump[None])
            for axis in range(LUMP_COLUMNS):
                moved = lump.copy()
                moved[axis] += STEPS[axis]
                change = (likelihood.signal(moved[None]) - alone) / STEPS[axis]
                columns[:, number * LUMP_COLUMNS + axis] = change.ravel()
        with one_blas_thread():
            jacobian = (field.turn @ columns) / root[:, None]
        hessian = jacobian.T @ jacobian + np.diag(np.tile(1 / wide**2, len(lumps)))
        gradient = jacobian.T @ turned
        for _ in range(6):
            step = np.linalg.solve(hessian + damping * np.diag(np.diag(hessian)), gradient)
            new = lumps + np.clip(step.reshape(-1, LUMP_COLUMNS), -0.4 * wide, 0.4 * wide)
            new = np.array([region.moved_inside(one) for one in new])
            turned = whitened(new)
            better = float(0.5 * turned @ turned)
            if better < value:
                lumps, damping = new, max(damping / 5, 1e-6)
                break
            damping = min(damping * 5, 1e6)
        converged = better >= value or value - better < 0.02
        if round_ % 3 == 2 or converged:
            weights = likelihood.log_weights(seen.values - likelihood.signal(lumps))
            best = tuple(int(part) for part in np.unravel_index(weights.argmax(), weights.shape))
            if converged and best == (kind, sd):
                break
            kind, sd = best
    weights = likelihood.log_weights(seen.values - likelihood.signal(lumps))
    evidence = float(np.logaddexp.reduce(weights.ravel()))
    spread = np.zeros((len(lumps), LUMP_COLUMNS, LUMP_COLUMNS))
    if count:
        _, log_determinant = np.linalg.slogdet(hessian)
        evidence += len(lumps) * region.log_density + 0.5 * count * np.log(2 * np.pi) - 0.5 * float(log_determinant)
        if any(not region.allows(lumps, number) for number in range(len(lumps))):
            evidence = -np.inf
        for number in range(len(lumps)):
            part = slice(number * LUMP_COLUMNS, (number + 1) * LUMP_COLUMNS)
            spread[number] = np.linalg.inv(hessian[part, part])
    return Fit(lumps=lumps, kind=kind, sd=sd, log_evidence=evidence, spread=spread, log_weight=weights)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Samples:
    """States of the sampling, equally weighted.

    Attributes
    ----------
    lumps
        Lumps (n, `LUMP_COLUMNS`) of each state, with the error of the kernel that all presses share.
    learnt
        The same without that error: what differs between these states, further presses can tell.
    sd, length_mm
        Of the field, shape (states,).
    accepted
        Fraction of accepted moves by kind.
    """

    lumps: tuple[Floats, ...]
    learnt: tuple[Floats, ...]
    sd: Floats
    length_mm: Floats
    accepted: dict[str, float]


class Sampler:
    """Reversible jumps from a fit. `run` may be called again to continue."""

    def __init__(
        self,
        likelihood: BlockLikelihood,
        region: Region,
        fit: Fit,
        candidates: Floats,
        gain: Floats,
        rng: np.random.Generator,
    ) -> None:
        self.likelihood, self.region, self.rng = likelihood, region, rng
        self.lumps = fit.lumps.copy()
        self._fit = fit
        weight = np.exp(np.clip(gain, 0.0, 8.0))
        self._weight = 0.8 * weight / weight.sum() + 0.2 / len(weight)
        self._candidates = candidates
        self.kind = self.sd = 0
        self.tried: dict[str, int] = {}
        self.taken: dict[str, int] = {}
        self._choose_field(self._residual())

    def _residual(self) -> Floats:
        return self.likelihood.observation.values - self.likelihood.signal(self.lumps)

    def _choose_field(self, residual: Floats) -> None:
        """Draw kind and standard deviation of the field given everything else (Gibbs)."""
        weights = self.likelihood.log_weights(residual)
        flat = np.exp(weights - weights.max()).ravel()
        choice = int(self.rng.choice(len(flat), p=flat / flat.sum()))
        self.kind, self.sd = divmod(choice, len(self.likelihood.sds))
        field = self.likelihood.kinds[self.kind]
        self._turned = field.turn @ residual.ravel()
        self._precision = 1 / (1 + self.likelihood.sds[self.sd] ** 2 * field.size)
        self._cost = float(0.5 * (self._turned**2 * self._precision).sum())

    def _proposed(self, change: Floats) -> tuple[Floats, float]:
        """Turned residual and cost after a change (presses, numbers) of the signal."""
        presses = np.flatnonzero(np.abs(change).max(axis=1) > 0)
        numbers = change.shape[1]
        columns = (presses[:, None] * numbers + np.arange(numbers)).ravel()
        turn = self.likelihood.kinds[self.kind].turn
        matrix = turn if len(presses) == len(change) else turn[:, columns]
        turned = self._turned - matrix @ change[presses].ravel()
        return turned, float(0.5 * (turned**2 * self._precision).sum())

    def _decide(self, name: str, log_ratio: float, turned: Floats, cost: float) -> bool:
        self.tried[name] = self.tried.get(name, 0) + 1
        if np.log(self.rng.random()) < self._cost - cost + log_ratio:
            self._turned, self._cost = turned, cost
            self.taken[name] = self.taken.get(name, 0) + 1
            return True
        return False

    def _replace(self, name: str, number: int, lump: Floats, log_ratio: float) -> None:
        new = self.lumps.copy()
        new[number] = lump
        if not self.region.allows(new, number):
            self.tried[name] = self.tried.get(name, 0) + 1
            return
        signal = self.likelihood.signal
        change = signal(lump[None]) - signal(self.lumps[number][None])
        if self._decide(name, log_ratio, *self._proposed(change)):
            self.lumps = new

    def _walk(self, number: int) -> None:
        """Move one lump, in the shape of its posterior where the fit has one."""
        lump, rng = self.lumps[number], self.rng
        spread = np.diag([0.4, 0.4, 0.4, 0.08, 0.3]) ** 2
        if len(self._fit.lumps):
            nearest = int(np.argmin(((self._fit.lumps[:, :3] - lump[:3]) ** 2).sum(axis=1)))
            if np.linalg.norm(self._fit.lumps[nearest, :3] - lump[:3]) < 6.0:
                spread = self._fit.spread[nearest]
        size = rng.choice([0.15, 0.5, 1.0])
        # proposal symmetric as long as the nearest fitted lump stays the same; else refused
        step = size * np.linalg.cholesky(spread + 1e-10 * np.eye(LUMP_COLUMNS)) @ rng.normal(size=LUMP_COLUMNS)
        moved = lump + step
        if len(self._fit.lumps):
            before, after = (((self._fit.lumps[:, :3] - one[:3]) ** 2).sum(axis=1) for one in (lump, moved))
            if before.argmin() != after.argmin() or (before.min() < 36.0) != (after.min() < 36.0):
                return
        self._replace("walk", number, moved, 0.0)

    def _ridge(self, number: int) -> None:
        """Move along equal volume times Eshelby's factor: larger and softer, or smaller and harder."""
        lump = self.lumps[number].copy()
        by = float(self.rng.normal(0.0, 0.5))
        before, after = (eshelby_factor(np.exp(value)) for value in (lump[LOG_CONTRAST], lump[LOG_CONTRAST] + by))
        if after <= 0.05:
            return
        lump[LOG_CONTRAST] += by
        lump[LOG_DIAMETER] += float(np.log(before / after)) / 3  # of unit Jacobian: the shift depends on the contrast
        self._replace("ridge", number, lump, 0.0)

    def _birth(self) -> None:
        if len(self.lumps) >= MOST_LUMPS:
            return
        rng, region = self.rng, self.region
        choice = self._candidates[int(rng.choice(len(self._weight), p=self._weight))]
        lump = region.drawn(rng)
        lump[:2] = choice[:2] + rng.uniform(-2.0, 2.0, 2)
        lump[DEPTH] = choice[DEPTH] + rng.normal(0.0, 2.0)
        lump[LOG_DIAMETER] = choice[LOG_DIAMETER] + rng.normal(0.0, 0.3)
        new = np.vstack([self.lumps, lump])
        if not region.allows(new, len(new) - 1):
            self.tried["birth"] = self.tried.get("birth", 0) + 1
            return
        ratio = region.log_density - self._birth_density(lump) - np.log(len(new))
        change = self.likelihood.signal(lump[None])
        if self._decide("birth", ratio, *self._proposed(change)):
            self.lumps = new

    def _birth_density(self, lump: Floats) -> float:
        """Logarithm of the density with which a lump is proposed."""
        inside = (np.abs(self._candidates[:, :2] - lump[:2]) <= 2.0).all(axis=1)
        depth = (lump[DEPTH] - self._candidates[inside, DEPTH]) / 2.0
        size = (lump[LOG_DIAMETER] - self._candidates[inside, LOG_DIAMETER]) / 0.3
        density = self._weight[inside] / 16.0 * np.exp(-0.5 * (depth**2 + size**2)) / (2 * np.pi * 2.0 * 0.3)
        width = self.region.high[LOG_CONTRAST] - self.region.low[LOG_CONTRAST]
        return float(np.log(max(float(density.sum()), 1e-300)) - np.log(width))

    def _death(self) -> None:
        if not len(self.lumps):
            return
        number = int(self.rng.integers(len(self.lumps)))
        lump = self.lumps[number]
        ratio = self._birth_density(lump) + np.log(len(self.lumps)) - self.region.log_density
        change = -self.likelihood.signal(lump[None])
        if self._decide("death", ratio, *self._proposed(change)):
            self.lumps = np.delete(self.lumps, number, axis=0)

    def _split(self) -> None:
        """Make two lumps of one, of the same volume and centre of volume.

        A lump (p, ln d, ln c) and the draws u, w, e give ``p + (1 - w) u`` and ``p - w u``, ``ln d + ln(w) / 3`` and
        ``ln d + ln(1 - w) / 3``, ``ln c + e / 2`` and ``ln c - e / 2``. The determinant of that map is
        ``1 / (3 w (1 - w))``. The draws (-u, 1 - w, -e) give the same two lumps, whence the factor 2 of the density.
        """
        if not 0 < len(self.lumps) < MOST_LUMPS:
            return
        rng, number = self.rng, int(self.rng.integers(len(self.lumps)))
        lump, apart = self.lumps[number], rng.normal(0.0, SPLIT_MM)
        share, by = rng.uniform(LEAST_SHARE, 1 - LEAST_SHARE), rng.normal(0.0, SPLIT_LOG_CONTRAST)
        pair = np.array([lump, lump])
        pair[:, :3] += np.outer([1 - share, -share], apart)
        pair[:, LOG_DIAMETER] += np.log([share, 1 - share]) / 3
        pair[:, LOG_CONTRAST] += (by / 2, -by / 2)
        new = np.vstack([np.delete(self.lumps, number, axis=0), pair])
        self._exchange("split", new, lump[None], pair, _log_split_density(pair), len(self.lumps), _close_pairs(new))

    def _merge(self) -> None:
        """Make one lump of two near ones: the reverse of a split."""
        close = _close_pairs(self.lumps)
        if not len(close):
            return
        pair = self.lumps[close[int(self.rng.integers(len(close)))]]
        volume = np.exp(3 * pair[:, LOG_DIAMETER])
        lump = pair.mean(axis=0)
        lump[:3] = volume @ pair[:, :3] / volume.sum()
        lump[LOG_DIAMETER] = np.log(volume.sum()) / 3
        kept = self.lumps[(self.lumps[:, None] != pair).any(axis=2).all(axis=1)]
        new = np.vstack([kept, lump])
        self._exchange("merge", new, pair, lump[None], -_log_split_density(pair), len(new), close)

    def _exchange(
        self,
        name: str,
        new: Floats,
        gone: Floats,
        come: Floats,
        log_density: float,
        parents: int,
        close: Integers,
    ) -> None:
        """Take or refuse a split or a merge, whose logarithms of ratios differ by the sign alone."""
        inside = all(self.region.allows(new, len(new) - 1 - number) for number in range(len(come)))
        if not inside or not len(close) or not np.isfinite(log_density):
            self.tried[name] = self.tried.get(name, 0) + 1
            return
        ratio = self.region.log_density + np.log(parents) - np.log(len(close))
        signal = self.likelihood.signal
        change = signal(come) - signal(gone)
        if self._decide(name, (ratio if name == "split" else -ratio) - log_density, *self._proposed(change)):
            self.lumps = new

    def step(self) -> None:
        """One move."""
        kind = self.rng.random()
        if kind < 0.11:
            self._birth()
        elif kind < 0.22:
            self._death()
        elif kind < 0.26:
            self._split()
        elif kind < 0.3:
            self._merge()
        elif len(self.lumps):
            number = int(self.rng.integers(len(self.lumps)))
            if kind < 0.4:
                self._ridge(number)
            else:
                self._walk(number)

    def run(
        self, steps: int, *, every: int = 20, burn: float = 0.25, report: Callable[[], None] | None = None
    ) -> Samples:
        """Take steps; states after the first part are kept."""
        lumps, learnt, sds, lengths = [], [], [], []
        with one_blas_thread():
            for step in range(steps):
                if step % 50 == 0:
                    self._choose_field(self._residual())
                self.step()
                if step >= burn * steps and step % every == 0:
                    lumps.append(self._with_kernel_error())
                    learnt.append(self.lumps.copy())
                    sds.append(self.likelihood.sds[self.sd])
                    lengths.append(self.likelihood.kinds[self.kind].length_mm)
                if report is not None and step % 500 == 499:
                    report()
        return Samples(
            lumps=tuple(lumps),
            learnt=tuple(learnt),
            sd=np.array(sds),
            length_mm=np.array(lengths),
            accepted={name: self.taken.get(name, 0) / count for name, count in self.tried.items()},
        )

    def _with_kernel_error(self) -> Floats:
        """The lumps with the error of the kernel that all presses share, so that no number of presses averages it."""
        lumps, rng, count = self.lumps.copy(), self.rng, len(self.lumps)
        lumps[:, :3] += rng.normal(0.0, (PLACE_ERROR, PLACE_ERROR, DEPTH_ERROR), (count, 3)) * lumps[:, DEPTH, None]
        by = rng.normal(0.0, RIDGE_ERROR, count)
        factor = eshelby_factor(np.exp(lumps[:, LOG_CONTRAST])) * np.exp(
            -3 * by + rng.normal(0.0, STRENGTH_ERROR, count)
        )
        low, high = self.region.low[LOG_CONTRAST], self.region.high[LOG_CONTRAST]
        # the contrast of a factor f is 1 + f / (1 - b f), up to the prior's ends
        least, most = eshelby_factor(np.exp(low)), eshelby_factor(np.exp(high))
        factor = np.clip(factor, least, most)
        share = (1 - (np.exp(high) - 1) / float(most)) / (1 - np.exp(high))
        lumps[:, LOG_CONTRAST] = np.log(1 + factor / (1 - share * factor))
        lumps[:, LOG_DIAMETER] += by
        return lumps


def _close_pairs(lumps: Floats) -> Integers:
    """Numbers of the lumps of each pair that a merge may choose, shape (pairs, 2)."""
    first, second = np.triu_indices(len(lumps), 1)
    near = np.linalg.norm(lumps[first, :3] - lumps[second, :3], axis=1) < FARTHEST_MERGED_MM
    return np.column_stack([first[near], second[near]])


def _log_split_density(pair: Floats) -> float:
    """Logarithm of the density with which a split proposes two lumps, over the space of the two."""
    volume = np.exp(3 * pair[:, LOG_DIAMETER])
    share = float(volume[0] / volume.sum())
    apart = pair[0] - pair[1]
    if not LEAST_SHARE <= share <= 1 - LEAST_SHARE or np.linalg.norm(apart[:3]) >= FARTHEST_MERGED_MM:
        return -np.inf
    draws = np.append(apart[:3], apart[LOG_CONTRAST]) / np.append(SPLIT_MM, SPLIT_LOG_CONTRAST)
    log_normal = -0.5 * float(draws @ draws) - 2 * np.log(2 * np.pi)
    log_normal -= float(np.log(SPLIT_MM).sum() + np.log(SPLIT_LOG_CONTRAST))
    # 2 for the exchanged draws; over the determinant 1 / (3 w (1 - w))
    return float(np.log(2 / (1 - 2 * LEAST_SHARE)) + log_normal + np.log(3 * share * (1 - share)))


def of_presses(observation: Observation, presses: Integers) -> Observation:
    """The observation of some of the presses."""
    parts = {
        name: getattr(observation, name)[presses]
        for name in (
            *("values", "own", "shared", "white"),
            *("places_mm", "place_sd_mm", "angle", "force_n", "reference", "index", "strain_error"),
        )
    }
    return replace(observation, **parts)
