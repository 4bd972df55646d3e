"""Response of a calibrated probe for the estimates: grey levels per kilopascal, and saturation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration._measured import MeasuredValue
from tsis.model import Calibration, require_type

if TYPE_CHECKING:
    from tsis.calibration.reference import CameraReference


NORMAL_95 = 1.96  # half width of a normal interval of 95 % in standard deviations
LEAST_SATURATION_KPA, LARGEST_SATURATION_KPA = 1e-3, 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class Saturation:
    """Saturation of the real contact area, as the curvature of the response: ``bend = 1 / saturation**2``.

    Parameters
    ----------
    bend_per_kpa2
        The bend, 1/kPa²; consistent with zero when no press came near saturation.

    Examples
    --------
    >>> saturation = Saturation(bend_per_kpa2=MeasuredValue(value=1e-6, sd=1e-6))
    >>> saturation.value_kpa, round(saturation.interval()[0]), saturation.interval()[1]
    (1000.0, 581, inf)
    """

    bend_per_kpa2: MeasuredValue

    def __post_init__(self) -> None:
        require_type("bend_per_kpa2", self.bend_per_kpa2, MeasuredValue)

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Ends in kPa; the upper end is infinite when a straight response cannot be excluded."""
        low, high = self.bend_per_kpa2.interval(level)
        return (
            1 / float(np.sqrt(high)) if high > 0 else LARGEST_SATURATION_KPA,
            1 / float(np.sqrt(low)) if low > 0 else float("inf"),
        )

    @property
    def identified(self) -> bool:
        """Whether the 95 % interval has an upper end."""
        return self.interval()[1] < np.inf

    @property
    def value_kpa(self) -> float:
        """Best value, kPa; where the bend is not positive, that of the upper end of its interval."""
        bend = self.bend_per_kpa2.value
        if bend <= 0:
            return self.interval()[0]
        return float(np.clip(1 / np.sqrt(bend), LEAST_SATURATION_KPA, LARGEST_SATURATION_KPA))


@dataclass(frozen=True, slots=True, kw_only=True)
class PressureResponse:
    """Rough-contact response of a probe: ``grey = light * gain * saturation * erf(0.886 p / saturation)``.

    Parameters
    ----------
    gain_grey_per_kpa
        Grey levels per kilopascal at small pressure under the mean light of the face.
    saturation
        Its saturation.
    repeatability_share
        Relative standard deviation from press to press.
    gauge_share
        Relative standard deviation of a force reading.
    """

    gain_grey_per_kpa: MeasuredValue
    saturation: Saturation
    repeatability_share: float
    gauge_share: float

    def calibration(self, reference: CameraReference, *, name: str, probe: str) -> Calibration:
        """The input of `tsis.inclusion.estimate` and `tsis.hardness.estimate`, for frames that `reference` corrected.

        Parameters
        ----------
        reference
            The probe's reference; corrected frames have neither background nor uneven light.
        name
            Identifies the calibration in every result.
        probe
            Name of the probe.
        """
        gain = self.gain_grey_per_kpa
        # The estimates assume a normal gain: as wide as the 95 % interval of Student's t.
        gain_sd = (gain.interval()[1] / gain.value - 1) / NORMAL_95
        return Calibration(
            gain_grey_per_kpa=gain.value,
            gain_sd=min(1.0, float(np.linalg.norm([gain_sd, self.repeatability_share, reference.drift_fraction]))),
            saturation_kpa=self.saturation.value_kpa,
            background_grey=0.0,
            force_sd=self.gauge_share,
            read_noise_grey=reference.read_noise_grey.value,
            shot_noise_grey=reference.shot_noise_grey.value,
            name=name,
            probe=probe,
        )
