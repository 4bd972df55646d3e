"""Young's modulus from a curve of force over depth.

The loading part is fitted by a rigid indenter on a layer (`tsis.mechanics.layer_indentation`) with a baseline of
unknown offset and slope and an unknown contact point. Residuals are correlated: white noise, drift on two scales of
time, and a smooth relative error of the model, each with a standard deviation that the curve itself tells. So the
interval holds what these share with the modulus, not only the scatter of the points.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.compiled import one_blas_thread
from tsis.errors import InputError
from tsis.hardness.curve_flags import (
    ADHESION,
    BETTER,
    CHANGES_WITH_DEPTH,
    HOLD_RELAXES,
    INDENTER_DOUBTFUL,
    LEAST_RESIDUAL,
    LIKE_OTHERS,
    NO_BASELINE,
    NO_CONTACT,
    NOT_IDENTIFIED,
    POOR_FIT,
    ROWS_REPLACED,
    SHALLOW_PART,
    SPIKE,
    UNTRUSTED_FLAGS,
)
from tsis.hardness.flags import WIDE
from tsis.mechanics.layer_indentation import BASES, INDENTERS, indentation_curve
from tsis.model.content import ContentValue
from tsis.model.estimate import NOT_TRUSTED, Estimate
from tsis.model.require import (
    freeze_arrays,
    require_array,
    require_integer,
    require_number,
    require_one_of,
    require_pair,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from tsis.model.flag import Finding

    Floats = NDArray[np.float64]


LEAST_POINTS, MOST_POINTS = 30, 4_000_000
YOUNG_KPA, POISSON = (1e-3, 1e7), (0.48, 0.5)
SAMPLES, DRAWS = 4000, 600
BINS = 120
DEEPEST_BALL, DEEPEST_LAYER = 0.5, 0.25  # depth over the ball's radius and over the thickness
MODEL_SD = (np.log(0.01), np.log(0.002))  # prior median of the model's relative error, and of a foot over the peak
DEPTH_PARTS = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)  # of the used depth, to which the model is fitted anew
MANY_POINTS = 100  # of a curve in which one row that stands alone is no peak
CLEAR_RISE = 50.0  # over the residual: a contact of few points, after a long approach or a wait, is one
APPROACH = 2.5  # length of the used approach over the used depth
FINITE = {"ball": (0.05, 0.04)}  # F falls by this times sqrt(depth / radius): neo-Hookean bodies of nu 0.45-0.49


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ForceCurve(ContentValue):
    """One press: force over the position of the indenter, in the order of time.

    Parameters
    ----------
    position_mm
        Position of the indenter's tip in mm, shape (n,), at least 30; its sign is found.
    force_n
        Force in N, same shape.
    time_s
        Times in s, same shape; without them points are taken as evenly spaced in time.
    name
        Name in results.
    radius_mm
        Radius of the indenter where the file states it.
    recorded
        What else the file says, such as the maker's own modulus.
    """

    position_mm: Floats
    force_n: Floats
    time_s: Floats | None = None
    name: str = ""
    radius_mm: float | None = None
    recorded: Mapping[str, float | str] | None = None

    def __post_init__(self) -> None:
        position, force = (require_array(name, getattr(self, name), ndim=1) for name in ("position_mm", "force_n"))
        time = None if self.time_s is None else require_array("time_s", self.time_s, ndim=1)
        sizes = {position.size, force.size, force.size if time is None else time.size}
        if len(sizes) > 1 or not LEAST_POINTS <= position.size <= MOST_POINTS:
            raise InputError(
                f"position_mm, force_n and time_s must be of one length, {LEAST_POINTS} to {MOST_POINTS} points; got "
                f"{', '.join(str(size) for size in sorted(sizes))}"
            )
        if np.ptp(position) == 0:
            raise InputError("position_mm must differ from point to point; it is constant (check the column)")
        if self.radius_mm is not None:
            require_number("radius_mm", self.radius_mm, 1e-5, 50.0, hint="millimetres")
        freeze_arrays(self, "position_mm", "force_n", *(() if time is None else ("time_s",)))


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidIndenter:
    """The indenter, the layer under it, the machine, and how well they are known.

    Attributes
    ----------
    shape
        ``"ball"``, ``"punch"`` (flat, round) or ``"cone"``.
    radius_mm
        Of ball or punch, in [1e-5, 50] mm.
    half_angle_deg
        Of a cone, between axis and side.
    thickness_mm
        Of the layer; None for a thick one.
    base
        ``"bonded"`` or ``"sliding"``.
    poisson
        Least and greatest Poisson's ratio.
    radius_sd, thickness_sd, force_sd
        Relative standard deviations of radius (of a cone the tangent of its angle), thickness, and scale of the force.
    compliance_mm_per_n, compliance_sd
        Of the machine, which bends by it, and its relative standard deviation.
    """

    shape: str = "ball"
    radius_mm: float | None = None
    half_angle_deg: float | None = None
    thickness_mm: float | None = None
    base: str = "bonded"
    poisson: tuple[float, float] = POISSON
    radius_sd: float = 0.01
    thickness_sd: float = 0.02
    force_sd: float = 0.01
    compliance_mm_per_n: float = 0.0
    compliance_sd: float = 0.1

    def __post_init__(self) -> None:
        require_one_of("indenter", self.shape, INDENTERS)
        require_one_of("base", self.base, BASES)
        if self.shape == "cone":
            if self.half_angle_deg is None:
                raise InputError("half_angle_deg must be given, the angle between axis and side of the cone")
            require_number("half_angle_deg", self.half_angle_deg, 5.0, 89.0, hint="degrees")
        elif self.radius_mm is None:
            raise InputError(f"radius_mm must be given, the radius of the {self.shape}; the file does not state it")
        else:
            require_number("radius_mm", self.radius_mm, 1e-5, 50.0, hint="millimetres")
        if self.thickness_mm is not None:
            require_number("thickness_mm", self.thickness_mm, 1e-5, 1e4, hint="millimetres")
        low, high = require_pair("poisson", self.poisson)
        require_number("poisson[0]", low, 0.0, 0.5)
        require_number("poisson[1]", high, low, 0.5)
        for name in ("radius_sd", "thickness_sd", "force_sd", "compliance_sd"):
            require_number(name, getattr(self, name), 0.0, 1.0, hint="a fraction")
        require_number("compliance_mm_per_n", self.compliance_mm_per_n, 0.0, 1e6, hint="mm per N")

    def log_force(self, shift: Mapping[str, float] | None = None) -> tuple[Floats, Floats]:
        """Logarithms of depth in mm and of force in N at ``E / (1 - nu²) = 1 kPa``, with parts shifted from their best.

        ``shift`` has logarithms of ``radius`` and ``thickness``, ``poisson`` in terms of its range, and ``finite``.
        """
        shift = shift or {}
        low, high = self.poisson
        poisson = (low + high) / 2 + (high - low) * shift.get("poisson", 0.0)
        thickness = np.inf if self.thickness_mm is None else self.thickness_mm * np.exp(shift.get("thickness", 0.0))
        if self.shape == "cone" and self.half_angle_deg is not None:
            angle = np.degrees(np.arctan(np.tan(np.radians(self.half_angle_deg)) * np.exp(shift.get("radius", 0.0))))
            length = float(thickness) if np.isfinite(thickness) else 1e3
            ratio = 1.0
        else:
            angle, length = 45.0, float(self.radius_mm or 0.0) * np.exp(shift.get("radius", 0.0))
            ratio = float(thickness / length)
        curve = indentation_curve(
            self.shape, thickness=ratio, poisson=poisson, base=self.base, half_angle_deg=float(angle)
        )
        depth, force = curve.depth[1:], curve.force[1:]
        if self.shape == "cone" and self.thickness_mm is None:  # similar at every size
            depth, force = np.geomspace(1e-9, 1.0, 3), force[0] / depth[0] ** 2 * np.geomspace(1e-9, 1.0, 3) ** 2
        mean, sd = FINITE.get(self.shape, (0.0, 0.0))
        force = force * (1 - (mean + sd * shift.get("finite", 0.0)) * np.sqrt(depth))
        return np.log(depth * length), np.log(1e-3 * force * length**2)  # kPa mm² is mN

    def deepest_mm(self) -> float:
        """Greatest depth up to which the model holds."""
        ball = DEEPEST_BALL * float(self.radius_mm or 0.0) if self.shape == "ball" else np.inf
        return float(min(ball, np.inf if self.thickness_mm is None else DEEPEST_LAYER * self.thickness_mm))


def indentation(
    curve: ForceCurve,
    *,
    radius_mm: float | None = None,
    indenter: str = "ball",
    half_angle_deg: float | None = None,
    thickness_mm: float | None = None,
    base: str = "bonded",
    poisson: tuple[float, float] = POISSON,
    radius_sd: float = 0.01,
    thickness_sd: float = 0.02,
    force_sd: float = 0.01,
    compliance_mm_per_n: float = 0.0,
    compliance_sd: float = 0.1,
    seed: int = 0,
) -> Estimate:
    """Estimate Young's modulus from one curve of force over position.

    Parameters
    ----------
    curve
        The press; see `tsis.hardness.curve_files.read_curves` for files.
    radius_mm, indenter, half_angle_deg, thickness_mm, base, poisson
        Indenter and layer, as in `RigidIndenter`; the radius may be that of the curve's file.
    radius_sd, thickness_sd, force_sd, compliance_mm_per_n, compliance_sd
        How well they are known, and the machine's compliance, as in `RigidIndenter`.
    seed
        Of the samples.

    Returns
    -------
    Estimate
        Of ``young_kpa``; its provenance holds the used points and the fitted force.

    Raises
    ------
    InputError
        When a value lies outside its range.

    Examples
    --------
    A ball of 3 mm radius on a thick block of 20 kPa:

    >>> rng = np.random.default_rng(1)
    >>> position = np.linspace(-0.2, 0.1, 900)
    >>> force = 4 / 3 * 20e-3 / 0.76 * np.sqrt(3.0) * np.maximum(position, 0.0) ** 1.5
    >>> curve = ForceCurve(position_mm=position, force_n=force + 1e-5 * rng.standard_normal(900))
    >>> result = indentation(curve, radius_mm=3.0)
    >>> low, high = result.interval(0.9)["young_kpa"]
    >>> 18.5 < low < 20 < high < 21.5
    True
    """
    press = RigidIndenter(
        shape=indenter,
        radius_mm=curve.radius_mm if radius_mm is None else radius_mm,
        half_angle_deg=half_angle_deg,
        thickness_mm=thickness_mm,
        base=base,
        poisson=poisson,
        radius_sd=radius_sd,
        thickness_sd=thickness_sd,
        force_sd=force_sd,
        compliance_mm_per_n=compliance_mm_per_n,
        compliance_sd=compliance_sd,
    )
    rng = np.random.default_rng(require_integer("seed", seed, 0, 2**63 - 1))
    with one_blas_thread():
        return _estimated(curve, press, rng)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Loading:
    """The loading part: positions that rise towards the sample, less the machine's bending, and forces."""

    position: Floats
    force: Floats
    last: int  # index of the peak in the whole curve
    sign: float

    @classmethod
    def of(cls, curve: ForceCurve, compliance: float) -> _Loading:
        force, position = np.array(curve.force_n), np.array(curve.position_mm)
        width = max(1, force.size // 500)
        smooth = scipy.ndimage.uniform_filter1d(force, width, mode="nearest")
        travel = scipy.ndimage.uniform_filter1d(position, width, mode="nearest")
        last, half = int(np.argmax(smooth)), float(smooth.max() + smooth.min()) / 2
        light = np.flatnonzero(smooth < half)
        if last < LEAST_POINTS and light.size and light[-1] > last:  # the record begins with a retreat
            begin = int(light[light > last][0])
            later = begin + int(np.argmax(smooth[begin:]))
            last = later if smooth[later] > half else last
        # The way in is that from half of the force to the peak: the record may begin at any depth.
        before, after = light[light < last], light[light > last]
        near = int(before[-1]) if before.size else int(after[0]) if after.size else 0
        sign = 1.0 if travel[last] >= travel[near] else -1.0
        position = sign * position - compliance * (force - np.median(force[: max(LEAST_POINTS // 3, last // 10)]))
        # What lies behind the indenter's farthest place is an earlier retreat.
        first = int(np.argmin((sign * travel)[: last + 1]))
        first = first if last - first >= LEAST_POINTS else 0
        return cls(position=position[first : last + 1], force=force[first : last + 1], last=last, sign=sign)


def _binned(values: Floats, count: int) -> Floats:
    edges = np.linspace(0, values.size, min(count, values.size) + 1).astype(int)
    return np.asarray(np.add.reduceat(values, edges[:-1]) / np.diff(edges))


def _first_fit(position: Floats, force: Floats, press: RigidIndenter) -> tuple[float, float, Floats, float]:
    """Modulus, contact, baseline and residual sd by least squares over a grid of contact points."""
    log_depth, log_force = press.log_force()
    best = (np.inf, 0.0, 0.0, np.zeros(2))
    lines = np.column_stack([np.ones_like(position), position - position.mean()])
    scale = np.array([1.0, max(float(np.ptp(position)), 1e-300)])
    low, high = position.min() - 0.2 * np.ptp(position), position.max()
    for _ in range(3):
        grid = np.linspace(low, high, 42)[:-1]
        for contact in grid.tolist():
            shape = _force(position - contact, log_depth, log_force)
            peak = float(shape.max())
            if peak <= 0:
                continue
            columns = np.column_stack([lines / scale, shape / peak])
            # A slope is worth its noise: a steep baseline costs as much as a tenth of the peak.
            ridge = np.array([[0.0, 0.1, 0.0]])
            found = np.linalg.lstsq(np.vstack([columns, ridge]), np.append(force, 0.0), rcond=None)[0]
            cost = float(np.sum((columns @ found - force) ** 2))
            if found[2] > 0 and cost < best[0]:
                best = (cost, found[2] / peak, contact, found[:2] / scale)
        if not np.isfinite(best[0]):
            break
        step = grid[1] - grid[0]
        low, high = best[2] - 1.5 * step, best[2] + 1.5 * step
    cost, modulus, contact, baseline = best
    return modulus, contact, baseline, float(np.sqrt(cost / len(force))) if np.isfinite(cost) else np.inf


def _force(depth: Floats, log_depth: Floats, log_force: Floats) -> Floats:
    """Force at ``E / (1 - nu²) = 1 kPa``; beyond the table's ends it goes on with the slope there."""
    logs = np.log(np.maximum(depth, 1e-300))
    inside = np.interp(logs, log_depth, log_force)
    first = (log_force[1] - log_force[0]) / (log_depth[1] - log_depth[0])
    last = (log_force[-1] - log_force[-2]) / (log_depth[-1] - log_depth[-2])
    inside += first * np.minimum(logs - log_depth[0], 0.0) + last * np.maximum(logs - log_depth[-1], 0.0)
    return np.where(depth > 0, np.exp(inside), 0.0)


class _Likelihood:
    """Log density of the logarithm of E*, the contact point and the standard deviations of five kinds of residuals."""

    def __init__(self, position: Floats, force: Floats, press: RigidIndenter, first: tuple[float, float], noise: float):
        self.position, self.force = position, force
        self.tables = press.log_force()
        count = position.size
        index = np.arange(count) / count
        apart = np.abs(index[:, None] - index)
        self.long, self.short = np.exp(-apart), np.exp(-apart * 10)
        self.peak = float(np.ptp(force))
        span = float(np.ptp(position))
        self.depth_scale = max(float(position.max() - first[1]), 1e-3 * span) / 2
        self.span = span
        self.lines = np.column_stack([np.ones(count), (position - position.mean()) / span])
        # Offset unknown; a slope of up to a third of the curve's own rise.
        self.baseline = self.lines @ np.diag([(10 * self.peak) ** 2, (0.3 * self.peak) ** 2]) @ self.lines.T
        floor = np.log(max(noise, 1e-6 * self.peak))
        # The approach tells how much drifts; what departs in contact alone is the model's.
        free = position < first[1] - 0.35 * (position.max() - first[1])  # a foot before contact is no drift
        wander = floor
        if free.sum() >= 10:
            line = np.polynomial.Polynomial.fit(position[free], force[free], 1)
            wander = max(floor, float(np.log(np.std(force[free] - line(position[free])) + 1e-12 * self.peak)))
        self.best_guess = np.array([np.log(first[0]), first[1] / span, floor, wander, wander, *MODEL_SD])
        self.means = np.array([floor, wander, wander, *MODEL_SD])
        self.sds = np.array([1.0, 0.5, 0.5, 1.0, 1.0]) if free.sum() >= 10 else np.array([1.0, 2.0, 2.0, 1.0, 1.0])

    def parts(self, values: Floats) -> tuple[Floats, Floats]:
        """The model's force, and the covariance of the residuals with the baseline's."""
        depth = self.position - values[1] * self.span
        model = np.exp(values[0]) * _force(depth, *self.tables)
        white, long, short, relative, foot = np.exp(2 * values[2:7])
        near = np.exp(-np.abs(depth[:, None] - depth) / self.depth_scale)
        nearer = np.square(np.square(np.square(near)))  # of an eighth of that length
        # Rough or sticky contact has a foot, and samples slip: from shortly before contact on, the curve departs by
        # more than its share of a small force.
        window = self.peak * np.exp(-((np.minimum(depth, 0.0) / (0.4 * self.depth_scale)) ** 2))
        share = np.outer(0.5 * relative * model, model)
        covariance = self.baseline + long * self.long + short * self.short + share * near
        covariance += (share + np.outer(foot * window, window)) * nearer
        covariance.flat[:: depth.size + 1] += white
        return model, covariance

    def __call__(self, values: Floats) -> float:
        if np.any(np.abs(values[2:7] - self.means) > 12) or abs(values[0]) > 60:
            return -np.inf
        model, covariance = self.parts(values)
        try:
            factor = np.linalg.cholesky(covariance)
        except np.linalg.LinAlgError:
            return -np.inf
        white = scipy.linalg.solve_triangular(factor, self.force - model, lower=True, check_finite=False)
        prior = 0.5 * float(np.sum(((values[2:7] - self.means) / self.sds) ** 2))
        return -0.5 * float(white @ white) - float(np.log(np.diag(factor)).sum()) - prior

    def fitted(self, values: Floats) -> tuple[Floats, Floats]:
        """Model with the fitted baseline, and the baseline alone."""
        model, covariance = self.parts(values)
        line = self.baseline @ np.linalg.solve(covariance, self.force - model)
        return model + line, line


def _sampled(likelihood: _Likelihood, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Equally weighted samples of the values by importance, and the mode."""
    scale = np.array([0.02, 0.01, 0.3, 0.5, 0.5, 0.5, 0.5])

    def cost(step: Floats) -> float:
        value = -likelihood(start + scale * step)
        return value if np.isfinite(value) else 1e12

    start = likelihood.best_guess
    found = scipy.optimize.minimize(
        cost, np.zeros(7), method="Powell", options={"maxfev": 900, "xtol": 1e-2, "ftol": 1e-6}
    )
    start = start + scale * found.x
    curvature = np.array([_curvature(cost, axis, other) for axis in range(7) for other in range(7)]).reshape(7, 7)
    size, axes = np.linalg.eigh((curvature + curvature.T) / 2)
    spread = axes / np.sqrt(np.clip(size, 0.05, None))
    centre, root = np.zeros(7), spread
    steps = weight = np.zeros(0)
    for _ in range(3):
        normal = rng.standard_normal((DRAWS, 7)) * np.sqrt(5 / rng.chisquare(5, (DRAWS, 1)))
        steps = centre + 1.1 * normal @ root.T
        density = np.array([-cost(step) for step in steps])
        proposal = -6.0 * np.log1p(np.sum(normal**2, axis=1) / 5)
        weight = np.exp(density - proposal - np.max(density - proposal))
        weight /= weight.sum()
        flat = weight**0.7 / np.sum(weight**0.7)  # a few heavy ones must not narrow the next round
        centre = flat @ steps
        off = steps - centre
        root = np.linalg.cholesky((off * flat[:, None]).T @ off + 1e-9 * np.eye(7))
    chosen = rng.choice(DRAWS, SAMPLES, p=weight)
    return start + scale * steps[chosen], start


def _curvature(cost: Any, axis: int, other: int, step: float = 0.5) -> float:
    a, b = np.eye(7)[axis] * step, np.eye(7)[other] * step
    if axis == other:
        return float((cost(a) - 2 * cost(np.zeros(7)) + cost(-a)) / step**2)
    return float((cost(a + b) - cost(a - b) - cost(b - a) + cost(-a - b)) / (4 * step**2))


def _used(loading: _Loading, press: RigidIndenter) -> tuple[Floats, Floats, tuple[float, float], float]:
    """Bins of the part that the model describes, the first fit, and the depth left out, mm."""
    position, force, left_out = loading.position, loading.force, 0.0
    modulus, contact = 0.0, 0.0
    for _ in range(3):
        bins = _binned(position, BINS), _binned(force, BINS)
        modulus, contact, _, _ = _first_fit(*bins, press)
        if modulus <= 0:
            return *bins, (0.0, contact), left_out
        deepest = float(position.max()) - contact
        allowed = min(press.deepest_mm(), deepest)
        too_deep = np.flatnonzero(position > contact + 1.02 * allowed)
        end = int(too_deep[0]) if too_deep.size else position.size
        begin = (
            int(np.flatnonzero(position[:end] < contact - APPROACH * allowed)[-1])
            if np.any(position[:end] < contact - APPROACH * allowed)
            else 0
        )
        if end - begin < LEAST_POINTS or (begin == 0 and end == position.size):
            break
        if end < position.size:
            left_out += deepest - allowed
        position, force = position[begin:end], force[begin:end]
    return _binned(position, BINS), _binned(force, BINS), (modulus, contact), left_out


def _without_spikes(values: Floats) -> tuple[Floats, int]:
    """Values with rows that stand alone replaced by the median of five, and how many; few points tell none."""
    typical = scipy.ndimage.median_filter(values, 5, mode="nearest")
    away = np.abs(values - typical) / max(float(np.ptp(typical)), 1e-300)
    beside = np.maximum(np.roll(away, 1), np.roll(away, -1))
    spikes = (away > SPIKE) & (beside < LIKE_OTHERS)
    if values.size < MANY_POINTS or not spikes.any():
        return values, 0
    return np.where(spikes, typical, values), int(spikes.sum())


def _estimated(curve: ForceCurve, press: RigidIndenter, rng: np.random.Generator) -> Estimate:
    (position_mm, moved), (force_n, jumped) = _without_spikes(curve.position_mm), _without_spikes(curve.force_n)
    curve = replace(curve, position_mm=position_mm, force_n=force_n)
    loading = _Loading.of(curve, press.compliance_mm_per_n)
    if loading.force.size < LEAST_POINTS:
        return _answer(curve, press, _prior_samples(rng), [NO_CONTACT.finding()], {})
    position, force, first, left_out = _used(loading, press)
    if first[0] <= 0:
        return _answer(curve, press, _prior_samples(rng), [NO_CONTACT.finding()], {})
    noise = float(np.median(np.abs(np.diff(force)))) / 0.6745 / np.sqrt(2)
    likelihood = _Likelihood(position, force, press, first, noise)
    values, best = _sampled(likelihood, rng)
    fitted, line = likelihood.fitted(best)
    contact_mm = float(best[1] * likelihood.span)
    depth = position - contact_mm
    rise = float(np.max(fitted - line))
    residual = float(np.sqrt(np.mean((force - fitted) ** 2)))
    flagged = [
        *_fit_findings(depth, rise, residual, left_out),
        *_shape_findings(position, force, press),
        *([ROWS_REPLACED.finding(count=moved + jumped)] if moved + jumped else []),
        *_retreat_findings(curve, loading, press, rise, noise, contact_mm),
    ]
    log_reduced = values[:, 0] + _systematic(press, depth, rise, rng, len(values))
    scatter, sd = _scatter_over_depth(position, force, press, first[1]), float(values[:, 0].std())
    if scatter > 2 * sd:
        flagged.append(CHANGES_WITH_DEPTH.finding(percent=100 * scatter))
    # What scatters beyond the fit's own uncertainty is the model's error: no one modulus belongs to all depths.
    log_reduced += np.sqrt(max(scatter**2 - sd**2, 0.0)) * rng.standard_normal(len(values))
    reduced = np.exp(log_reduced)
    low, high = press.poisson
    samples = reduced * (1 - rng.uniform(low, high, len(values)) ** 2)
    points = {
        "position_mm": position.tolist(),
        "force_n": force.tolist(),
        "fitted_n": fitted.tolist(),
        "contact_mm": contact_mm,
        "depth_mm": float(depth.max()),
        "peak_n": rise,
        "residual_n": residual,
    }
    return _answer(curve, press, samples, flagged, points)


def _scatter_over_depth(position: Floats, force: Floats, press: RigidIndenter, contact_mm: float) -> float:
    """Standard deviation of the logarithm of the modulus over fits of the first parts of the depth."""
    deepest = float(position.max()) - contact_mm
    found = []
    for part in DEPTH_PARTS:
        beyond = np.flatnonzero(position > contact_mm + part * deepest)
        end = int(beyond[0]) if beyond.size else position.size
        if end >= LEAST_POINTS and (modulus := _first_fit(position[:end], force[:end], press)[0]) > 0:
            found.append(np.log(modulus))
    return float(np.std(found)) if len(found) > 2 else 0.0


def _systematic(press: RigidIndenter, depth: Floats, rise: float, rng: np.random.Generator, count: int) -> Floats:
    """Draws of what radius, thickness, finite strain, scale and compliance add to the logarithm of the modulus.

    Each acts on the whole curve nearly as a factor: that at 0.8 of the depth, where most of the force is.
    """
    deep = np.log(0.8 * max(float(depth.max()), 1e-12))

    def log_force(**shift: float) -> float:
        table = press.log_force(shift)
        return float(np.interp(deep, *table))

    total = press.force_sd * rng.standard_normal(count)
    parts = {"radius": press.radius_sd, "finite": 1.0 if press.shape in FINITE else 0.0}
    parts |= {"thickness": press.thickness_sd if press.thickness_mm is not None else 0.0}
    for name, sd in parts.items():
        if sd > 0:
            total -= (log_force(**{name: sd}) - log_force(**{name: -sd})) / 2 * rng.standard_normal(count)
    if press.thickness_mm is not None:  # how Poisson's ratio acts beyond 1 - nu²
        total -= (log_force(poisson=0.29) - log_force(poisson=-0.29)) / 2 * rng.standard_normal(count)
    if press.compliance_mm_per_n > 0:
        slope = 1.5 / max(float(depth.max()), 1e-12)
        total += slope * press.compliance_sd * press.compliance_mm_per_n * rise * rng.standard_normal(count)
    return np.asarray(total)


def _prior_samples(rng: np.random.Generator) -> Floats:
    low, high = np.log(YOUNG_KPA)
    return np.asarray(np.exp(rng.uniform(low, high, SAMPLES)))


def _fit_findings(depth: Floats, rise: float, residual: float, left_out: float) -> Iterator[Finding]:
    touching = int(np.sum(depth > 0))
    if rise < 6 * residual or (touching < 0.07 * len(depth) and rise < CLEAR_RISE * residual):
        yield NO_CONTACT.finding()
    elif residual > 0.08 * rise:
        yield POOR_FIT.finding(percent=100 * residual / rise)
    if np.mean(depth < 0) < 0.05:
        yield NO_BASELINE.finding()
    if left_out > 0:
        used = float(depth.max())
        yield SHALLOW_PART.finding(depth_um=1e3 * used, whole_um=1e3 * (used + left_out))


def _shape_findings(position: Floats, force: Floats, press: RigidIndenter) -> Iterator[Finding]:
    """Whether another indenter fits the curve much better than the stated one: its force grows with another power."""
    stated = _first_fit(position, force, press)[3]
    if stated < LEAST_RESIDUAL * float(np.ptp(force)):
        return
    others = {}
    for shape in INDENTERS:
        if shape != press.shape:
            other = replace(press, shape=shape, half_angle_deg=45.0, radius_mm=press.radius_mm or 1.0)
            try:
                others[shape] = _first_fit(position, force, other)[3]
            except InputError:  # no table holds that shape on so thin a layer
                continue
    best = min(others, key=others.__getitem__, default="")
    if best and stated > BETTER * others[best]:
        yield INDENTER_DOUBTFUL.finding(other=best, stated=press.shape, ratio=stated / others[best])


def _retreat_findings(
    curve: ForceCurve, loading: _Loading, press: RigidIndenter, rise: float, noise: float, contact_mm: float
) -> Iterator[Finding]:
    """What the curve does after its peak: a hold, and a pull on leaving."""
    force = np.array(curve.force_n[loading.last :])
    position = loading.sign * np.array(curve.position_mm[loading.last :])
    if force.size < LEAST_POINTS:
        return
    travel = float(np.ptp(loading.position))
    peak = float(np.max(loading.force) - np.median(loading.force[: max(10, loading.force.size // 20)]))
    still = min(0.02 * travel, 0.1 * max(float(position[0]) - contact_mm, 0.0))
    resting = np.abs(position - position[0]) <= still
    last = int(np.argmin(resting)) if not resting.all() else resting.size
    if last >= 0.1 * loading.force.size and last > 10:
        change = float(np.max(force[:10]) - np.median(force[last - max(last // 10, 3) : last])) / peak
        if abs(change) > 0.05:
            yield HOLD_RELAXES.finding(percent=100 * change)
    away = position < contact_mm
    if np.sum(away) > 10:
        smooth = scipy.ndimage.median_filter(force, max(3, force.size // 500), mode="nearest")
        pull = float(np.median(smooth[-max(10, force.size // 20) :]) - smooth.min())
        if pull > max(0.1 * peak, 6 * noise):
            yield ADHESION.finding(percent=100 * pull / peak)


def _answer(
    curve: ForceCurve, press: RigidIndenter, samples: Floats, flagged: list[Finding], points: Mapping[str, Any]
) -> Estimate:
    low, high = np.quantile(samples, [0.05, 0.95])
    causes = UNTRUSTED_FLAGS.intersection(flag for flag, _ in flagged)
    if high > WIDE * low:
        flagged = [*flagged, NOT_IDENTIFIED.finding(low=low, high=high)]
    message = f"The modulus lies between {low:.3g} and {high:.3g} kPa with a probability of 90 %."
    least, most = YOUNG_KPA
    span = np.log(most / least)
    prior_sd = float(np.sqrt((most**2 - least**2) / (2 * span) - ((most - least) / span) ** 2))
    return Estimate(
        samples={"young_kpa": samples},
        prior_sd={"young_kpa": prior_sd},
        identifiability=NOT_TRUSTED if causes else message,
        prior=f"modulus {least:g} to {most:g} kPa, even in its logarithm; Poisson's ratio {press.poisson[0]:g} to "
        f"{press.poisson[1]:g}, even",
        trusted=not causes,
        flags=tuple(flag for flag, _ in flagged),
        notes=tuple(note for _, note in flagged),
        provenance={
            "notice": RESEARCH_USE_ONLY,
            "tsis": __version__,
            "method": "rigid indenter on a layer, with contact point, baseline and correlated residuals",
            "curve": {"name": curve.name, "points": int(curve.force_n.size), **dict(curve.recorded or {})},
            "indenter": asdict(press),
            **({"fit": dict(points)} if points else {}),
        },
    )


LEAST_REPEATS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatedModulus:
    """What several curves of one sample tell together.

    Attributes
    ----------
    count
        Number of curves with a modulus.
    young_kpa, interval_kpa
        Geometric mean of the moduli, kPa, and its 90 % interval.
    scatter
        Standard deviation of the logarithm of the modulus from curve to curve.
    """

    count: int
    young_kpa: float
    interval_kpa: tuple[float, float]
    scatter: float


def repeated_modulus(estimates: Sequence[Estimate]) -> RepeatedModulus | None:
    """Modulus of curves that are repeats of one sample; None where fewer than three tell one.

    Student's t of the scatter from curve to curve, and the median interval of one curve, which holds what all share.
    """
    known = [estimate for estimate in estimates if not estimate.withheld_reason("young_kpa")]
    if len(known) < LEAST_REPEATS:
        return None
    logs = np.log([estimate.mean["young_kpa"] for estimate in known])
    low, high = np.array([estimate.interval()["young_kpa"] for estimate in known]).T
    scatter, middle = float(logs.std(ddof=1)), float(logs.mean())
    quantile = float(scipy.stats.t.ppf(0.95, len(known) - 1))
    half = float(np.hypot(quantile * scatter / np.sqrt(len(known)), np.median(np.log(high / low)) / 2.0))
    return RepeatedModulus(
        count=len(known),
        young_kpa=float(np.exp(middle)),
        interval_kpa=(float(np.exp(middle - half)), float(np.exp(middle + half))),
        scatter=scatter,
    )
