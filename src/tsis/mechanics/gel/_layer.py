"""Green's functions of an elastic layer that is bonded to a rigid backing, in wave numbers, and their use on a grid.

Coordinates: x along the columns, y along the rows, z into the gel. A pressure pushes along z; a traction t acts on the
gel's face. For waves ``exp(i k.x)`` the surface moves by

    w = C_n p - i C_c t_l,    u_l = C_t t_l + i C_c p,    u_a = C_a t_a

with l along the wave vector and a across it. Small strain.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.fft
from numpy.typing import ArrayLike, NDArray

from tsis.model import require_number

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]

LARGEST_RATIO = 0.4999
_DEEP = 40.0  # wave number times thickness beyond which the layer is a half-space to the last digit
_MARGIN = 4.0  # thicknesses of empty gel around the grid, so that its periodic images do not act


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LayerCompliance:
    """Surface displacement by unit surface traction, mm/kPa, over wave numbers; see the module's equations.

    Attributes
    ----------
    normal, tangential, coupling, across
        ``C_n``, ``C_t``, ``C_c`` and ``C_a``.
    """

    normal: Floats
    tangential: Floats
    coupling: Floats
    across: Floats


def layer_compliance(
    wave_number_per_mm: ArrayLike, *, young_kpa: float, poisson: float, thickness_mm: float
) -> LayerCompliance:
    """Compliance of a bonded layer at wave numbers in rad/mm, zero included.

    Parameters
    ----------
    wave_number_per_mm
        Wave numbers, not negative, any shape.
    young_kpa, poisson, thickness_mm
        The layer; Poisson's ratio in [0, 0.4999].

    Raises
    ------
    InputError
        When a value lies outside its range.

    Notes
    -----
    With ``q = k h``, ``c = 3 - 4 nu`` and ``D = 2 c cosh 2q + 1 + c² + 4 q²`` the plane-strain compliances over
    ``2 (1 - nu²) / (E k)`` are ``(2 c sinh 2q -+ 4 q) / D`` (normal, tangential) and ``(2 c (c - 1) (cosh 2q - 1)
    - 8 q²) / ((c + 1) D)`` (coupling); across the wave it is ``tanh q / (G k)``. The normal one is Johnson, Contact
    Mechanics, 5.8.

    Examples
    --------
    The layer under an even pressure, which cannot spread sideways:

    >>> even = layer_compliance(0.0, young_kpa=100.0, poisson=0.49, thickness_mm=4.0)
    >>> round(float(even.normal), 6), round(4.0 * 1.49 * 0.02 / (100.0 * 0.51), 6)
    (0.002337, 0.002337)
    """
    young = require_number("young_kpa", young_kpa, 1e-6, 1e12, hint="kilopascals")
    ratio = require_number("poisson", poisson, 0.0, LARGEST_RATIO)
    thickness = require_number("thickness_mm", thickness_mm, 1e-3, 1e6, hint="millimetres")
    k = np.asarray(wave_number_per_mm, dtype=float)
    # below 1e-3 the differences lose digits; the compliance is flat there to 1e-6
    q = np.clip(k * thickness, 1e-3, None)
    deep = np.minimum(q, _DEEP)
    c = 3.0 - 4.0 * ratio
    decay = np.exp(-2.0 * deep)  # numerators and denominator times 2 exp(-2q), so that nothing overflows
    below = 2.0 * c * (1.0 + decay**2) + 2.0 * (1.0 + c**2 + 4.0 * deep**2) * decay
    odd, step = 2.0 * c * (1.0 - decay**2), 8.0 * deep * decay
    mixed = 2.0 * c * (c - 1.0) * (1.0 - decay) ** 2 - 16.0 * deep**2 * decay
    half_space = 2.0 * (1.0 - ratio**2) * thickness / (young * q)
    return LayerCompliance(
        normal=half_space * (odd - step) / below,
        tangential=half_space * (odd + step) / below,
        coupling=half_space * mixed / ((c + 1.0) * below),
        across=2.0 * (1.0 + ratio) * thickness / (young * q) * np.tanh(deep),
    )


@dataclass(frozen=True)
class GelGrid:
    """A grid of pixels on the face of a bonded gel layer, on which tractions become displacements by FFT.

    The pixels are surrounded by untouched gel of four thicknesses, so that the face counts as endless.

    Parameters
    ----------
    shape
        Rows and columns.
    mm_per_pixel
        Size (x, y) of a pixel.
    young_kpa, poisson, thickness_mm
        The gel as in `layer_compliance`.
    """

    shape: tuple[int, int]
    mm_per_pixel: tuple[float, float]
    young_kpa: float
    poisson: float
    thickness_mm: float

    @cached_property
    def padded(self) -> tuple[int, int]:
        """Rows and columns with the empty gel."""
        rows, columns = (
            scipy.fft.next_fast_len(count + int(np.ceil(_MARGIN * self.thickness_mm / size)), real=True)
            for count, size in zip(self.shape, self.mm_per_pixel[::-1], strict=True)
        )
        return rows, columns

    @cached_property
    def waves(self) -> tuple[Floats, Floats, Floats]:
        """Components (x, y) and length of the wave vectors of the real FFT, rad/mm."""
        rows, columns = self.padded
        x = 2 * np.pi * scipy.fft.rfftfreq(columns, self.mm_per_pixel[0])[None, :]
        y = 2 * np.pi * scipy.fft.fftfreq(rows, self.mm_per_pixel[1])[:, None]
        return x, y, np.hypot(x, y)

    @cached_property
    def compliance(self) -> LayerCompliance:
        """Compliance at those wave vectors."""
        return layer_compliance(
            self.waves[2], young_kpa=self.young_kpa, poisson=self.poisson, thickness_mm=self.thickness_mm
        )

    def spectrum(self, values: Floats) -> Complex:
        """FFT of values on the pixels, with the empty gel around them."""
        return np.asarray(scipy.fft.rfft2(values, s=self.padded))

    def back(self, spectrum: Complex) -> Floats:
        """Values on the pixels."""
        return np.asarray(scipy.fft.irfft2(spectrum, s=self.padded)[: self.shape[0], : self.shape[1]])

    def depth_mm(self, pressure_kpa: Floats) -> Floats:
        """How deep a pressure alone pushes the face in."""
        return self.back(self.compliance.normal * self.spectrum(pressure_kpa))

    def displacement_mm(self, pressure_kpa: Floats, shear_kpa: Floats) -> Floats:
        """Displacement (x, y, z) of the face by pressure and shear, shape (3, rows, columns).

        ``shear_kpa`` has the shape (2, rows, columns): tractions along x and y on the gel.
        """
        x, y, k = self.waves
        along_x, along_y = (np.divide(part, k, out=np.zeros_like(k), where=k > 0) for part in (x + 0 * y, y + 0 * x))
        p, shear_x, shear_y = (self.spectrum(part) for part in (pressure_kpa, shear_kpa[0], shear_kpa[1]))
        along, across = along_x * shear_x + along_y * shear_y, along_x * shear_y - along_y * shear_x
        still = k == 0  # the even shear has no direction
        c = self.compliance
        u_along, u_across = c.tangential * along + 1j * c.coupling * p, c.across * across
        return np.stack(
            [
                self.back(np.where(still, c.tangential * shear_x, along_x * u_along - along_y * u_across)),
                self.back(np.where(still, c.tangential * shear_y, along_y * u_along + along_x * u_across)),
                self.back(c.normal * p - 1j * c.coupling * along),
            ]
        )
