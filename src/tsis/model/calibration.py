"""The calibration of a probe and camera, and the map of its light."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tsis.errors import InputError
from tsis.model.content import ContentValue
from tsis.model.exchange import summary_html
from tsis.model.press import interpolation_matrix, require_on_grid
from tsis.model.require import require_array, require_number, require_type

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


# Largest magnitude anywhere; growth in e-folds per mm and bend in e-folds per mm², where lamps reach a tenth.
MOST = {"relative": 1e6, "flux_x": 1e3, "flux_y": 1e3, "growth_per_mm": 10.0, "bend_per_mm2": 100.0}
LEAST_LIGHT = 1e-6
FIELDS = ("relative", "flux_x", "flux_y", "growth_per_mm", "bend_per_mm2")
# Errors of a measured map: Legendre terms along the radius of growth, bend and flux, the light that contact takes, the
# bend of the contact law, and the log gain. The radius ends at this fraction of the face's.
GROWTH_TERMS, BEND_TERMS, FLUX_TERMS = 8, 3, 5
LIGHT_TERMS = GROWTH_TERMS + BEND_TERMS + FLUX_TERMS + 3
LIGHT_REACH, LIGHT_RINGS = 0.8, 20


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LightTerms:
    """Terms of the logarithm of the light of a dented face, for rings of equal width out to `LIGHT_REACH`.

    The arrays have the shape of the coefficients' second axis, or (rings, that axis) where they differ from ring to
    ring.
    """

    growth_per_mm: NDArray[np.float64]
    bend_per_mm2: NDArray[np.float64]
    flux: NDArray[np.float64]
    loss_per_n: NDArray[np.float64]
    square_per_kpa2: NDArray[np.float64]
    log_gain: NDArray[np.float64]

    @classmethod
    def of(cls, coefficients: NDArray[np.float64], rings: int = LIGHT_RINGS) -> Self:
        """Terms of coefficients of the shape (`LIGHT_TERMS`, ...).

        In their order: Legendre coefficients along the radius of growth and bend, and of the flux over the distance
        from the axis in units of the outermost ring's; then the light lost per newton, the bend of the contact law and
        the log gain.
        """
        legendre = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, rings), GROWTH_TERMS - 1)
        distance = (np.arange(rings) + 0.5) / (rings - 0.5)
        growth, bend, flux, (loss, square, gain) = np.split(
            coefficients, np.cumsum([GROWTH_TERMS, BEND_TERMS, FLUX_TERMS])
        )
        return cls(
            growth_per_mm=legendre @ growth,
            bend_per_mm2=legendre[:, :BEND_TERMS] @ bend,
            flux=(distance[:, None] * legendre[:, :FLUX_TERMS]) @ flux,
            loss_per_n=np.asarray(loss),
            square_per_kpa2=np.asarray(square),
            log_gain=np.asarray(gain),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LightMap(ContentValue):
    """Light on the face from inside, over a coarse grid, and its change with displacement and tilt of the face.

    Attributes
    ----------
    x_mm, y_mm
        Coordinates from the probe's axis, shapes (n,) and (m,), ascending. The light is linear between them and
        constant beyond the edge.
    relative
        Power arriving per area of the undented face over its mean on the face, shape (m, n).
    flux_x, flux_y
        Power travelling along x and y over the power travelling into the face, shape (m, n): a face that rises towards
        the glass by ``slope`` in a direction catches ``1 + flux * slope`` times the light.
    growth_per_mm
        The light changes by ``exp(growth_per_mm * displacement + bend_per_mm2 * displacement**2)`` when the face is
        displaced towards the glass, shape (m, n).
    bend_per_mm2
        See ``growth_per_mm``; zero by default.
    factor
        Joint errors of a map that was measured on dents: ``factor @ factor.T`` is the covariance of the coefficients of
        `LightTerms`, the gain among them; shape (`LIGHT_TERMS`, k), or empty where they are not known.
    error
        Root mean square over the face of the standard error of ``relative`` from the number of rays.
    depletion
        When contact absorbs a fraction of the light, the light on the whole face falls by
        ``1 / (1 + depletion * fraction)``; 0 where unknown, or where the map is that of one press.

    Raises
    ------
    InputError
        When a coordinate does not ascend, a value is not finite, a shape is not that of the grid or light is negative.

    Examples
    --------
    >>> light = LightMap.uniform()
    >>> light.at([-1.0, 1.0], [0.0], displacement_mm=0.3, slope_x=0.1, slope_y=0.0).tolist()
    [[1.0, 1.0]]
    """

    x_mm: NDArray[np.float64]
    y_mm: NDArray[np.float64]
    relative: NDArray[np.float64]
    flux_x: NDArray[np.float64]
    flux_y: NDArray[np.float64]
    growth_per_mm: NDArray[np.float64]
    error: float
    depletion: float = 0.0
    bend_per_mm2: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))
    factor: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        shape = require_on_grid(self)
        factor = require_array("factor", self.factor, ndim=2) if np.size(self.factor) else np.zeros((0, 0))
        if factor.size and (len(factor) != LIGHT_TERMS or factor.shape[1] > LIGHT_TERMS):
            raise InputError(f"factor must have {LIGHT_TERMS} rows and at most as many columns; got {factor.shape}")
        factor.flags.writeable = False
        object.__setattr__(self, "factor", factor)
        if isinstance(self.bend_per_mm2, np.ndarray) and not self.bend_per_mm2.size:
            object.__setattr__(self, "bend_per_mm2", np.zeros(shape))
        require_on_grid(self, *FIELDS)
        for name, most in MOST.items():
            require_number(name, float(np.abs(getattr(self, name)).max()), 0.0, most, hint="the largest, either sign")
        require_number("relative", float(self.relative.min()), 0.0, np.inf)
        if self.relative.max() < LEAST_LIGHT:
            raise InputError(f"relative must hold some light, a mean of about 1; got at most {self.relative.max():g}")
        require_number("error", self.error, 0.0, np.inf)
        require_number("depletion", self.depletion, -0.9, 100.0)

    def __eq__(self, other: object) -> bool:
        """Equal by content, like every value without arrays."""
        return isinstance(other, LightMap) and self._content() == other._content()

    def __hash__(self) -> int:
        return hash(self._content())

    def _content(self) -> tuple[bytes | float, ...]:
        arrays = (getattr(self, name).tobytes() for name in ("x_mm", "y_mm", *FIELDS))
        errors = (self.factor.tobytes(),) if self.factor.size else ()  # maps without keep the identity that they had
        return (*arrays, self.error, self.depletion, *errors)

    @property
    def sha256(self) -> str:
        """SHA-256 of the content, which identifies the map in results."""
        return hashlib.sha256(repr(self._content()).encode()).hexdigest()

    @classmethod
    def uniform(cls) -> Self:
        """Constant light, independent of the press."""
        even, none = np.ones((2, 2)), np.zeros((2, 2))
        ends = np.array([-1.0, 1.0])
        return cls(x_mm=ends, y_mm=ends, relative=even, flux_x=none, flux_y=none, growth_per_mm=none, error=0.0)

    def at(
        self,
        x_mm: ArrayLike,
        y_mm: ArrayLike,
        *,
        displacement_mm: ArrayLike = 0.0,
        slope_x: ArrayLike = 0.0,
        slope_y: ArrayLike = 0.0,
    ) -> NDArray[np.float64]:
        """Light on a deformed face over a grid, relative to the mean on the undeformed face; never negative.

        The grid has columns ``x_mm`` (k,) and rows ``y_mm`` (l,). The displacement of the face towards the glass, mm,
        and its derivatives by x and y are numbers or of shape (l, k), as the light is.
        """
        relative, flux_x, flux_y, growth, bend = self.undented(x_mm, y_mm)
        tilt = 1 + flux_x * np.asarray(slope_x) + flux_y * np.asarray(slope_y)
        displacement = np.asarray(displacement_mm)
        return np.asarray(relative * np.exp((growth + bend * displacement) * displacement) * np.maximum(tilt, 0.0))

    def undented(self, x_mm: ArrayLike, y_mm: ArrayLike) -> tuple[NDArray[np.float64], ...]:
        """The five `FIELDS` over a grid, each of shape (len(y_mm), len(x_mm))."""
        rows, columns = interpolation_matrix(self.y_mm, y_mm), interpolation_matrix(self.x_mm, x_mm).T
        return tuple(np.asarray(rows @ getattr(self, name) @ columns) for name in FIELDS)


FRACTIONS = (
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

    The slope at zero pressure, where the light is 1 and the background is subtracted, is ``gain_grey_per_kpa``. The
    relative standard deviations are the uncertainties of the quantities.

    Parameters
    ----------
    gain_grey_per_kpa
        Grey levels per kPa of contact pressure at small pressure.
    saturation_kpa
        Pressure scale at which the real contact area saturates.
    background_grey
        Grey level without contact, subtracted before anything else.
    light
        Variation over the face of the light that reaches the camera, lens included, and its change by a dent. None
        when frames are corrected to even light and its change by a dent was not measured: estimates of inclusions then
        assume usual lamps with wide errors. `LightMap.uniform` states even light that no dent changes.
    gain_sd
        Relative standard deviation of the gain (LED drift included).
    force_sd
        Relative standard deviation of a force reading.
    offset_sd
        Standard deviation of an unknown constant in the corrected image, as a fraction of its mean grey.
    pattern_sd
        Relative standard deviation of the fixed pattern in all frames of this probe.
    repeatability_sd
        Relative standard deviation of a pattern that differs from press to press.
    grain_mm
        Correlation length of these two patterns in mm, in [0.05, 50].
    shading_sd
        Standard deviation of each of three Legendre terms along the radius: the relative error of the log of the
        change of light with displacement and slope of the face.
    site_sd
        Relative standard deviation of the tissue's modulus between the reference site and the target's.
    probe_young_sd
        Relative standard deviation of the moduli of the probe's layers, fully correlated.
    read_noise_grey
        Standard deviation of the noise of a pixel at zero light, grey levels.
    shot_noise_grey
        Variance of the noise of a pixel per grey level.
    name
        Identifies the calibration in every result.
    probe
        Name of the calibrated probe; empty where unknown.
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
        for name in FRACTIONS:
            require_number(name, getattr(self, name), 0.0, 1.0, hint="a fraction")
        require_number("grain_mm", self.grain_mm, 0.05, 50.0, hint="millimetres")
        require_number("read_noise_grey", self.read_noise_grey, 0.0, 1e4)
        require_number("shot_noise_grey", self.shot_noise_grey, 0.0, 1e4)

    def provenance(self) -> dict[str, Any]:
        """The fields by name, with the hash of the light map in place of the map."""
        light = None if self.light is None else self.light.sha256
        return asdict(replace(self, light=None)) | {"light": light}

    def _repr_html_(self) -> str:
        """The response and its uncertainties."""
        light = (
            "even, not measured on dents"
            if self.light is None
            else f"map of {' x '.join(map(str, self.light.relative.shape))} points"
        )
        rows = [
            ("probe", self.probe or "unknown"),
            ("gain", f"{self.gain_grey_per_kpa:.4g} grey levels per kPa, sd {self.gain_sd:.2%}"),
            ("saturation", f"{self.saturation_kpa:.4g} kPa"),
            ("background", f"{self.background_grey:.4g} grey levels"),
            ("force", f"sd {self.force_sd:.2%}"),
            ("light", light),
        ]
        return summary_html(self.name or "Calibration", rows)
