"""Fraction of the light that leaves a pressed face: three models, so that the choice can be tested.

Measurements support ``RoughContact``: light leaves where asperities touch, so it follows the pressure.
``SmoothContact`` and ``CurvatureLoss`` are the alternatives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError
from tsis.model.require import require_number, require_one_of
from tsis.optics import ERF_SLOPE, real_contact

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.calibration import Calibration


@dataclass(frozen=True, slots=True, kw_only=True)
class RoughContact:
    """Light leaves through the real contact of asperities, which grows with the pressure: ``erf(0.886 p / p_sat)``.

    This software uses it for the dissertation's unspecified function in (5.2).

    Examples
    --------
    >>> fraction = RoughContact().light_fraction(np.array([0.0, 1.0, 100.0]), slope=np.zeros(3), saturation_kpa=20.0)
    >>> fraction.round(3).tolist()
    [0.0, 0.05, 1.0]
    """

    def light_fraction(
        self, pressure_kpa: NDArray[np.float64], *, slope: NDArray[np.float64], saturation_kpa: float
    ) -> NDArray[np.float64]:
        """Fraction of the light that leaves, in [0, 1], in the shape of the pressure; ``slope`` has no effect."""
        del slope
        return real_contact(pressure_kpa, saturation_kpa)


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothContact:
    """Light leaves where smooth surfaces touch, at any pressure: it follows the area of the contact."""

    def light_fraction(
        self, pressure_kpa: NDArray[np.float64], *, slope: NDArray[np.float64], saturation_kpa: float
    ) -> NDArray[np.float64]:
        """1 where there is pressure, else 0; slope and saturation have no effect."""
        del slope, saturation_kpa
        return np.asarray(pressure_kpa > 0, dtype=float)


@dataclass(frozen=True, slots=True, kw_only=True)
class CurvatureLoss:
    """Light leaves without contact, where the dent tilts the face beyond total reflection.

    Guided light of even radiance fills all directions beyond the critical angle from the undented face's normal. The
    fraction of its power that meets the tilted face within the critical angle leaves; partial reflection is neglected.
    For small slopes that is ``2 / pi * tan(critical) * slope``. The refractive index is that of the layer at the face,
    against air, in [1.01, 4].

    Examples
    --------
    >>> slope = np.array([0.0, 0.01, 0.5])
    >>> CurvatureLoss().light_fraction(np.ones(3), slope=slope, saturation_kpa=20.0).round(3).tolist()
    [0.0, 0.006, 0.337]
    """

    refractive_index: float = 1.41

    def __post_init__(self) -> None:
        require_number("refractive_index", self.refractive_index, 1.01, 4.0)

    def light_fraction(
        self, pressure_kpa: NDArray[np.float64], *, slope: NDArray[np.float64], saturation_kpa: float
    ) -> NDArray[np.float64]:
        """Fraction of the light that leaves, in [0, 1], in the shape of the slope (either sign), at any pressure."""
        del pressure_kpa, saturation_kpa
        sine = 1 / self.refractive_index
        cosine = np.sqrt(1 - sine**2)
        tilt = np.arctan(np.abs(slope))
        # Projected along the tilted normal, the directions that leave fill a disc; an ellipse over it has never been
        # guided. The rest of the disc is integrated along its chords, which are whole beyond `limit`.
        cosine_of_limit = np.minimum(cosine / sine * np.tan(tilt / 2), 1.0)
        limit, sine_of_limit = np.arccos(cosine_of_limit), np.sqrt(1 - cosine_of_limit**2)
        half_chords = limit + sine_of_limit * cosine_of_limit
        cut = sine**2 * (1 - np.cos(tilt)) * half_chords + 2 * sine * cosine * np.sin(tilt) * sine_of_limit
        whole = sine**2 * (np.pi - 2 * half_chords)
        return np.asarray(np.minimum((cut + whole) / (np.pi * cosine**2), 1.0))


ContactModel = RoughContact | SmoothContact | CurvatureLoss
CONTACT_MODELS: dict[str, ContactModel] = {
    "rough": RoughContact(),
    "smooth": SmoothContact(),
    "curvature": CurvatureLoss(),
}


def as_contact_model(model: ContactModel | str) -> ContactModel:
    """The model of that name, or the model itself."""
    if isinstance(model, str):
        return CONTACT_MODELS[require_one_of("contact_model", model, CONTACT_MODELS)]
    if not isinstance(model, ContactModel):
        raise InputError(f"contact_model must be one of {', '.join(CONTACT_MODELS)} or a model; got {model!r:.80}")
    return model


def rough_contact(pressure_kpa: NDArray[np.float64], calibration: Calibration) -> NDArray[np.float64]:
    """Grey level above background of a contact pressure in kPa (any shape) by the rough model, under even light.

    Examples
    --------
    >>> from tsis.model.calibration import Calibration
    >>> calibration = Calibration(gain_grey_per_kpa=50.0, saturation_kpa=20.0)
    >>> [round(float(grey), 1) for grey in rough_contact(np.array([-1.0, 0.1, 1000.0]), calibration)]
    [0.0, 5.0, 1000.0]
    """
    level = calibration.gain_grey_per_kpa * calibration.saturation_kpa
    return level * real_contact(pressure_kpa, calibration.saturation_kpa)


def rough_contact_slope(pressure_kpa: NDArray[np.float64], calibration: Calibration) -> NDArray[np.float64]:
    """Derivative of `rough_contact` by the pressure, grey levels per kPa."""
    exponent = -((ERF_SLOPE * pressure_kpa / calibration.saturation_kpa) ** 2)
    return np.asarray(calibration.gain_grey_per_kpa * np.exp(exponent) * (pressure_kpa >= 0), dtype=float)
