"""Response of rings around the axis to a press.

An inclusion off the axis, approximately: the change in pressure and displacement shifts with the inclusion, with the
same shape, and grows by ``1 / (1 - (offset / R)**2)``; the press without inclusion stays. Both parts of a dome's press
shift equally. Under a rigid punch of radius R the pressure grows towards the rim as the root of this factor, which
applies to the stress at the inclusion and, by reciprocity, to the response of the face. ``benchmarks/off_axis.py``
prints the error against a flat probe in three dimensions.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics.mesh import hats
from tsis.model.calibration import LIGHT_TERMS, LightTerms
from tsis.model.require import require_number

if TYPE_CHECKING:
    from tsis.inclusion.prior import Floats
    from tsis.mechanics.surrogate.finite_correction import FiniteCorrection
    from tsis.mechanics.surrogate.full_contact import FullContactParts, FullContactSurrogate
    from tsis.mechanics.surrogate.polynomial import Surrogate


SHIFTED = 0.85  # of the face's radius; the change beyond belongs to the rim and does not shift
FARTHEST = 0.5  # of the face's radius; the benchmark prints the range of the approximation
DIRECTIONS = 48  # over half a circle; the other half is symmetric
OUTPUTS_PER_RING = 3  # pressure, displacement, slope
REMEMBERED = 16  # responses that are not evaluated again
POINTS = 6  # of quadrature over a ring


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingResponses:
    """Mean pressure in kPa of each ring, then mean displacement of the face in mm, then its mean slope.

    A press is affine in its force: the response per newton, then for a dome the response to its shape at zero force.
    """

    response: Surrogate  # surrogate of the responses
    by_poisson: Surrogate  # their derivative with respect to Poisson's ratio of tissue and inclusion
    # Their derivative with respect to the square of the inclusion's distance from the axis, per mm**2
    by_spread: Surrogate
    is_domed: bool  # whether there is a response to the shape
    _latest: dict[tuple[float, float, bytes], Floats] = field(default_factory=dict, repr=False)

    @property
    def count(self) -> int:
        """Number of rings."""
        return int(self.response.baseline.shape[-1]) // (OUTPUTS_PER_RING * (1 + self.is_domed))

    def on(self, tissue_young_kpa: float, thickness_mm: float, inclusions: Floats | None) -> Floats:
        """Responses (n, responses) for inclusions (n, 3), or for tissue without inclusion, n = 1.

        The latest are remembered: small and finite strain, and derivatives by the nuisances, ask for the same ones.
        """
        key = tissue_young_kpa, thickness_mm, b"" if inclusions is None else inclusions.tobytes()
        response = self._latest.get(key)
        if response is None:
            response = _evaluate(self.response, tissue_young_kpa, thickness_mm, inclusions)
            response.flags.writeable = False
            while len(self._latest) >= REMEMBERED:
                self._latest.pop(next(iter(self._latest)), None)
            self._latest[key] = response
        return response

    def linear(self, tissue_young_kpa: float, thickness_mm: float, inclusions: Floats | None) -> tuple[Floats, Floats]:
        """Derivatives of the responses with respect to Poisson's ratio and the spread."""
        by_poisson = _evaluate(self.by_poisson, tissue_young_kpa, thickness_mm, inclusions)
        if inclusions is None:
            return by_poisson, np.zeros_like(by_poisson)
        return by_poisson, _evaluate(self.by_spread, tissue_young_kpa, thickness_mm, inclusions)

    def stiffened(self, factor: float, responses: Floats) -> Floats:
        """Responses of probe and tissue stiffer by ``factor``: pressures scale with the force."""
        per_newton = np.repeat([1.0, 1 / factor, 1 / factor], self.count)
        if not self.is_domed:
            return np.asarray(responses * per_newton)
        return np.asarray(responses * np.concatenate([per_newton, np.repeat([factor, 1.0, 1.0], self.count)]))

    def per_newton(self, responses: Floats) -> Floats:
        """Response per newton, shape (n, 3 rings)."""
        return responses[..., : OUTPUTS_PER_RING * self.count]

    def under(self, force_n: float, responses: Floats) -> Floats:
        """Pressures, displacements and slopes under a force, shape (n, 3 rings)."""
        pressed = np.asarray(force_n * self.per_newton(responses))
        return pressed + responses[..., OUTPUTS_PER_RING * self.count :] if self.is_domed else pressed


def _evaluate(surrogate: Surrogate, tissue_young_kpa: float, thickness_mm: float, inclusions: Floats | None) -> Floats:
    if inclusions is None:
        return surrogate.baseline_at(tissue_young_kpa, thickness_mm)[None]
    return surrogate.at_tissue(tissue_young_kpa, thickness_mm)(*inclusions.T)


def ring_responses(
    surrogate: FullContactSurrogate, edges_mm: Floats, level: Floats, *, offset_mm: float = 0.0
) -> RingResponses:
    """Responses of the rings, weighted by the light of each ring.

    Parameters
    ----------
    surrogate
        Responses over the face's radius.
    edges_mm
        Boundaries of the rings.
    level
        Light of each ring.
    offset_mm
        Distance of the inclusion from the axis; see `off_axis_profile`.
    """
    means = ring_means(surrogate.radius_mm, edges_mm, level)
    around = off_axis_profile(surrogate.radius_mm, offset_mm)
    step = float(edges_mm[1])
    spread = (off_axis_profile(surrogate.radius_mm, float(np.hypot(offset_mm, step))) - around) / step**2
    centred = np.eye(len(surrogate.radius_mm))

    slopes = means @ np.gradient(centred, surrogate.radius_mm, axis=0)

    def mapped(parts: FullContactParts | FullContactSurrogate, reference: Floats, change: Floats) -> Surrogate:
        first, *others = [
            _mapped_separately(response, rows @ reference, rows @ change)
            for part in (parts.unit, parts.shape)
            if part is not None
            for response, rows in (
                (part.pressure_kpa, means),
                (part.face_displacement_mm, means),
                (part.face_displacement_mm, slopes),
            )
        ]
        return first.joined(*others)

    return RingResponses(
        response=mapped(surrogate, centred, around),
        by_poisson=mapped(surrogate.by_poisson, centred, around),
        by_spread=mapped(surrogate, np.zeros_like(centred), spread),
        is_domed=surrogate.shape is not None,
    )


def _mapped_separately(surrogate: Surrogate, reference: Floats, change: Floats) -> Surrogate:
    """Apply one linear map to the response without inclusion, and another to the change by an inclusion."""
    return replace(surrogate.mapped(change), baseline=surrogate.baseline @ reference.T)


def ring_correction(
    correction: FiniteCorrection, edges_mm: Floats, level: Floats, *, offset_mm: float = 0.0
) -> FiniteCorrection:
    """Correction by finite strain of the rings' pressures, displacements and slopes; see `ring_responses`."""
    radius = correction.radius_mm
    means = ring_means(radius, edges_mm, level)
    slopes = means @ np.gradient(np.eye(len(radius)), radius, axis=0)
    nothing = np.zeros_like(means)
    rows = np.block([[means, nothing], [nothing, means], [nothing, slopes]])
    around = np.kron(np.eye(2), off_axis_profile(radius, offset_mm))
    return correction.mapped(rows, rows @ around)


def ring_means(radius_mm: Floats, edges_mm: Floats, level: Floats | None = None) -> Floats:
    """Matrix from profiles over ``radius_mm``, linear between them, to means over the rings' areas; (rings, radii).

    The light's ``level`` in each ring weights the means, as for grey over light.
    """
    radius, area = _ring_points(edges_mm)
    middle = edges_mm[:-1] + np.diff(edges_mm) / 2
    weight = area * (1.0 if level is None else np.interp(radius, middle, level))
    weight = weight / weight.sum(axis=1, keepdims=True)
    values = hats(radius_mm, radius.ravel()).reshape(*radius.shape, -1)
    return np.asarray(np.einsum("rq,rqn->rn", weight, values))


def ring_correlation(edges_mm: Floats, grain_mm: float) -> Floats:
    """Covariance between rings of a pattern of unit variance with grains of ``grain_mm``, shape (rings, rings).

    A pattern that interpolates independent values linearly has a cubic B-spline as its covariance.
    """
    radius, area = _ring_points(edges_mm)
    fraction = area / area.sum(axis=1, keepdims=True)
    difference = np.abs(radius[:, :, None, None] - radius) / grain_mm
    spline = np.maximum(2 - difference, 0.0) ** 3 / 6 - 4 * np.maximum(1 - difference, 0.0) ** 3 / 6
    return np.asarray(np.einsum("ap,bq,apbq->ab", fraction, fraction, 1.5 * spline))


def _ring_points(edges_mm: Floats) -> tuple[Floats, Floats]:
    """Points of quadrature over each ring, and their areas up to a factor a ring; shape (rings, points)."""
    x, weight = np.polynomial.legendre.leggauss(POINTS)
    radius = edges_mm[:-1, None] + np.diff(edges_mm)[:, None] / 2 * (x + 1)
    return radius, radius * weight


TERMS = 3  # of the emphasis along the radius
DARKEST = 1e-3  # least light on a tilted face over that on the level face


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShadingUncertainty:
    """Independent errors of the logarithm of the light on a dented face, each of unit standard deviation.

    Error k is ``by_gain[k] + by_displacement[:, k] u + by_bend[:, k] u**2 + by_slope[:, k] u' - by_force[k] F -
    by_square[k] p**2`` for a face that is displaced by u under the force F, where the pressure is p.

    Attributes
    ----------
    by_displacement, by_bend
        Per mm and per mm**2, shape (rings, k).
    by_slope
        Shape (rings, k).
    by_force
        Per newton, shape (k,): light that contact extracts from the whole face.
    by_square
        Per kPa**2, shape (k,): saturation of the contact.
    by_gain
        Shape (k,): the gain, as far as it was measured together with the light.
    """

    by_displacement: Floats
    by_bend: Floats
    by_slope: Floats
    by_force: Floats
    by_square: Floats
    by_gain: Floats

    @classmethod
    def none(cls) -> ShadingUncertainty:
        """No errors beside the emphasis of a `RingShading`."""
        return cls.of_terms(np.zeros((LIGHT_TERMS, 0)), 1)

    @classmethod
    def of_terms(cls, factor: Floats, rings: int) -> ShadingUncertainty:
        """Errors whose coefficients, as in `LightTerms`, have the covariance ``factor @ factor.T``."""
        terms = LightTerms.of(factor, rings)
        return cls(
            by_displacement=terms.growth_per_mm,
            by_bend=terms.bend_per_mm2,
            by_slope=terms.flux,
            by_force=terms.loss_per_n,
            by_square=terms.square_per_kpa2,
            by_gain=terms.log_gain,
        )

    @property
    def count(self) -> int:
        """Number of errors."""
        return len(self.by_force)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingShading:
    """Factor ``(exp(growth u + bend u**2) (1 + flux u'))^(1 + emphasis)`` of each ring's light, for a round press.

    The face is displaced by u. The emphasis is the relative error of the factor's logarithm, a parabola along the
    radius, because the error of a light map varies over the face.

    Attributes
    ----------
    growth_per_mm
        Growth of the light with the displacement, weighted by the light, shape (rings,).
    bend_per_mm2
        Second order of its logarithm, weighted by the light, shape (rings,).
    flux
        Outward power over the power into the face, weighted by the light, shape (rings,).
    uncertainty
        Further errors of the factor's logarithm.
    """

    growth_per_mm: Floats
    bend_per_mm2: Floats
    flux: Floats
    uncertainty: ShadingUncertainty = field(default_factory=ShadingUncertainty.none)

    def __call__(
        self, displacement_mm: Floats, slope: Floats, emphasis: Floats, errors: Floats | None = None
    ) -> ShadingFactor:
        """Evaluate displacements and slopes (n, rings).

        ``emphasis`` are the Legendre coefficients (`TERMS`,) of the emphasis, and ``errors`` (k,) those of the
        uncertainty; None is zero. The part of the errors by the force is not included.
        """
        parabolas, power = self._power(emphasis)
        tilt, logarithm = self._logarithm(displacement_mm, slope)
        unknown = self.uncertainty
        none = np.zeros(unknown.count) if errors is None else errors
        grows, bends, tilts = (part @ none for part in (unknown.by_displacement, unknown.by_bend, unknown.by_slope))
        factor = np.exp(power * logarithm + (grows + bends * displacement_mm) * displacement_mm + tilts * slope)
        growth = self.growth_per_mm + 2 * self.bend_per_mm2 * displacement_mm
        by_errors = displacement_mm[..., None] * unknown.by_displacement + slope[..., None] * unknown.by_slope
        by_errors += displacement_mm[..., None] ** 2 * unknown.by_bend
        return ShadingFactor(
            factor=factor,
            by_displacement=factor * (power * growth + grows + 2 * bends * displacement_mm),
            by_slope=factor * (np.where(tilt > DARKEST, power * self.flux / tilt, 0.0) + tilts),
            by_emphasis=(factor * logarithm)[..., None] * parabolas,
            by_errors=factor[..., None] * by_errors,
        )

    def factor(self, displacement_mm: Floats, slope: Floats, emphasis: Floats, errors: Floats | None = None) -> Floats:
        """The factor alone."""
        logarithm = self._power(emphasis)[1] * self._logarithm(displacement_mm, slope)[1]
        if errors is not None and errors.any():
            unknown = self.uncertainty
            grows = unknown.by_displacement @ errors + (unknown.by_bend @ errors) * displacement_mm
            logarithm += grows * displacement_mm + (unknown.by_slope @ errors) * slope
        return np.asarray(np.exp(logarithm))

    def _power(self, emphasis: Floats) -> tuple[Floats, Floats]:
        """Parabolas along the radius, (rings, terms), and one plus the emphasis, (rings,)."""
        parabolas = _legendre(len(self.flux), TERMS)
        return parabolas, np.asarray(1 + parabolas @ emphasis)

    def _logarithm(self, displacement_mm: Floats, slope: Floats) -> tuple[Floats, Floats]:
        """Light on the tilted over that on the level face, and the log of the factor without emphasis."""
        tilt = np.maximum(1 + self.flux * slope, DARKEST)
        grows = (self.growth_per_mm + self.bend_per_mm2 * displacement_mm) * displacement_mm
        return tilt, grows + np.log(tilt)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShadingFactor:
    """The factor and its derivatives by displacement and slope, (n, rings), emphasis and errors, (n, rings, terms)."""

    factor: Floats
    by_displacement: Floats
    by_slope: Floats
    by_emphasis: Floats
    by_errors: Floats


@cache
def _legendre(rings: int, terms: int) -> Floats:
    """Legendre polynomials along the radius, shape (rings, terms)."""
    values = np.asarray(np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, rings), terms - 1), dtype=float)
    values.flags.writeable = False
    return values


def off_axis_profile(radius_mm: Floats, offset_mm: float) -> Floats:
    """Matrix from the change by an inclusion on the axis to the mean around the axis at an offset of the inclusion.

    It applies to profiles of pressure and displacement; the radial differences of a displacement's result are the means
    of its radial slope. The shifted profile is constant beyond `SHIFTED` of the face's radius, and the rest does not
    shift: the pressure is singular at the rim.

    Parameters
    ----------
    radius_mm
        Radii of the profile, ascending from 0 to the face's radius, shape (n,).
    offset_mm
        Distance of the inclusion's centre from the axis, in [0, `FARTHEST` of the face's radius].

    Returns
    -------
    Matrix of shape (n, n), the identity at offset 0 and even in the offset.

    Raises
    ------
    InputError
        When the offset lies outside its range.

    Examples
    --------
    >>> radius = np.linspace(0.0, 12.0, 121)
    >>> level = off_axis_profile(radius, 3.0) @ np.ones(121)
    >>> round(float(level[0]), 4)  # what is level stays level and grows by 1 / (1 - (3 / 12)**2)
    1.0667
    """
    edge = float(radius_mm[-1])
    require_number("offset_mm", offset_mm, 0.0, FARTHEST * edge, hint="millimetres, at most half of the face's radius")
    angle = np.pi * (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
    away = np.hypot(radius_mm[:, None] - offset_mm * np.cos(angle), offset_mm * np.sin(angle))
    moving = hats(radius_mm, np.minimum(radius_mm, SHIFTED * edge))
    shifted = hats(radius_mm, np.minimum(away, SHIFTED * edge).ravel()).reshape(*away.shape, -1).mean(axis=1)
    growth = 1 / (1 - (offset_mm / edge) ** 2)
    return np.asarray(np.eye(len(radius_mm)) - moving + growth * shifted)
