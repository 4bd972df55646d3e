"""The modulus of tissue from one light press, and the forces that follow.

On a dome the size of the contact tells the modulus, on a flat face the share of the rim; the level of the light tells
nothing, for its sum is the force. Small strain: the press is light.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import one_blas_thread
from tsis.errors import InputError
from tsis.imaging.rendering import rough_contact
from tsis.inclusion.frames import GENERIC_GAIN_SD, ring_edges, ring_light, ring_profiles
from tsis.inclusion.posterior.rings import ring_correlation, ring_means
from tsis.mechanics.small_strain.linear_press import PressKernel
from tsis.mechanics.surrogate.finite_correction import correction_box, wide_box
from tsis.model.estimate import IMPROBABLE
from tsis.model.image import require_frames_of_probe, require_image_series, require_same_probe
from tsis.model.press import MN_PER_N
from tsis.model.probe import Probe
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from tsis.inclusion.prior import Floats, InclusionPrior
    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage


MODULI_KPA = np.geomspace(0.3, 150.0, 80)
MODEL_SD = 0.02  # of the largest grey level: small strain, one thickness, even tissue
FINE = 20_000  # points over the range, of the posterior
MODULUS_SD = 0.05  # of the logarithm of the modulus: small strain reads presses at finite strain 4 % too soft
STEP = 0.02  # of force and thickness, for derivatives
POISSON = 0.49
DOMED_LOADS = (1.28, 2.55)  # over the covering force; 0.5 and 1 N on 5 kPa
FLAT_LOAD = 1.39  # over the tissue's modulus times radius squared; 1 N on 5 kPa
SPREAD = 1.3  # of the tissue's modulus about its mean, which a table of finite strain holds
EXAMINATION_S, PRESS_S, SITE_S = 300.0, 15.0, 30.0  # most time of an operator, a press with its hold, moving to a site
MARGIN = 0.97  # of the largest load that the estimate's tables hold


@dataclass(frozen=True, slots=True, kw_only=True)
class TissueModulus:
    """Young's modulus of tissue without inclusion, kPa.

    Attributes
    ----------
    young_kpa
        Median.
    sd
        Relative standard deviation.
    interval_kpa
        Ends of the 90 % interval.
    chance
        Probability of a misfit as large as that of the best modulus.
    """

    young_kpa: float
    sd: float
    interval_kpa: tuple[float, float]
    chance: float

    @property
    def trusted(self) -> bool:
        """Whether the press looks like one on even tissue of some modulus inside the range."""
        return (
            self.chance >= IMPROBABLE and MODULI_KPA[1] < self.interval_kpa[0] < self.interval_kpa[1] < MODULI_KPA[-2]
        )


def tissue_modulus(
    image: TactileImage,
    *,
    probe: Probe,
    calibration: Calibration,
    thickness_mm: float = 30.0,
    thickness_sd: float = 0.1,
) -> TissueModulus:
    """Modulus of tissue from one press without an inclusion nearby, all moduli of 0.3 to 150 kPa equally likely.

    Parameters
    ----------
    image
        A raw press with ``force_n`` and ``mm_per_pixel``; light, so that a dome touches in part or just wholly.
    probe, calibration
        The probe that pressed, and its calibration.
    thickness_mm, thickness_sd
        Thickness of the tissue, and its relative standard deviation.

    Raises
    ------
    InputError
        When the image has no force or scale, or a value lies outside its range.
    NotCalibratedError
        When the calibration is missing or of another probe.
    """
    require_same_probe(probe, calibration)
    thickness_mm = require_number("thickness_mm", thickness_mm, 2.0, 500.0, hint="millimetres")
    thickness_sd = require_number("thickness_sd", thickness_sd, 0.0, 0.2, hint="a fraction")
    require_image_series([image])
    require_frames_of_probe([image], probe)
    if image.force_n is None:
        raise InputError("image must have a force_n, that of the light press; got none")
    edges = ring_edges(probe)
    light = ring_light(image, calibration, edges)
    data = ring_profiles([image], calibration, edges, light=light.level, model_error=0.0)
    used, grey = data.usable[0], data.grey[0]

    def expected(force_n: float, thickness: float) -> Floats:
        """Grey levels, shape (moduli, rings)."""
        pressure, displacement, slope = _rings(probe, force_n, thickness, tuple(edges.tolist()))
        shade = light.shading.factor(displacement, slope, np.zeros(3))
        return rough_contact(pressure, calibration) * shade

    with one_blas_thread():
        model = expected(image.force_n, thickness_mm)
        by_force = (expected(image.force_n * (1 + STEP), thickness_mm) - model) / STEP
        by_thickness = (expected(image.force_n, thickness_mm * (1 + STEP)) - model) / STEP
    gain_sd = calibration.gain_sd if calibration.light is not None else GENERIC_GAIN_SD
    offset = np.broadcast_to(1 / light.level, model.shape) * grey[used].mean()
    linear = [
        (model, gain_sd),
        (by_force, calibration.force_sd),
        (by_thickness, thickness_sd),
        (offset, calibration.offset_sd),
    ]
    pattern = ring_correlation(edges, calibration.grain_mm) * (
        calibration.pattern_sd**2 + calibration.repeatability_sd**2
    )
    misfits, volumes = [], []
    for index, row in enumerate(model):
        columns = np.stack([part[index] * sd for part, sd in linear], axis=1)
        covariance = np.diag(data.variance[0] + (MODEL_SD * row.max()) ** 2) + pattern * np.outer(row, row)
        covariance = (covariance + columns @ columns.T)[np.ix_(used, used)]
        rest = (grey - row)[used]
        misfits.append(rest @ np.linalg.solve(covariance, rest))
        volumes.append(np.linalg.slogdet(covariance)[1])
    logs = -0.5 * (np.array(misfits) + np.array(volumes))
    return _summary(logs, float(min(misfits)), int(used.sum()))


def _summary(logs: Floats, misfit: float, count: int) -> TissueModulus:
    """Median, interval and spread of a posterior whose logarithm is known at `MODULI_KPA`."""
    fine = np.linspace(np.log(MODULI_KPA[0]), np.log(MODULI_KPA[-1]), FINE)
    density = scipy.interpolate.CubicSpline(np.log(MODULI_KPA), logs)(fine)
    density = scipy.ndimage.gaussian_filter1d(
        np.exp(density - density.max()), MODULUS_SD / (fine[1] - fine[0]), mode="nearest"
    )
    density /= density.sum()
    low, middle, high = np.exp(np.interp([0.05, 0.5, 0.95], np.cumsum(density), fine)).tolist()
    sd = float(np.sqrt(density @ (fine - density @ fine) ** 2))
    return TissueModulus(
        young_kpa=middle, sd=sd, interval_kpa=(low, high), chance=float(scipy.special.chdtrc(count - 1, misfit))
    )


@lru_cache(maxsize=8)
def _rings(
    probe: Probe, force_n: float, thickness_mm: float, edges_mm: tuple[float, ...]
) -> tuple[Floats, Floats, Floats]:
    """Pressure in kPa, displacement in mm and slope of each ring on tissues of `MODULI_KPA`, shape (moduli, rings)."""
    kernel = _kernel(probe, thickness_mm)
    presses = [kernel.press(young, force_n * MN_PER_N) for young in MODULI_KPA.tolist()]
    means = ring_means(kernel.radius_mm, np.array(edges_mm))
    slopes = means @ np.gradient(np.eye(len(kernel.radius_mm)), kernel.radius_mm, axis=0)
    pressure = np.array([press.pressure_kpa for press in presses])
    displacement = np.array([press.face_displacement_mm for press in presses])
    return pressure @ means.T, displacement @ means.T, displacement @ slopes.T


def protocol_forces(
    probe: Probe, *, tissue_young_kpa: float, thickness_mm: float = 30.0, careful: bool = False
) -> tuple[float, ...]:
    """Forces in newtons that use a probe well on its tissue: two under a dome, one under a flat face.

    A dome loads the tissue differently at two forces: at the lower one it just touches with its whole face, at the
    higher one it presses twice as hard. Forces grow with the modulus of the tissue; they have two digits.

    Parameters
    ----------
    probe
        The probe.
    tissue_young_kpa
        Modulus of the tissue, in [0.75, 65]; `tsis.inclusion.tissue.tissue_modulus` measures it.
    thickness_mm
        Thickness of the tissue, in [12.5, 72].
    careful
        Repeat the presses as often as fit into five minutes of an operator's time on two sites (`operator_time_s`).
        Repeats at these forces tell more than as many presses at forces between (``python -m benchmarks.careful``).

    Raises
    ------
    InputError
        When a value lies outside its range.

    Examples
    --------
    >>> import tsis
    >>> protocol_forces(tsis.load_probe("tsis-domed"), tissue_young_kpa=5.0)
    (0.5, 1.0)
    >>> protocol_forces(tsis.load_probe("tsis-domed"), tissue_young_kpa=10.0)
    (0.96, 1.9)
    >>> protocol_forces(tsis.load_probe("tsis-domed"), tissue_young_kpa=5.0, careful=True)
    (0.5, 1.0, 0.5, 1.0, 0.5, 1.0, 0.5, 1.0)
    """
    require_type("probe", probe, Probe)
    box, usual = wide_box(probe), correction_box(probe)
    young = require_number("tissue_young_kpa", tissue_young_kpa, *box.tissue_young_kpa, hint="kilopascals")
    thickness = require_number("thickness_mm", thickness_mm, *box.thickness_mm, hint="millimetres")
    soft, stiff = usual.tissue_young_kpa
    if SPREAD * soft <= young <= stiff / SPREAD and usual.thickness_mm[0] <= thickness <= usual.thickness_mm[1]:
        box = usual
    most = MARGIN * float(box.largest_load(np.array(young)))
    is_flat = probe.face_curvature_mm is None
    unit_n = young * probe.radius_mm**2 / MN_PER_N if is_flat else _kernel(probe, thickness).covering(young).force_n
    loads = (FLAT_LOAD,) if is_flat else DOMED_LOADS
    forces = tuple(float(f"{min(load, most) * unit_n:.2g}") for load in loads)
    repeats = int((EXAMINATION_S - operator_time_s(0)) / (operator_time_s(len(forces)) - operator_time_s(0)))
    return repeats * forces if careful else forces


def operator_time_s(presses: int) -> float:
    """Time of an operator, s, for as many presses on the target and on a reference site: 15 s each, 30 s a site.

    Examples
    --------
    >>> operator_time_s(2), operator_time_s(8)
    (120.0, 300.0)
    """
    return 2 * (SITE_S + PRESS_S * presses)


@lru_cache(maxsize=8)
def _kernel(probe: Probe, thickness_mm: float) -> PressKernel:
    return PressKernel(probe, thickness_mm=thickness_mm, poisson=POISSON)


def prior_on_tissue(prior: InclusionPrior, young_kpa: float) -> InclusionPrior:
    """The prior for tissue of another modulus in kPa, with the same range of contrast.

    Examples
    --------
    >>> from tsis.inclusion import InclusionPrior
    >>> prior_on_tissue(InclusionPrior(), 10.0).young_kpa
    (80.0, 240.0)
    """
    young_kpa = require_number("tissue_young_kpa", young_kpa, 0.05, 2000.0, hint="kilopascals")
    low, high = (young_kpa / prior.tissue_young_kpa * end for end in prior.young_kpa)
    return replace(prior, tissue_young_kpa=young_kpa, young_kpa=(low, high))
