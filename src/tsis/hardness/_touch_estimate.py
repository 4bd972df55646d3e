"""Young's modulus of an object from contacts of a gel sensor, read by this or any other program."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.catalog.sensors import load_sensor
from tsis.compiled import one_blas_thread
from tsis.errors import InputError
from tsis.hardness._contact_readings import as_touch_readings, loading_part
from tsis.hardness._exploration import HardnessPrior, modulus_samples
from tsis.hardness._object_geometry import ObjectGeometry, as_geometry
from tsis.hardness._touch_likelihood import TouchErrors, TouchLikelihood
from tsis.hardness._touch_terms import TouchedBody
from tsis.hardness.flags import DEEPEST_CONTACT, UNTRUSTED_FLAGS, WIDEST_CONTACT, modulus_findings
from tsis.model.estimate import IMPROBABLE, NOT_TRUSTED, Estimate, probability_bound
from tsis.model.gel_sensor import GelSensor, gel_sensor_of_probe
from tsis.model.probe import Probe
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.hardness._contact_readings import TouchReading

    Finding = tuple[str, str]

GEL_PRIOR = HardnessPrior(young_kpa=(2.0, 10_000.0), poisson=(0.45, 0.495))
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
) -> Estimate:
    """Estimate Young's modulus of an object from its contacts with a gel sensor.

    The object is a half-space with a round face, the gel a layer bonded to a rigid backing, corrected for finite
    strain. A contact radius and a force give the combined compliance; a contact radius and the depth of the dent give
    the object's part of it without a force. The gel's modulus, thickness and Poisson's ratio lie anywhere within the
    sensor's limits. An error of the gel's modulus passes into the object's one to one; an object that is much stiffer
    than the gel adds little compliance, which widens its interval by ``1/(1 - s)``, s the gel's part.

    Parameters
    ----------
    contacts
        Contacts with ``force_n``, ``radius_mm`` or ``area_mm2``, ``depth_mm`` and their standard deviations: mappings,
        results of `tsis.imaging.contacts`, a table of pandas, or the path of a CSV file. Contacts with ``good`` false
        are left out. The contacts of both fingers of a gripper are given together.
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
        share the error from press to press.
    press_sd
        Relative standard deviation of a contact radius from press to press, in [0, 0.5].

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
    readings, left_out, stated_mm = as_touch_readings(contacts, force=force)
    shape = as_geometry(geometry, stated_mm)
    readings = loading_part(readings) if sequence else readings
    bodies = [_body(readings, shape)]
    if reference is not None:
        bodies.append(_rigid_ball(reference, reference_radius_mm))
    errors = TouchErrors(press=press_sd, scale=gel.scale_uncertainty, same_press=sequence)
    reasons = unknowable(readings, shape)
    samples, misfit, count = _explored(bodies, gel, prior, errors, flat=shape.shape == "flat" or bool(reasons))
    flagged = [
        *reasons,
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
            | {name: getattr(gel, name).limits for name in ("thickness_mm", "young_kpa", "poisson")},
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


def _rigid_ball(reference: Any, radius_mm: float | None) -> TouchedBody:
    readings, _, stated_mm = as_touch_readings(reference)
    radius_mm = stated_mm if radius_mm is None else radius_mm
    if radius_mm is None:
        raise InputError("reference_radius_mm must be given, the radius of the rigid ball; no contact states it")
    return replace(_body(readings, ObjectGeometry(radius_mm=radius_mm)), rigid=True)


def _explored(
    bodies: Sequence[TouchedBody], gel: GelSensor, prior: HardnessPrior, errors: TouchErrors, *, flat: bool
) -> tuple[NDArray[np.float64], float, int]:
    """Samples of the modulus, the least misfit and the number of residuals beyond the fitted; the prior where flat."""
    if flat:
        return modulus_samples(np.zeros_like, prior), 0.0, 0
    with one_blas_thread():
        likelihood = TouchLikelihood(
            bodies,
            young_kpa=gel.young_kpa,
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


SAME_FORCE = 0.02


def unknowable(readings: Sequence[TouchReading], shape: ObjectGeometry) -> list[Finding]:
    """Why no modulus can follow from such contacts, at most one reason."""
    if shape.shape == "flat":
        note = "The modulus is not identifiable: the contact of a flat object does not change with its modulus."
        return [("young_kpa_not_identified", note)]
    forces = [reading for reading in readings if reading.force_n is not None]
    pairs = [reading for reading in readings if reading.radius_mm is not None and reading.depth_mm is not None]
    if not forces and shape.radius_mm is None:
        note = "The modulus is not identifiable: force and radius of the object are both unknown (give one of them)."
        return [("young_kpa_not_identified", note)]
    if not forces and not pairs:
        note = "The modulus is not identifiable: without a force each contact needs radius_mm and depth_mm."
        return [("young_kpa_not_identified", note)]
    return []


def contact_findings(
    readings: Sequence[TouchReading], left_out: Sequence[str], shape: ObjectGeometry, gel: GelSensor
) -> list[Finding]:
    """Warnings about the contacts, the geometry and the sensor."""
    flagged: list[Finding] = []
    if left_out:
        flagged.append(("contacts_left_out", f"{len(left_out)} contacts are not good and were left out."))
    if shape.radius_mm is None and shape.shape != "flat":
        flagged.append(("radius_unknown", "The object's radius is unknown; its modulus grows with it: give radius_mm."))
    radii = [reading.radius_mm for reading in readings if reading.radius_mm is not None]
    widest = WIDEST_CONTACT * min(gel.width_mm, gel.height_mm) / 2
    if radii and max(radii) > widest:
        note = f"A contact of {max(radii):.3g} mm is wider than {widest:.3g} mm, 0.6 of the face: press less."
        flagged.append(("contact_too_wide", note))
    if radii and shape.radius_mm is not None and max(radii) > DEEPEST_CONTACT * shape.radius_mm:
        note = f"A contact of {max(radii):.3g} mm on a radius of {shape.radius_mm:.3g} mm is too deep: press less."
        flagged.append(("contact_too_deep", note))
    if gel.shape != "flat":
        note = f"The gel of {gel.name} is not flat: as a layer its compliance is only estimated."
        flagged.append(("gel_not_flat", note))
    forces = [reading.force_n for reading in readings if reading.force_n is not None]
    if forces and max(forces) < (1 + SAME_FORCE) * min(forces):
        flagged.append(("one_force", "All contacts have one force: a second one would test the model."))
    return flagged


def misfit_findings(misfit: float, freedom: int) -> list[Finding]:
    """Whether the readings contradict each other."""
    if freedom < 1:
        return []
    chance = float(scipy.stats.chi2.sf(misfit, freedom))
    if chance >= IMPROBABLE:
        return []
    note = (
        f"Forces, radii and dents contradict each other (chance below {probability_bound(chance)}): the object is not "
        "of that shape, or force, scale or sensor are wrong."
    )
    return [("model_does_not_fit", note)]
