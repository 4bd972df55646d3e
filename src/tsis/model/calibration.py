"""How a probe's grey levels answer to pressure, and how well that is known."""

from __future__ import annotations

from dataclasses import dataclass

from tsis.model.check import require_number, require_type
from tsis.model.errors import InputError
from tsis.model.light_map import LightMap

SHARES = (
    "gain_sd",
    "force_sd",
    "offset_sd",
    "pattern_sd",
    "repeatability_sd",
    "shading_sd",
    "site_sd",
    "probe_young_sd",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Rough-contact response of a probe and camera: ``grey = light * gain * saturation * erf(0.886 p / saturation)``.

    The slope at zero pressure, where the light is 1 and the background was taken away, is ``gain_grey_per_kpa``. The
    relative standard deviations say how well each quantity is known.

    Parameters
    ----------
    gain_grey_per_kpa
        Grey levels per kPa of contact pressure at small pressure.
    saturation_kpa
        Pressure scale at which the real contact area saturates.
    background_grey
        Grey level without contact, subtracted before anything else.
    light
        How the light that reaches the camera varies over the face, lens and all; None when it is even or was corrected.
    gain_sd
        Relative standard deviation of the gain (LED drift included).
    force_sd
        Relative standard deviation of a force reading.
    offset_sd
        Standard deviation of an unknown constant in the corrected image, as a share of its mean grey.
    pattern_sd
        Relative standard deviation of the fixed pattern that all frames of this probe share.
    repeatability_sd
        Relative standard deviation of a pattern that each press leaves anew.
    grain_mm
        Width of a grain of these two patterns, in [0.05, 50]: places closer than that err alike.
    shading_sd
        Standard deviation of each of three Legendre terms along the radius, by which the log of what displacement and
        slope of the face do to the light is off, as a share of it.
    site_sd
        Relative standard deviation of the tissue's modulus between the reference site and the target's.
    probe_young_sd
        Relative standard deviation of the moduli of the probe's layers, which err together.
    read_noise_grey
        Standard deviation of one pixel's noise at zero light, grey levels.
    shot_noise_grey
        Variance per grey level of one pixel's noise.
    name
        Identifies the calibration in every result.
    probe
        Name of the probe that was calibrated; empty when nobody wrote it down.
    """

    gain_grey_per_kpa: float
    saturation_kpa: float
    background_grey: float = 0.0
    light: LightMap | None = None
    gain_sd: float = 0.01
    force_sd: float = 0.01
    offset_sd: float = 0.01
    pattern_sd: float = 0.002
    repeatability_sd: float = 0.0005
    grain_mm: float = 0.5
    shading_sd: float = 0.2
    site_sd: float = 0.03
    probe_young_sd: float = 0.03
    read_noise_grey: float = 1.0
    shot_noise_grey: float = 0.025
    name: str = ""
    probe: str = ""

    def __post_init__(self) -> None:
        require_type("name", self.name, str)
        require_type("probe", self.probe, str)
        require_number("gain_grey_per_kpa", self.gain_grey_per_kpa, 1e-6, 1e6)
        require_number("saturation_kpa", self.saturation_kpa, 1e-3, 1e6)
        require_number("background_grey", self.background_grey, 0.0, 65535.0)
        if self.light is not None and not isinstance(self.light, LightMap):
            raise InputError(f"light must be a LightMap or None; got {self.light!r:.80}")
        for name in SHARES:
            require_number(name, getattr(self, name), 0.0, 1.0, hint="a share of one")
        require_number("grain_mm", self.grain_mm, 0.05, 50.0, hint="millimetres")
        require_number("read_noise_grey", self.read_noise_grey, 0.0, 1e4)
        require_number("shot_noise_grey", self.shot_noise_grey, 0.0, 1e4)
