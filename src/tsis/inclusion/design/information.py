"""Expected accuracy of a protocol, from the likelihood of simulated presses.

It is the Fisher information of diameter, depth and modulus with the nuisances integrated out, at inclusions spread over
the prior's box, from the model's grey profiles. The inclusion's offset from the axis has the prior's uncertainty, also
with references.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.catalog.phantoms import load_phantom
from tsis.compiled import one_blas_thread
from tsis.errors import InputError
from tsis.imaging.profile import radial_profile
from tsis.imaging.sensor import Sensor
from tsis.inclusion.estimation import check_calibration
from tsis.inclusion.flags import MODULUS_SD_KPA
from tsis.inclusion.frames import averaged_errors, depletion_per_n, ring_edges, ring_light
from tsis.inclusion.posterior.forward import ForwardModel
from tsis.inclusion.posterior.likelihood import InclusionLikelihood, Profiles, least_sd
from tsis.inclusion.posterior.rings import ring_correlation, ring_responses
from tsis.inclusion.posterior.uneven_tissue import build_field_table, heterogeneity
from tsis.inclusion.prior import PARAMETERS, Floats, InclusionPrior
from tsis.mechanics.surrogate.full_contact import build_full_contact_surrogate
from tsis.mechanics.surrogate.polynomial import Degrees, contrast_factor
from tsis.model.image import TactileImage
from tsis.model.require import require_array, require_integer, require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.inclusion.design.protocol import Protocol
    from tsis.mechanics.surrogate.full_contact import FullContactSurrogate
    from tsis.model.calibration import Calibration


CELLS = 801  # over the modulus's range
SPREAD = 64  # inclusions over the box
LOCATED_MM = 0.5  # largest standard deviation of either coordinate of an inclusion near the axis, after the frames
SOURCE_INCLUSIONS = 9
# A design needs the derivatives of the press, not its last digits: a third of the solves of an estimate's surrogate.
COARSE = Degrees(diameter=5, depth=4, contrast=2, tissue=2, thickness=2, baseline=3)
MODEL_ERROR = 1.3e-4  # of the finer surrogate of an estimate


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProtocolInformation:
    """Information of a protocol about a set of inclusions.

    Attributes
    ----------
    inclusions
        Diameter in mm, depth in mm and modulus in kPa, shape (n, 3).
    matrix
        Fisher information of the three with the nuisances integrated out, shape (n, 3, 3).
    prior
        Prior of inclusion and tissue.
    """

    inclusions: Floats
    matrix: Floats
    prior: InclusionPrior

    @property
    def prior_sd(self) -> Floats:
        """Prior standard deviations of the three, shape (3,)."""
        return np.array(list(self.prior.sd.values()))

    @property
    def cramer_rao_sd(self) -> Floats:
        """Cramér–Rao bound of the sd, shape (n, 3); infinite without information."""
        return least_sd(self.matrix)

    @property
    def expected_sd(self) -> Floats:
        """Expected standard deviations, shape (n, 3).

        Signals are nearly linear in diameter, depth and the saturation of the signal with the modulus,
        `tsis.mechanics.surrogate.polynomial.contrast_factor`. The modulus has its uniform prior, which the posterior
        often fills; diameter and depth have normal priors of the same variance as the uniform ones.
        """
        factor = contrast_factor(self.inclusions[:, 2] / self.prior.tissue_young_kpa)
        fisher = self.matrix.copy()
        slope = 1 / _factor_slope(self.inclusions[:, 2], self.prior.tissue_young_kpa)
        fisher[:, 2] *= slope[:, None]
        fisher[:, :, 2] *= slope[:, None]
        sizes = np.linalg.inv(fisher[:, :2, :2] + np.diag(self.prior_sd[:2] ** -2))
        along = np.einsum("nij,nj->ni", sizes, fisher[:, :2, 2])  # change of the sizes equivalent to one of the factor
        precision = fisher[:, 2, 2] - np.einsum("ni,ni->n", fisher[:, :2, 2], along)
        young = np.linspace(*self.prior.young_kpa, CELLS)
        at = contrast_factor(young / self.prior.tissue_young_kpa)
        weight = np.exp(-0.5 * precision[:, None] * (at - factor[:, None]) ** 2)
        weight /= weight.sum(axis=1, keepdims=True)
        spread_of_sizes = np.diagonal(sizes, axis1=1, axis2=2) + along**2 * _variance(weight, at)[:, None]
        return np.asarray(np.sqrt(np.column_stack([spread_of_sizes, _variance(weight, young)])))

    @property
    def rmse(self) -> dict[str, float]:
        """Expected root mean square error of each parameter over the inclusions."""
        return dict(zip(PARAMETERS, np.sqrt((self.expected_sd**2).mean(axis=0)).tolist(), strict=True))

    @property
    def identified_fraction(self) -> float:
        """Fraction of the inclusions with an expected sd of the modulus below 20 kPa."""
        return float((self.expected_sd[:, -1] < MODULUS_SD_KPA).mean())

    @property
    def log_sd(self) -> float:
        """Mean over the inclusions of the log of the product of the three expected sd over the prior's."""
        return float(np.log(self.expected_sd / self.prior_sd).sum(axis=1).mean())


def _factor_slope(young_kpa: Floats, tissue_young_kpa: float) -> Floats:
    """Derivative of the contrast factor with respect to the inclusion's modulus, per kPa."""
    return np.asarray(2.5 * tissue_young_kpa / (young_kpa + 1.5 * tissue_young_kpa) ** 2)


def _variance(weight: Floats, values: Floats) -> Floats:
    """Variances of values (m,) under each row of weights (n, m)."""
    return np.asarray(weight @ values**2 - (weight @ values) ** 2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlannedView:
    """Model of a protocol's presses, and the sensor's pixels in each ring."""

    model: ForwardModel  # model of one frame of each press, with the errors of the mean of its repeats
    count: NDArray[np.int_]  # pixels of the sensor in each ring, shape (rings,)
    protocol: Protocol
    surrogate: FullContactSurrogate
    sensor: Sensor

    def grey(self, inclusions: Floats | None) -> Floats:
        """Expected grey levels, shape (n, frames, rings); None is tissue without inclusion, n = 1."""
        observed = self.model.grey(inclusions, self.start) * self.model.level
        return np.asarray(observed + self.model.calibration.background_grey)

    @property
    def start(self) -> Floats:
        """No nuisance at all."""
        return np.zeros(len(self.model.nuisance_sd(np.zeros(len(self.model.force_n)))))

    def likelihood(self, inclusion: Floats) -> InclusionLikelihood:
        """Likelihood of the model's frames of an inclusion (3,), without errors."""
        calibration, level = self.model.calibration, self.model.level
        grey = self.model.grey(inclusion[None], self.start)[0]
        observed = grey * level
        pixel = calibration.read_noise_grey**2 + calibration.shot_noise_grey * np.maximum(observed, 0.0) + 1 / 12
        variance = (
            pixel / (self.protocol.frames_each * np.maximum(self.count, 1) * level**2) + (MODEL_ERROR * grey) ** 2
        )
        usable = (self.count > 0) & (observed + calibration.background_grey < self.sensor.full_scale)
        return InclusionLikelihood(self.model, Profiles(grey=grey, variance=variance, usable=usable))

    def information(self, inclusion: Floats) -> Floats:
        """Fisher information at an inclusion (3,), shape (3, 3)."""
        return self.likelihood(inclusion).with_information(inclusion, self.start)[1]


def protocol_information(
    protocol: Protocol,
    *,
    prior: InclusionPrior,
    calibration: Calibration,
    sensor: Sensor | None = None,
    inclusions: Floats | None = None,
    degrees: Degrees | None = None,
    unevenness: tuple[float, float] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> ProtocolInformation:
    """Compute the information of a protocol.

    Parameters
    ----------
    protocol
        Probe and presses.
    prior
        Prior of inclusion and tissue.
    calibration
        Response of grey level to pressure, and the errors; without a map of light, the light is uniform.
    sensor
        The camera; `Sensor` by default.
    inclusions
        Diameter in mm, depth in mm and modulus in kPa, shape (n, 3); 64 spread evenly over the prior by default.
    degrees
        Of the press's surrogate; a third of the solves of an estimate's by default.
    unevenness
        Standard deviation of the log of the tissue's modulus and its correlation length in mm; even tissue by default.
    progress
        Called with (slabs solved, all slabs) while the surrogate is built.

    Raises
    ------
    InputError
        When an inclusion lies outside the prior's ranges.
    NotCalibratedError
        When the calibration is that of another probe.
    """
    view = planned_view(
        protocol, prior=prior, calibration=calibration, sensor=sensor, degrees=degrees, progress=progress
    )
    view = view if unevenness is None else _uneven(view, *unevenness)
    return information_of(view, even_inclusions(prior) if inclusions is None else inclusions)


def _uneven(view: PlannedView, sd: float, length_mm: float) -> PlannedView:
    """The view on uneven tissue, with what an estimate allows for a superficial layer."""
    model, probe = view.model, view.protocol.probe
    require_number("standard deviation of unevenness", sd, 0.0, 0.45)
    require_number("length of unevenness", length_mm, 0.1, 100.0, hint="millimetres")
    hypotheses = heterogeneity(
        build_field_table(probe, model.prior),
        model.prior,
        ring_edges(probe),
        model.level,
        is_domed=probe.face_curvature_mm is not None,
    )
    return replace(view, model=replace(model, heterogeneity=hypotheses.alone(sd, length_mm)))


def information_of(view: PlannedView, inclusions: Floats) -> ProtocolInformation:
    """Information at each of the inclusions (n, 3)."""
    prior = view.model.prior
    inclusions = require_array("inclusions", inclusions, ndim=2)
    if inclusions.shape[1] != 3 or not ((inclusions >= prior.low) & (inclusions <= prior.high)).all():
        raise InputError(
            f"inclusions must hold diameter, depth and modulus within the prior's ranges ({prior}); "
            f"got shape {inclusions.shape}, from {inclusions.min(axis=0)} to {inclusions.max(axis=0)}"
        )
    with one_blas_thread():  # threads slow down matrices this small
        matrix = np.array([view.information(inclusion) for inclusion in inclusions])
    return ProtocolInformation(inclusions=inclusions, matrix=matrix, prior=prior)


def planned_view(
    protocol: Protocol,
    *,
    prior: InclusionPrior,
    calibration: Calibration,
    sensor: Sensor | None = None,
    degrees: Degrees | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> PlannedView:
    """Build the model of a protocol; see `protocol_information` for the parameters."""
    require_type("prior", prior, InclusionPrior)
    check_calibration(calibration, protocol.probe)
    built = build_full_contact_surrogate(protocol.probe, prior.box(), degrees=degrees or COARSE, progress=progress)
    return view_of(protocol, built, prior=prior, calibration=calibration, sensor=sensor or Sensor())


def view_of(
    protocol: Protocol,
    surrogate: FullContactSurrogate,
    *,
    prior: InclusionPrior,
    calibration: Calibration,
    sensor: Sensor,
) -> PlannedView:
    """Build the model of a protocol with a given surrogate."""
    edges, dark = ring_edges(protocol.probe), np.zeros((sensor.rows, sensor.columns))
    blank = TactileImage(grey=dark, mm_per_pixel=sensor.mm_per_pixel, full_scale=sensor.full_scale)
    observed = replace(calibration, read_noise_grey=sensor.read_noise_grey, shot_noise_grey=sensor.shot_noise_grey)
    light = ring_light(blank, calibration, edges)
    targets = [press.force_n for press in protocol.presses]
    references = [press.force_n for press in protocol.presses if press.with_reference]
    model = ForwardModel(
        rings=ring_responses(surrogate, edges, light.level),
        level=light.level,
        shading=light.shading,
        calibration=averaged_errors(observed, protocol.frames_each),
        prior=prior,
        force_n=np.array(targets + references),
        is_reference=np.array([False] * len(targets) + [True] * len(references)),
        correlation=ring_correlation(edges, calibration.grain_mm),
        depletion_per_n=depletion_per_n(calibration, protocol.probe),
        spread_sd=2 * min(prior.offset_sd_mm, LOCATED_MM) ** 2,
    )
    count = radial_profile(blank, edges_mm=edges).count
    return PlannedView(model=model, count=count, protocol=protocol, surrogate=surrogate, sensor=sensor)


def even_inclusions(prior: InclusionPrior, count: int = SPREAD) -> Floats:
    """Diameters, depths and moduli spread evenly over the prior's box by a Sobol sequence, shape (count, 3).

    Diameters and depths are in mm, moduli in kPa; ``count`` lies in [1, 65536], else `InputError` is raised.

    Examples
    --------
    >>> even_inclusions(InclusionPrior(), 4).round(1).tolist()
    [[2.8, 5.0, 50.0], [9.8, 9.0, 90.0], [13.2, 7.0, 70.0], [6.2, 11.0, 110.0]]
    """
    count = require_integer("count", count, 1, 2**16)
    unit = scipy.stats.qmc.Sobol(3, scramble=False).random_base2(int(np.ceil(np.log2(count))))[:count]
    return np.asarray(prior.low + (unit + 0.5 / count) % 1.0 * (prior.high - prior.low))


def dissertation_inclusions() -> Floats:
    """The nine inclusions of table 6.2, shape (9, 3)."""
    lumps = (load_phantom(f"calibration-{number}").inclusion for number in range(1, SOURCE_INCLUSIONS + 1))
    return np.array([[getattr(lump, name) for name in PARAMETERS] for lump in lumps])
