"""What a press does to rings around the probe's axis, under any force that presses the whole face."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from tsis.inclusion.off_axis_rings import off_axis_profile

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.mechanics import FullContactParts, FullContactSurrogate, Surrogate

ANSWERS = 3  # of a press, a ring: pressure, displacement, slope
POINTS = 6  # of quadrature over a ring


class FaceProfiles(Protocol):
    """Anything that tells profiles over the face's radius."""

    @property
    def radius_mm(self) -> NDArray[np.float64]:
        """Radii from the axis to the edge, shape (n,)."""

    def interpolation(self, radius_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Matrix from profiles to values at ``radius_mm``."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingAnswers:
    """Mean pressure in kPa of each ring, then mean displacement of the face in mm, then its mean slope.

    A press is affine in its force: what one newton does, and under a dome also what its shape does at no force. Answers
    hold the first, then the second.

    Attributes
    ----------
    answer
        Surrogate of the answers.
    by_poisson
        Their derivative by Poisson's ratio of tissue and inclusion.
    by_spread
        Their derivative by the square of the inclusion's distance from the axis, per mm**2.
    is_domed
        Whether there is a second part.
    """

    answer: Surrogate
    by_poisson: Surrogate
    by_spread: Surrogate
    is_domed: bool

    @property
    def count(self) -> int:
        """Number of rings."""
        return int(self.answer.plain.shape[-1]) // (ANSWERS * (1 + self.is_domed))

    def on(
        self, tissue_young_kpa: float, thickness_mm: float, inclusions: NDArray[np.float64] | None
    ) -> NDArray[np.float64]:
        """Answers (n, answers) on tissue with inclusions (n, 3), or on plain tissue, n = 1."""
        return _evaluate(self.answer, tissue_young_kpa, thickness_mm, inclusions)

    def linear(
        self, tissue_young_kpa: float, thickness_mm: float, inclusions: NDArray[np.float64] | None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Derivatives of the answers by Poisson's ratio and by the spread."""
        by_poisson = _evaluate(self.by_poisson, tissue_young_kpa, thickness_mm, inclusions)
        if inclusions is None:
            return by_poisson, np.zeros_like(by_poisson)
        return by_poisson, _evaluate(self.by_spread, tissue_young_kpa, thickness_mm, inclusions)

    def stiffened(self, factor: float, answers: NDArray[np.float64]) -> NDArray[np.float64]:
        """Answers of a probe stiffer by ``factor`` on tissue stiffer by it: pressures and force share their unit."""
        per_newton = np.repeat([1.0, 1 / factor, 1 / factor], self.count)
        if not self.is_domed:
            return np.asarray(answers * per_newton)
        return np.asarray(answers * np.concatenate([per_newton, np.repeat([factor, 1.0, 1.0], self.count)]))

    def per_newton(self, answers: NDArray[np.float64]) -> NDArray[np.float64]:
        """What one more newton does, shape (n, 3 rings)."""
        return answers[..., : ANSWERS * self.count]

    def under(self, force_n: float, answers: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pressures, displacements and slopes under a force, shape (n, 3 rings)."""
        pressed = np.asarray(force_n * self.per_newton(answers))
        return pressed + answers[..., ANSWERS * self.count :] if self.is_domed else pressed


def _evaluate(
    surrogate: Surrogate, tissue_young_kpa: float, thickness_mm: float, inclusions: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    if inclusions is None:
        return surrogate.plain_at(tissue_young_kpa, thickness_mm)[None]
    return surrogate.at_tissue(tissue_young_kpa, thickness_mm)(*inclusions.T)


def ring_answers(
    surrogate: FullContactSurrogate,
    edges_mm: NDArray[np.float64],
    level: NDArray[np.float64],
    *,
    offset_mm: float = 0.0,
) -> RingAnswers:
    """Answers of the rings, weighted by the light's level in each.

    Parameters
    ----------
    surrogate
        Answers over the face's radius.
    edges_mm
        Boundaries of the rings.
    level
        Light that each ring sees.
    offset_mm
        How far the inclusion lies from the axis; see `off_axis_profile`.
    """
    means = ring_means(surrogate, edges_mm, level)
    around = off_axis_profile(surrogate.radius_mm, offset_mm)
    step = float(edges_mm[1])
    spread = (off_axis_profile(surrogate.radius_mm, float(np.hypot(offset_mm, step))) - around) / step**2
    centred = np.eye(len(surrogate.radius_mm))

    slopes = means @ np.gradient(centred, surrogate.radius_mm, axis=0)

    def mapped(
        parts: FullContactParts | FullContactSurrogate, plain: NDArray[np.float64], change: NDArray[np.float64]
    ) -> Surrogate:
        first, *others = [
            _mapped_apart(answer, rows @ plain, rows @ change)
            for part in (parts.unit, parts.shape)
            if part is not None
            for answer, rows in (
                (part.pressure_kpa, means),
                (part.face_displacement_mm, means),
                (part.face_displacement_mm, slopes),
            )
        ]
        return first.joined(*others)

    return RingAnswers(
        answer=mapped(surrogate, centred, around),
        by_poisson=mapped(surrogate.by_poisson, centred, around),
        by_spread=mapped(surrogate, np.zeros_like(centred), spread),
        is_domed=surrogate.shape is not None,
    )


def _mapped_apart(answer: Surrogate, plain: NDArray[np.float64], change: NDArray[np.float64]) -> Surrogate:
    """Plain tissue by one linear map and the change by an inclusion by another."""
    return replace(answer.mapped(change), plain=answer.plain @ plain.T)


def ring_means(
    surrogate: FaceProfiles, edges_mm: NDArray[np.float64], level: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Matrix from profiles to means over the rings' areas, shape (rings, radii of the profile).

    With the light's ``level`` in each ring the means are weighted by it, as those of grey over light are.
    """
    x, w = np.polynomial.legendre.leggauss(POINTS)
    half = np.diff(edges_mm) / 2
    radius = edges_mm[:-1, None] + half[:, None] * (x + 1)
    middle = edges_mm[:-1] + half
    weight = radius * w * (1.0 if level is None else np.interp(radius, middle, level))
    weight = weight / weight.sum(axis=1, keepdims=True)
    values = surrogate.interpolation(radius.ravel()).reshape(*radius.shape, -1)
    return np.asarray(np.einsum("rq,rqn->rn", weight, values))


def ring_correlation(edges_mm: NDArray[np.float64], grain_mm: float) -> NDArray[np.float64]:
    """How alike rings are in a pattern of variance one whose grains are ``grain_mm`` wide, shape (rings, rings).

    A pattern that is linear between independent values, wherever these lie, has a cubic B-spline as its covariance.
    """
    x, weight = np.polynomial.legendre.leggauss(POINTS)
    half = np.diff(edges_mm)[:, None] / 2
    radius = edges_mm[:-1, None] + half * (x + 1)
    share = radius * weight
    share /= share.sum(axis=1, keepdims=True)
    apart = np.abs(radius[:, :, None, None] - radius) / grain_mm
    spline = np.maximum(2 - apart, 0.0) ** 3 / 6 - 4 * np.maximum(1 - apart, 0.0) ** 3 / 6
    return np.asarray(np.einsum("ap,bq,apbq->ab", share, share, 1.5 * spline))
