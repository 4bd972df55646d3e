"""Young's modulus of an object from contacts of a gel sensor.

The logarithms of force and dent at a measured contact radius are tabulated over the body's fraction of the compliance,
and compared with those measured. Gel, radius and errors of the readings are nuisances.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.catalog.sensors import load_sensor
from tsis.compiled import one_blas_thread
from tsis.errors import InputError
from tsis.hardness.contacts import ObjectGeometry, as_geometry, as_touch_readings, grouped_presses
from tsis.hardness.flags import (
    CONTACT_TOO_DEEP,
    CONTACT_TOO_WIDE,
    CONTACTS_BEYOND,
    CONTACTS_LEFT_OUT,
    CONTACTS_OF_RELEASE,
    DEEPEST_CONTACT,
    FLAT_OBJECT,
    FORCE_AND_DEPTH_UNKNOWN,
    FORCE_AND_RADIUS_UNKNOWN,
    GEL_MODEL_DOES_NOT_FIT,
    GEL_NOT_FLAT,
    GEL_ONE_FORCE,
    GEL_RADIUS_UNKNOWN,
    SAME_FORCE,
    UNTRUSTED_FLAGS,
    WIDEST_CONTACT,
    modulus_findings,
)
from tsis.hardness.posterior import HardnessPrior, modulus_samples
from tsis.mechanics.gel.contact import layer_contact
from tsis.model.estimate import IMPROBABLE, NOT_TRUSTED, Estimate, probability_bound
from tsis.model.gel_sensor import GelSensor, gel_sensor_of_probe
from tsis.model.probe import Probe
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path
    from typing import Literal

    from numpy.typing import NDArray

    from tsis.hardness.contacts import TouchReading
    from tsis.hardness.posterior import RadiusPrior
    from tsis.model.flag import Finding
    from tsis.model.gel_sensor import BoundedValue

    Floats = NDArray[np.float64]

# Logarithms of force and dent over their small-strain values by dent/thickness, x² (1 - s), x⁶, x² with x the contact's
# radius over the body's and s the body's fraction of the compliance. Fitted to neo-Hookean bodies on neo-Hookean gels:
# 46 presses of spheres (tsis.mechanics.finite_strain), 88 of cylinders, x 0.2 to 0.65 (benchmarks/soft_cylinder.py).
FINITE_FORCE = {"sphere": (0.42, 0.055, 0.156, -0.066), "cylinder": (1.224, -0.44, 0.451, 0.189)}
FINITE_DENT = {"sphere": (-0.052, 0.289, 0.1045, -0.021), "cylinder": (0.384, -0.274, 0.233, 0.218)}
FORCE_MODEL_SD, DENT_MODEL_SD = 0.015, 0.02  # relative; RMS of those fits 0.011 and 0.016; of cylinders 0.011, 0.010
CYLINDER_MODEL_SD = 0.06  # times x², beside them: cylinders left out of the fit err by 0.03 at x = 0.63
SOFTNESS = np.concatenate([[0.0], 0.5 - 0.5 * np.cos(np.pi * (np.arange(20) + 0.5) / 20), [1.0 - 1e-9]])
STEP = 0.02  # of the logarithm of the contact radius, for slopes
DEPTH_RADII = 40  # contact radii of the table that is inverted where only the depth is known


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactCurves:
    """Logarithms of force and dent over `SOFTNESS`, and their slopes with the logarithm of the contact radius.

    ``log_force`` is that of force in N times the combined compliance in 1/kPa.
    """

    log_force: Floats
    log_dent: Floats
    force_slope: Floats
    dent_slope: Floats


def curves_at_radius(
    contact_mm: float, body: Literal["sphere", "cylinder"], radius_mm: float, thickness_mm: float, poisson: float
) -> ContactCurves:
    """The curves of a contact whose radius was measured."""
    steps = contact_mm * np.exp(STEP * np.array([-1.0, 0.0, 1.0]))[:, None]
    log_force, log_dent = _logarithms(steps, body, radius_mm, thickness_mm, poisson)
    return ContactCurves(
        log_force=log_force[1],
        log_dent=log_dent[1],
        force_slope=(log_force[2] - log_force[0]) / (2 * STEP),
        dent_slope=(log_dent[2] - log_dent[0]) / (2 * STEP),
    )


def curves_at_depth(
    depth_mm: float, body: Literal["sphere", "cylinder"], radius_mm: float, thickness_mm: float, poisson: float
) -> tuple[Floats, Floats]:
    """``log_force`` of a contact of which the dent was measured, and its slope with the logarithm of the dent."""
    radii = np.geomspace(0.01 * radius_mm, min(0.95 * radius_mm, 9.0 * thickness_mm), DEPTH_RADII)[:, None]
    log_force, log_dent = _logarithms(radii, body, radius_mm, thickness_mm, poisson)
    log_depth = np.log(depth_mm) + np.array([-STEP, 0.0, STEP])
    interpolated = np.array([np.interp(log_depth, log_dent[:, k], log_force[:, k]) for k in range(len(SOFTNESS))]).T
    return interpolated[1], (interpolated[2] - interpolated[0]) / (2 * STEP)


def _logarithms(
    contact_mm: Floats, body: Literal["sphere", "cylinder"], radius_mm: float, thickness_mm: float, poisson: float
) -> tuple[Floats, Floats]:
    """Logarithms of force times compliance and of the dent, shape (contacts, softnesses), at finite strain."""
    small = layer_contact(
        contact_mm,
        body=body,
        radius_mm=radius_mm,
        body_compliance=SOFTNESS,
        gel_compliance=1.0 - SOFTNESS,
        thickness_mm=thickness_mm,
        poisson=poisson,
    )
    log_force, log_dent = np.log(small.force / 1e3), np.log(small.dent_mm)
    x = contact_mm / radius_mm
    strains = np.broadcast_arrays(small.dent_mm / thickness_mm, x**2 * (1 - SOFTNESS), x**6, x**2)
    added = [
        sum(c * part for c, part in zip(fit, strains, strict=True)) for fit in (FINITE_FORCE[body], FINITE_DENT[body])
    ]
    return np.asarray(log_force + added[0]), np.asarray(log_dent + added[1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TouchedBody:
    """Readings on one body."""

    readings: tuple[TouchReading, ...]
    shape: Literal["sphere", "cylinder"]
    radius: RadiusPrior
    length_mm: float = 1.0  # of a cylinder, over which its force acts
    rigid: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredTerm:
    """One measured logarithm, and its model over `SOFTNESS`."""

    reading: int
    press: float
    observed: float
    curve: Floats
    slope: Floats  # with the logarithm of the contact radius or dent that was read
    sd: float
    reading_sd: float
    is_force: bool
    by_zero: float = 0.0  # how it grows with the force's zero, 1/N
    by_lag: float = 0.0  # and with the time by which the force lags behind the image, 1/s


def measured_terms(body: TouchedBody, radius: float, thickness: float, poisson: float) -> Iterator[MeasuredTerm]:
    """The measured logarithms, for a radius and a thickness in mm and Poisson's ratio of the gel."""
    length = np.log(body.length_mm) if body.shape == "cylinder" else 0.0
    for index, reading in enumerate(body.readings):
        press = -1.0 - index if reading.press is None else reading.press
        x = (reading.radius_mm or 0.0) / radius
        model = CYLINDER_MODEL_SD * x**2 if body.shape == "cylinder" else 0.0
        if reading.radius_mm is not None:
            curves = curves_at_radius(reading.radius_mm, body.shape, radius, thickness, poisson)
            assert reading.radius_sd_mm is not None
            own_radius = reading.radius_sd_mm / reading.radius_mm
            if reading.force_n is not None and reading.force_sd_n is not None:
                yield MeasuredTerm(
                    reading=index,
                    press=press,
                    observed=float(np.log(reading.force_n)) - length,
                    curve=curves.log_force,
                    slope=curves.force_slope,
                    sd=float(np.hypot(reading.force_sd_n / reading.force_n, np.hypot(FORCE_MODEL_SD, model))),
                    reading_sd=own_radius,
                    is_force=True,
                    by_zero=1 / reading.force_n,
                    by_lag=(reading.force_rate_n_s or 0.0) / reading.force_n,
                )
            if reading.depth_mm is not None and reading.depth_sd_mm is not None:
                yield MeasuredTerm(
                    reading=index,
                    press=press,
                    observed=float(np.log(reading.depth_mm)),
                    curve=curves.log_dent,
                    slope=curves.dent_slope,
                    sd=float(np.hypot(reading.depth_sd_mm / reading.depth_mm, np.hypot(DENT_MODEL_SD, model))),
                    reading_sd=own_radius,
                    is_force=False,
                )
        elif reading.force_n is not None and reading.depth_mm is not None:
            assert reading.depth_sd_mm is not None
            assert reading.force_sd_n is not None
            log_force, slope = curves_at_depth(reading.depth_mm, body.shape, radius, thickness, poisson)
            yield MeasuredTerm(
                reading=index,
                press=press,
                observed=float(np.log(reading.force_n)) - length,
                curve=log_force,
                slope=slope,
                sd=float(np.hypot(reading.force_sd_n / reading.force_n, FORCE_MODEL_SD)),
                reading_sd=float(np.hypot(reading.depth_sd_mm / reading.depth_mm, DENT_MODEL_SD)),
                is_force=True,
                by_zero=1 / reading.force_n,
                by_lag=(reading.force_rate_n_s or 0.0) / reading.force_n,
            )


def limit_nodes(limits: tuple[float, float], count: int, *, logarithmic: bool = False) -> list[tuple[float, float]]:
    """Values between limits and their weights, which add up to one."""
    low, high = (np.log(limits) if logarithmic else np.asarray(limits)).tolist()
    if low == high:
        return [(limits[0], 1.0)]
    place, weight = np.polynomial.legendre.leggauss(count)
    values = low + (high - low) * (place + 1) / 2
    return list(zip((np.exp(values) if logarithmic else values).tolist(), (weight / 2).tolist(), strict=True))


GEL_MODULI, RATIOS, THICKNESSES = 15, 5, 3  # nodes over intervals that leave room


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchErrors:
    """Errors beyond those of the readings, relative standard deviations of contact radius and depth.

    ``press`` is that from press to press, ``scale`` common to all readings of the sensor. ``force_zero_n`` is that of
    the force's zero in N, and ``lag_s`` that of the time in s between force and image, one for all contacts of a body.
    """

    press: float
    scale: float
    force_zero_n: float = 0.0
    lag_s: float = 0.0


class TouchLikelihood:
    """Normal errors of the logarithms of forces and dents at the measured contact radii.

    Gel modulus, thickness and Poisson's ratio lie anywhere within their limits; they, the radius of the object and its
    Poisson's ratio are integrated out on nodes. The objects may be joined by rigid bodies, which tell the gel.
    """

    def __init__(
        self,
        bodies: Sequence[TouchedBody],
        *,
        young_kpa: BoundedValue,
        thickness_mm: BoundedValue,
        poisson: BoundedValue,
        object_poisson: tuple[float, float],
        errors: TouchErrors,
    ) -> None:
        self._bodies, self._errors = tuple(bodies), errors
        self._gel_kpa = limit_nodes(young_kpa.limits, GEL_MODULI, logarithmic=True)
        self._layers = list(product(limit_nodes(thickness_mm.limits, THICKNESSES), limit_nodes(poisson.limits, RATIOS)))
        self._ratios = limit_nodes(object_poisson, 3)
        radii = [
            np.exp(body.radius.nodes()[1] - scipy.special.logsumexp(body.radius.nodes()[1])) for body in self._bodies
        ]
        self._radius_nodes = [
            list(zip(body.radius.nodes()[0], weight, strict=True))
            for body, weight in zip(self._bodies, radii, strict=True)
        ]
        self.residual_count = sum(
            (reading.force_n is not None) + (reading.radius_mm is not None and reading.depth_mm is not None)
            for body in self._bodies
            for reading in body.readings
        )

    def __call__(self, object_kpa: Floats) -> tuple[Floats, float]:
        """Log likelihood of moduli of the object, shape (n,), and the least squared misfit."""
        parts, misfits = [], []
        for (thickness, thickness_weight), (poisson, poisson_weight) in self._layers:
            part, misfit = self._over_gel(object_kpa, thickness, poisson)
            parts.append(part + np.log(thickness_weight * poisson_weight))
            misfits.append(misfit)
        return np.asarray(scipy.special.logsumexp(parts, axis=0)), float(min(misfits))

    def _over_gel(self, object_kpa: Floats, thickness: float, poisson: float) -> tuple[Floats, float]:
        gel = np.array([(1 - poisson**2) / young for young, _ in self._gel_kpa])
        gel_weight = np.log([weight for _, weight in self._gel_kpa])
        total, least = np.zeros((len(object_kpa), len(gel))), 0.0
        for body, nodes in zip(self._bodies, self._radius_nodes, strict=True):
            log_body, misfit = self._of_body(body, nodes, object_kpa, gel, thickness, poisson)
            total, least = total + log_body, least + misfit
        return np.asarray(scipy.special.logsumexp(total + gel_weight, axis=1)), least

    def _of_body(
        self,
        body: TouchedBody,
        nodes: Sequence[tuple[float, float]],
        object_kpa: Floats,
        gel: Floats,
        thickness: float,
        poisson: float,
    ) -> tuple[Floats, float]:
        """Log likelihood of one body's readings, shape (moduli, gels), over its radius and Poisson's ratio."""
        parts, least = [], np.inf
        for radius, radius_weight in nodes:
            terms = list(measured_terms(body, radius, thickness, poisson))
            for ratio, ratio_weight in self._ratios:
                own = np.zeros_like(object_kpa) if body.rigid else (1 - ratio**2) / object_kpa
                softness = own[:, None] / (own[:, None] + gel)
                log_compliance = np.log(own[:, None] + gel)
                value, misfit = self._gaussian(body, terms, softness, log_compliance)
                parts.append(value + np.log(radius_weight * ratio_weight))
                least = min(least, misfit)
        return np.asarray(scipy.special.logsumexp(parts, axis=0)), least

    def _gaussian(
        self, body: TouchedBody, terms: Sequence[MeasuredTerm], softness: Floats, log_compliance: Floats
    ) -> tuple[Floats, float]:
        """Log likelihood by normal errors, and the least misfit; the covariance is that at the best softness."""
        if not terms:
            return np.zeros_like(softness), 0.0
        flat = softness.ravel()
        residuals = np.stack(
            [
                term.observed
                - np.interp(flat, SOFTNESS, term.curve)
                + (log_compliance.ravel() if term.is_force else 0.0)
                for term in terms
            ]
        )
        spread = np.array(
            [
                np.hypot(
                    np.linalg.norm(
                        [term.sd, self._errors.force_zero_n * term.by_zero, self._errors.lag_s * term.by_lag]
                    ),
                    3.0 * np.hypot(term.reading_sd, self._errors.press),
                )
                for term in terms
            ]
        )
        best = flat[int(np.argmin(((residuals / spread[:, None]) ** 2).sum(axis=0)))]
        factor = np.linalg.cholesky(self._covariance(terms, float(best)))
        white = np.linalg.solve(factor, residuals)
        misfit = (white**2).sum(axis=0)
        value = -misfit / 2 - np.log(np.diagonal(factor)).sum()
        return value.reshape(softness.shape), float(misfit.min())

    def _covariance(self, terms: Sequence[MeasuredTerm], softness: float) -> Floats:
        slopes = np.array([np.interp(softness, SOFTNESS, term.slope) for term in terms])
        press = np.array([term.press for term in terms])
        same = press[:, None] == press
        number = np.array([term.reading for term in terms])
        readings = np.outer(*2 * ([term.reading_sd for term in terms],)) * (number[:, None] == number)
        common = np.outer(slopes, slopes) * (readings + self._errors.press**2 * same + self._errors.scale**2)
        zero = self._errors.force_zero_n * np.array([term.by_zero for term in terms])  # log(F - zero), first order
        lag = self._errors.lag_s * np.array([term.by_lag for term in terms])
        return np.asarray(common + np.outer(zero, zero) + np.outer(lag, lag) + np.diag([term.sd**2 for term in terms]))


GEL_PRIOR = HardnessPrior(young_kpa=(2.0, 10_000.0), poisson=(0.45, 0.495))
FORCE_ZERO_SD_N = 0.03  # of a gauge's zero: within 0.05 N nine times of ten
LAG_SD_S = 0.1  # of the time between gauge and camera of one computer
PRESS_SD = 0.02  # relative standard deviation of a contact radius from press to press


def estimate_from_contacts(
    contacts: Any,
    *,
    sensor: GelSensor | Probe | str | Path,
    force: float | Sequence[float] | None = None,
    geometry: ObjectGeometry | Mapping[str, Any] | str | float = "sphere",
    reference: Any = None,
    reference_radius_mm: float | None = None,
    prior: HardnessPrior | None = None,
    sequence: bool = False,
    press_sd: float = PRESS_SD,
    force_zero_sd_n: float = FORCE_ZERO_SD_N,
    lag_sd_s: float = LAG_SD_S,
) -> Estimate:
    """Estimate Young's modulus of an object from its contacts with a gel sensor.

    The object is a half-space with a round face, the gel a layer bonded to a rigid backing, corrected for finite
    strain. A contact radius and a force give the combined compliance; a contact radius and the depth of the dent give
    the object's part of it without a force. The gel's modulus, thickness and Poisson's ratio lie anywhere within the
    sensor's limits; a modulus without limits that a label states is widened (`GelSensor.believed_young_kpa`). An error
    of the gel's modulus passes into the object's one to one; an object that is much stiffer than the gel adds little
    compliance, which widens its interval by ``1/(1 - s)``, s the gel's part.

    Parameters
    ----------
    contacts
        Contacts with ``force_n``, ``radius_mm`` or ``area_mm2``, ``depth_mm`` and their standard deviations: mappings,
        results of `tsis.imaging.gel_contact.contacts`, a table of pandas, or the path of a CSV file. Contacts with
        ``good`` false are left out. The contacts of both fingers of a gripper are given together.
    sensor
        A gel sensor, its name in the catalog, its file, or a probe.
    force
        Force in N of all contacts or of each; None where the contacts state theirs, or it is unknown.
    geometry
        The object: an `ObjectGeometry` or its fields, ``"sphere"``, or the radius of a sphere in mm.
    reference
        Contacts with a rigid ball, such as a golf or bearing ball: they tell the gel's modulus.
    reference_radius_mm
        Radius of that ball.
    prior
        Ranges of modulus and Poisson's ratio; 2 kPa to 10 MPa by default, even in the logarithm.
    sequence
        Whether the contacts are frames of one press in the order of time: its loading part is used, and its frames
        share the error from press to press. Contacts with numbers in ``press`` are such sequences, one a number.
    press_sd
        Relative standard deviation of a contact radius from press to press, in [0, 0.5]; a third of that of the force
        at one radius.
    force_zero_sd_n
        Standard deviation of the force's zero, N, common to all contacts, in [0, 10]: contacts of different forces tell
        it, a few of one force widen the interval. 0 for a gauge that was tared.
    lag_sd_s
        Standard deviation of the time by which the force lags behind the image, s, in [0, 5], where contacts of a press
        have times (``time_s``) or rates (``force_rate_n_s``); the rise of a press tells it.

    Returns
    -------
    Estimate
        Of ``young_kpa``. Its mean is withheld, with the reason, for a flat object and for an unknown radius.

    Raises
    ------
    InputError
        When there is no usable contact, or a value is out of range.
    FileInputError
        When a file is missing or damaged.

    Examples
    --------
    A ball of 10 mm radius and 100 kPa on a gel of 150 kPa:

    >>> from tsis.model.gel_sensor import BoundedValue, GelSensor
    >>> gel = GelSensor(name="gel", width_mm=40.0, height_mm=40.0, thickness_mm=BoundedValue(value=20.0),
    ...     young_kpa=BoundedValue(value=150.0), poisson=BoundedValue(value=0.49), mm_per_pixel=(0.1, 0.1))
    >>> contacts = [{"force_n": 0.5, "radius_mm": 3.63}, {"force_n": 1.0, "radius_mm": 4.55}]
    >>> result = estimate_from_contacts(contacts, sensor=gel, geometry=10.0)
    >>> low, high = result.interval(0.9)["young_kpa"]
    >>> low < 100 < high
    True
    """
    gel = _as_sensor(sensor)
    prior = GEL_PRIOR if prior is None else prior
    require_type("prior", prior, HardnessPrior)
    require_number("press_sd", press_sd, 0.0, 0.5, hint="a fraction")
    require_number("force_zero_sd_n", force_zero_sd_n, 0.0, 10.0, hint="newtons")
    readings, left_out, stated_mm = as_touch_readings(contacts, force=force)
    shape = as_geometry(geometry, stated_mm)
    given = len(readings)
    readings = grouped_presses(readings, sequence=sequence)
    released = given - len(readings)
    # The beginning of one press is the part that a delay of the gauge changes most: it does not stand for the whole.
    held = () if sequence else tuple(reading for reading in readings if not _beyond_model(reading, shape, gel))
    beyond, readings = (len(readings) - len(held), held) if held else (0, readings)
    bodies = [_body(readings, shape)]
    if reference is not None:
        ball, not_good = _rigid_ball(reference, reference_radius_mm)
        bodies.append(ball)
        left_out = (*left_out, *not_good)
    elif reference_radius_mm is not None:
        raise InputError("reference must be given with reference_radius_mm: contacts of that rigid ball; got none")
    require_number("lag_sd_s", lag_sd_s, 0.0, 5.0, hint="seconds")
    errors = TouchErrors(press=press_sd, scale=gel.scale_uncertainty, force_zero_n=force_zero_sd_n, lag_s=lag_sd_s)
    reasons = unknowable(readings, shape)
    samples, misfit, count = _explored(bodies, gel, prior, errors, flat=shape.shape == "flat" or bool(reasons))
    flagged = [
        *reasons,
        *([CONTACTS_OF_RELEASE.finding(released=released)] if released else []),
        *([CONTACTS_BEYOND.finding(beyond=beyond)] if beyond else []),
        *contact_findings(readings, left_out, shape, gel),
        *(() if reasons else modulus_findings(samples, prior)),
        *misfit_findings(misfit, count),
    ]
    causes = UNTRUSTED_FLAGS.intersection(flag for flag, _ in flagged)
    low, high = np.quantile(samples, [0.05, 0.95])
    message = f"The modulus lies between {low:.3g} and {high:.3g} kPa with a probability of 90 %."
    return Estimate(
        samples={"young_kpa": samples},
        prior_sd={"young_kpa": prior.young_sd_kpa},
        identifiability=NOT_TRUSTED if causes else reasons[0][1] if reasons else message,
        prior=str(prior),
        trusted=not causes,
        flags=tuple(flag for flag, _ in flagged),
        notes=tuple(note for _, note in flagged),
        provenance={
            "notice": RESEARCH_USE_ONLY,
            "tsis": __version__,
            "method": "contact radius, force and dent of a round body on a bonded gel layer, with finite strain",
            "sensor": {"name": gel.name}
            | {name: getattr(gel, name).limits for name in ("thickness_mm", "poisson")}
            | {"young_kpa": gel.believed_young_kpa.limits},
            "geometry": asdict(shape),
            "prior": asdict(prior),
            "errors": asdict(errors),
            "contacts": [asdict(reading) for reading in readings],
            "reference": [asdict(reading) for body in bodies[1:] for reading in body.readings],
        },
    )


def _as_sensor(sensor: GelSensor | Probe | str | Path) -> GelSensor:
    if isinstance(sensor, GelSensor):
        return sensor
    return gel_sensor_of_probe(sensor) if isinstance(sensor, Probe) else load_sensor(sensor)


def _body(readings: tuple[TouchReading, ...], shape: ObjectGeometry) -> TouchedBody:
    return TouchedBody(
        readings=readings,
        shape="cylinder" if shape.shape == "cylinder" else "sphere",
        radius=shape.radius_prior(),
        length_mm=shape.length_mm or 1.0,
    )


def _rigid_ball(reference: Any, radius_mm: float | None) -> tuple[TouchedBody, tuple[str, ...]]:
    """The ball with its contacts, and the names of those that are not good."""
    readings, left_out, stated_mm = as_touch_readings(reference)
    radius_mm = stated_mm if radius_mm is None else radius_mm
    if radius_mm is None:
        raise InputError("reference_radius_mm must be given, the radius of the rigid ball; no contact states it")
    if all(reading.force_n is None for reading in readings):
        raise InputError(
            "contacts of the rigid ball must state force_n; none does, and without a force they tell nothing of the gel"
        )
    return replace(_body(readings, ObjectGeometry(radius_mm=radius_mm)), rigid=True), left_out


def _explored(
    bodies: Sequence[TouchedBody], gel: GelSensor, prior: HardnessPrior, errors: TouchErrors, *, flat: bool
) -> tuple[NDArray[np.float64], float, int]:
    """Samples of the modulus, the least misfit and the number of residuals beyond the fitted; the prior where flat."""
    if flat:
        return modulus_samples(np.zeros_like, prior), 0.0, 0
    with one_blas_thread():
        likelihood = TouchLikelihood(
            bodies,
            young_kpa=gel.believed_young_kpa,
            thickness_mm=gel.thickness_mm,
            poisson=gel.poisson,
            object_poisson=prior.poisson,
            errors=errors,
        )
        least = [np.inf]

        def log_density(young_kpa: NDArray[np.float64]) -> NDArray[np.float64]:
            value, misfit = likelihood(young_kpa)
            least[0] = min(least[0], misfit)
            return value

        samples = modulus_samples(log_density, prior)
    return samples, least[0], likelihood.residual_count - 1


def unknowable(readings: Sequence[TouchReading], shape: ObjectGeometry) -> list[Finding]:
    """Why no modulus can follow from such contacts, at most one reason."""
    if shape.shape == "flat":
        return [FLAT_OBJECT.finding()]
    forces = [reading for reading in readings if reading.force_n is not None]
    pairs = [reading for reading in readings if reading.radius_mm is not None and reading.depth_mm is not None]
    if not forces and shape.radius_mm is None:
        return [FORCE_AND_RADIUS_UNKNOWN.finding()]
    return [] if forces or pairs else [FORCE_AND_DEPTH_UNKNOWN.finding()]


def _widest_mm(gel: GelSensor) -> float:
    return WIDEST_CONTACT * min(gel.width_mm, gel.height_mm) / 2


def _beyond_model(reading: TouchReading, shape: ObjectGeometry, gel: GelSensor) -> bool:
    """Whether a contact is wider than the face or the object allows."""
    object_mm = np.inf if shape.radius_mm is None else shape.radius_mm
    return (reading.radius_mm or 0.0) > min(_widest_mm(gel), DEEPEST_CONTACT * object_mm)


def contact_findings(
    readings: Sequence[TouchReading], left_out: Sequence[str], shape: ObjectGeometry, gel: GelSensor
) -> Iterator[Finding]:
    """Warnings about the contacts, the geometry and the sensor."""
    if left_out:
        yield CONTACTS_LEFT_OUT.finding(left_out=len(left_out))
    if shape.radius_mm is None and shape.shape != "flat":
        yield GEL_RADIUS_UNKNOWN.finding()
    largest = max((reading.radius_mm for reading in readings if reading.radius_mm is not None), default=0.0)
    if largest > _widest_mm(gel):
        yield CONTACT_TOO_WIDE.finding(radius_mm=largest, widest_mm=_widest_mm(gel))
    if shape.radius_mm is not None and largest > DEEPEST_CONTACT * shape.radius_mm:
        yield CONTACT_TOO_DEEP.finding(radius_mm=largest, object_mm=shape.radius_mm)
    if gel.shape != "flat":
        yield GEL_NOT_FLAT.finding(sensor=gel.name)
    forces = [reading.force_n for reading in readings if reading.force_n is not None]
    if forces and max(forces) < (1 + SAME_FORCE) * min(forces):
        yield GEL_ONE_FORCE.finding()


def misfit_findings(misfit: float, freedom: int) -> Iterator[Finding]:
    """Whether the readings contradict each other."""
    if freedom < 1:
        return
    chance = float(scipy.stats.chi2.sf(misfit, freedom))
    if chance < IMPROBABLE:
        yield GEL_MODEL_DOES_NOT_FIT.finding(chance=probability_bound(chance))
