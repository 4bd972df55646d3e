"""Estimate Young's modulus of a soft sphere from presses on the bare probe."""

from __future__ import annotations

from dataclasses import asdict
from functools import lru_cache
from typing import TYPE_CHECKING

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.compiled import one_blas_thread
from tsis.errors import ImageMismatchError, InputError
from tsis.hardness.flags import UNTRUSTED_FLAGS, identifiability, press_findings
from tsis.hardness.posterior import (
    DRIFT_SD,
    ContactPress,
    HardnessLikelihood,
    HardnessPrior,
    RadiusPrior,
    explore_modulus,
)
from tsis.hardness.reading import BLUR_MM, read_contact
from tsis.hardness.sphere import require_small_sphere
from tsis.hardness.table import WIDEST_FRACTION, build_contact_table
from tsis.model.estimate import NOT_TRUSTED, Estimate
from tsis.model.image import TactileImage, as_images, require_frames_of_probe, require_image_series, require_same_probe
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.hardness.table import ContactTable
    from tsis.model.calibration import Calibration
    from tsis.model.probe import Probe


RADIUS_SD_MM = 0.03  # of a radius given without uncertainty: that of a calliper
BALL_SD_MM = 0.003  # of a rigid ball given without uncertainty: bearing balls are rounder


def estimate(
    images: TactileImage | Sequence[TactileImage],
    *,
    probe: Probe,
    calibration: Calibration,
    radius_mm: float | None = None,
    radius_sd_mm: float | None = None,
    reference: TactileImage | Sequence[TactileImage] | None = None,
    reference_radius_mm: float | None = None,
    prior: HardnessPrior | None = None,
    blur_mm: float = BLUR_MM,
    drift_sd: float = DRIFT_SD,
    progress: Callable[[int, int], None] | None = None,
) -> Estimate:
    """Estimate Young's modulus of a soft sphere that was pressed on the bare probe.

    Each frame gives the contact radius and the force of its light; the gauge gives the force. A finite-strain model of
    sphere and layered probe predicts the contact radius for a modulus, so that the probe's compliance does not count
    as the object's. Gain, lamps, forces, probe moduli, radius and Poisson's ratio are nuisances, integrated out within
    their stated errors.

    Two presses at different forces are best: the second tests the model. One press is accepted and flagged; with a
    known radius it determines the modulus nearly as well.

    Parameters
    ----------
    images
        Raw presses on one object, each with ``force_n`` and ``mm_per_pixel``.
    probe
        The probe that pressed.
    calibration
        Response of grey level to pressure, and the errors.
    radius_mm
        Radius of the object, in [1, 0.6 of the face's radius] mm; by default that of the images' ``settings``. An
        unknown radius is flagged: the interval is then wide.
    radius_sd_mm
        Its standard deviation; by default that of the ``settings``, else 0.03 mm.
    reference
        Presses of a RIGID ball on the same probe: they determine the probe's own compliance, which a soft probe needs.
    reference_radius_mm
        Radius of that ball; by default that of the references' ``settings``.
    prior
        Ranges of modulus and Poisson's ratio; `HardnessPrior` by default.
    blur_mm
        Standard deviation of the lens's point spread on the face, in [0, 1].
    drift_sd
        Relative standard deviation of the lamps from press to press, in [0, 0.5].
    progress
        Called with (done, all) while the contact of a new probe is solved once, in some minutes.

    Returns
    -------
    Estimate
        Of ``young_kpa``, with flags for what the data do not determine.

    Raises
    ------
    InputError
        When there is no image, an image has no force, scale or contact, a contact leaves the picture or the face, or
        the object is larger than the probe can measure.
    NotCalibratedError
        When the calibration is missing or of another probe.
    ImageMismatchError
        When images differ in scale, shape, axis, range of values, probe or radius.
    """
    frames, balls = as_images("images", images), as_images("reference", reference)
    if not frames:
        raise InputError("images must hold at least one TactileImage; got none")
    require_same_probe(probe, calibration)
    prior = HardnessPrior() if prior is None else prior
    require_type("prior", prior, HardnessPrior)
    require_number("blur_mm", blur_mm, 0.0, 1.0, hint="millimetres")
    require_number("drift_sd", drift_sd, 0.0, 0.5, hint="a fraction")
    digests = require_image_series(frames + balls)
    require_frames_of_probe(frames + balls, probe)
    radius = radius_prior(probe, frames, radius_mm, radius_sd_mm)
    ball_mm, ball_sd = ball_radius(probe, balls, reference_radius_mm) if balls else (None, 0.0)
    presses = [
        ContactPress(
            force_n=frame.force_n or 0.0,
            seen=read_contact(frame, probe=probe, calibration=calibration, blur_mm=blur_mm),
            ball_radius_mm=ball_mm if index >= len(frames) else None,
            ball_radius_sd=ball_sd,
        )
        for index, frame in enumerate(frames + balls)
    ]
    table = _table(probe) if progress is None else build_contact_table(probe, progress=progress)
    with one_blas_thread():
        likelihood = HardnessLikelihood(presses, table=table, calibration=calibration, drift_sd=drift_sd)
        posterior = explore_modulus(likelihood, prior, radius)
    flagged = press_findings(presses, likelihood, posterior, prior, radius)
    causes = UNTRUSTED_FLAGS.intersection(flag for flag, _ in flagged)
    return Estimate(
        samples={"young_kpa": posterior.young_kpa},
        prior_sd={"young_kpa": prior.young_sd_kpa},
        identifiability=NOT_TRUSTED if causes else identifiability(posterior, prior),
        prior=str(prior),
        trusted=not causes,
        flags=tuple(flag for flag, _ in flagged),
        notes=tuple(note for _, note in flagged),
        provenance={
            "notice": RESEARCH_USE_ONLY,
            "tsis": __version__,
            "method": "contact radius and force of a soft sphere on the layered probe at finite strain",
            "probe": asdict(probe),
            "calibration": calibration.provenance(),
            "prior": asdict(prior),
            "radius": asdict(radius),
            "table": {"key": table.key, "error": table.error.tolist()},
            "presses": [
                {"name": frame.name, "sha256": digest, "settings": dict(frame.settings), **asdict(press)}
                for frame, digest, press in zip(frames + balls, digests, presses, strict=True)
            ],
        },
    )


def radius_prior(
    probe: Probe, frames: list[TactileImage], radius_mm: float | None, radius_sd_mm: float | None
) -> RadiusPrior:
    """Prior of the object's radius, from the caller or else from the frames' settings."""
    largest = WIDEST_FRACTION * probe.radius_mm
    if radius_mm is None:
        radius_mm, frames_sd_mm = _radius_of_settings(frames)
        radius_sd_mm = frames_sd_mm if radius_sd_mm is None else radius_sd_mm
    if radius_mm is None:
        return RadiusPrior(radius_mm=None, sd_mm=0.0, largest_mm=largest)
    sd = RADIUS_SD_MM if radius_sd_mm is None else radius_sd_mm
    require_radius("radius_mm", probe, radius_mm)
    hint = "millimetres, up to a tenth of the radius; omit both if the radius is unknown"
    require_number("radius_sd_mm", sd, 0.0, radius_mm / 10, hint=hint)
    return RadiusPrior(radius_mm=radius_mm, sd_mm=sd, largest_mm=largest)


def ball_radius(probe: Probe, balls: list[TactileImage], radius_mm: float | None) -> tuple[float, float]:
    """Radius in mm of the rigid ball of the reference presses, and its relative standard deviation."""
    sd_mm: float | None = None
    if radius_mm is None:
        radius_mm, sd_mm = _radius_of_settings(balls)
    if radius_mm is None:
        raise InputError(
            "reference_radius_mm must be given, the radius of the rigid ball; no frame's settings contain it"
        )
    require_radius("reference_radius_mm", probe, radius_mm)
    return radius_mm, (BALL_SD_MM if sd_mm is None else sd_mm) / radius_mm


def require_radius(name: str, probe: Probe, radius_mm: float) -> None:
    """Refuse a radius in mm of an object that this probe cannot measure; `InputError` names it."""
    require_number(name, radius_mm, 1.0, 50.0, hint="millimetres")
    require_small_sphere(probe, radius_mm)


def _radius_of_settings(frames: list[TactileImage]) -> tuple[float | None, float | None]:
    """Radius and standard deviation in the frames' settings, which must agree."""
    radii = {(frame.settings.get("radius_mm"), frame.settings.get("radius_sd_mm")) for frame in frames}
    if len(radii) > 1:
        raise ImageMismatchError(
            f"all images must be of one object; their settings give (radius_mm, radius_sd_mm) {sorted(radii, key=str)}"
        )
    radius, sd = radii.pop()
    if radius is not None:
        radius = require_number("radius_mm of the settings", radius, 1e-3, 1e3)
    if sd is not None:
        sd = require_number("radius_sd_mm of the settings", sd, 0.0, 1e3)
    return radius, sd


@lru_cache(maxsize=8)  # reading it from disk takes as long as an estimate
def _table(probe: Probe) -> ContactTable:
    return build_contact_table(probe)
