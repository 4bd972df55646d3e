"""A sphere or cylinder pressed on a gel layer: force, dent and pressure by contact.

Small strain, frictionless. The body is a half-space with a parabolic face, as in Hertz's theory; the gel is a layer of
finite thickness. The pressure is a sum of ``(1 - r²/a²)^(m - 1/2)``, m = 1, 2, 3, which vanishes at the edge. Its
displacement of a half-space is a polynomial; what the backing takes off is an integral over wave numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from tsis.model.require import require_number, require_one_of

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]

BODIES = ("sphere", "cylinder")
WIDEST_CONTACT = 10.0  # of contact radius and thickness
_ORDERS = np.arange(1, 4)  # of the terms of the pressure
_POWERS = _ORDERS - 0.5
_PLACES = np.sqrt((np.arange(8) + 0.5) / 8)  # of collocation, over the contact radius
_WAVES, _LAST_WAVE = 300, 18.0  # beyond this wave number times thickness, exp(-2 k t) is below 1e-15


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LayerContact:
    """Contacts of one body on a gel layer, for given contact radii; arrays have one shape.

    Attributes
    ----------
    force
        Force of a sphere in mN, or of a cylinder in mN per mm of its length.
    dent_mm
        How deep the gel's face lies below the untouched face at the middle of the contact.
    peak_kpa
        Pressure at the middle.
    """

    force: Floats
    dent_mm: Floats
    peak_kpa: Floats


def layer_contact(
    contact_radius_mm: ArrayLike,
    *,
    body: Literal["sphere", "cylinder"] = "sphere",
    radius_mm: ArrayLike,
    body_compliance: ArrayLike,
    gel_compliance: ArrayLike,
    thickness_mm: float,
    poisson: float,
) -> LayerContact:
    """Contact of a sphere, or of a long cylinder on its side, with a bonded gel layer.

    Parameters
    ----------
    contact_radius_mm
        Radius of the contact, or half its width for a cylinder, mm.
    body
        ``"sphere"`` or ``"cylinder"``.
    radius_mm
        Radius of the body, mm.
    body_compliance, gel_compliance
        ``(1 - nu²)/E`` of body and gel, 1/kPa; 0 for a rigid body. They broadcast with the radii.
    thickness_mm, poisson
        Of the gel; Poisson's ratio in [0, 0.4999].

    Raises
    ------
    InputError
        When a value is not positive or out of range, or the contact is more than 10 times as wide as the gel is thick.

    Examples
    --------
    A thick gel is a half-space: Hertz's law ``F = 4 E* a³ / (3 R)``.

    >>> contact = layer_contact(0.5, radius_mm=5.0, body_compliance=0.0, gel_compliance=0.01, thickness_mm=1e4,
    ...                         poisson=0.49)
    >>> round(float(contact.force), 6), round(float(contact.dent_mm), 5)
    (3.333333, 0.05)
    """
    require_one_of("body", body, BODIES)
    thickness_mm = require_number("thickness_mm", thickness_mm, 1e-3, 1e6, hint="millimetres")
    poisson = require_number("poisson", poisson, 0.0, 0.4999)
    values = {"contact_radius_mm": contact_radius_mm, "radius_mm": radius_mm}
    values |= {"body_compliance": body_compliance, "gel_compliance": gel_compliance}
    arrays = {name: np.asarray(value, dtype=float) for name, value in values.items()}
    for name, array in arrays.items():
        low = 0.0 if name == "body_compliance" else 1e-12
        for end in (array.min(initial=1.0), array.max(initial=1.0)):
            require_number(name, float(end), low, 1e9)
    contact, radius, soft, gel = np.broadcast_arrays(*arrays.values())
    require_number(
        "contact_radius_mm over thickness_mm", float(contact.max(initial=0.0)) / thickness_mm, 0.0, WIDEST_CONTACT
    )
    force, dent, peak = np.empty((3, contact.size))
    radii, index = np.unique(contact, return_inverse=True)
    for number, one in enumerate(radii.tolist()):
        same = index.ravel() == number
        parts = [array.ravel()[same] for array in (radius, soft, gel)]
        force[same], dent[same], peak[same] = _solve(body, one, *parts, thickness=thickness_mm, poisson=poisson)
    return LayerContact(
        force=force.reshape(contact.shape), dent_mm=dent.reshape(contact.shape), peak_kpa=peak.reshape(contact.shape)
    )


def _solve(
    body: str, contact: float, radius: Floats, soft: Floats, gel: Floats, *, thickness: float, poisson: float
) -> tuple[Floats, Floats, Floats]:
    """Force, dent and peak pressure of contacts of one radius, shape (bodies,)."""
    half, backing, middle = _displacements(body, contact / thickness, poisson)
    stiff, soft = gel[:, None, None], soft[:, None, None]
    shape = contact * ((soft + stiff) * half - stiff * backing)  # displacement of both faces by unit pressures, mm/kPa
    system = np.concatenate([shape, np.broadcast_to(-1.0, (*shape.shape[:2], 1))], axis=2)
    gap = -((contact * _PLACES) ** 2) / (2.0 * radius[:, None])
    pressure = (np.linalg.pinv(system) @ gap[..., None])[:, :-1, 0]
    return pressure @ _resultants(body, contact), contact * gel * (pressure @ middle), pressure.sum(axis=1)


def _resultants(body: str, contact: float) -> Floats:
    """Force of each term of the pressure at 1 kPa, in mN, or in mN per mm for a cylinder."""
    if body == "sphere":
        return np.asarray(np.pi * contact**2 / (_POWERS + 1.0))
    return np.asarray(contact * np.sqrt(np.pi) * _gamma(_POWERS + 1.0) / _gamma(_POWERS + 1.5))


@cache
def _wave_nodes() -> tuple[Floats, Floats]:
    """Nodes from -1 to 1 and weights of the integrals over wave numbers."""
    node, weight = np.polynomial.legendre.leggauss(_WAVES)
    return node, weight


@lru_cache(maxsize=4096)
def _displacements(body: str, ratio: float, poisson: float) -> tuple[Floats, Floats, Floats]:
    """Displacements by each term of the pressure, over the compliance ``(1 - nu²)/E`` and the contact radius.

    At the places of collocation those of a half-space and what the backing takes off, shape (places, terms), and at the
    middle that of the layer, shape (terms,). Those of a cylinder at the places are relative to the middle.
    """
    scale = max(ratio, 4.0 if body == "cylinder" else 0.0)  # the layer's own displacement needs shorter waves
    node, weight = _wave_nodes()
    wave, weight = _LAST_WAVE * scale * (node + 1.0) / 2.0, _LAST_WAVE * scale * weight / 2.0  # over the contact radius
    layer = layer_compliance(wave, young_kpa=1.0, poisson=poisson, thickness_mm=1.0 / ratio)
    factor = layer.normal * wave / (2.0 * (1.0 - poisson**2))  # over that of a half-space
    places = _PLACES[:, None]
    if body == "sphere":
        half = _half_space(places)
        order = _POWERS + 1.0
        transform = 2.0**_POWERS * _gamma(order) * scipy.special.jv(order, wave[:, None]) / wave[:, None] ** order
        missing = 2.0 * (weight * (1.0 - factor))[:, None] * transform
        return half, scipy.special.j0(places * wave) @ missing, _half_space(np.zeros((1, 1)))[0] - missing.sum(axis=0)
    half = -2.0 * np.column_stack(
        [
            places[:, 0] ** 2 / 2,
            3 * places[:, 0] ** 2 / 4 - places[:, 0] ** 4 / 4,
            15 * places[:, 0] ** 2 / 16 - 5 * places[:, 0] ** 4 / 8 + places[:, 0] ** 6 / 6,
        ]
    )
    order = _POWERS + 0.5
    bessel = scipy.special.jv(order, wave[:, None])
    transform = np.sqrt(np.pi) * _gamma(_POWERS + 1) * (2.0 / wave[:, None]) ** order * bessel / wave[:, None]
    backing = (np.cos(places * wave) - 1.0) @ ((weight * (1.0 - factor))[:, None] * transform)
    return half, 2.0 / np.pi * backing, 2.0 / np.pi * (weight * factor) @ transform


def _half_space(places: Floats) -> Floats:
    """Displacement of a half-space by the terms of the pressure, polynomials in the place (Weber and Schafheitlin)."""
    amplitude = np.sqrt(np.pi) * _gamma(_POWERS + 1.0) / _gamma(_POWERS + 1.5)
    return np.asarray(amplitude * scipy.special.hyp2f1(0.5, -_ORDERS, 1.0, places**2))


def _gamma(values: NDArray[np.floating]) -> Floats:
    return np.asarray(scipy.special.gamma(values))


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


PIXELS = 3  # of the Green's function along a cell of traction


def cell_response(
    points: Floats, cells: Floats, pitch_mm: float, *, young_kpa: float, poisson: float, thickness_mm: float
) -> Floats:
    """Displacement (x of all points, then y) by 1 kPa of shear along x, then along y, on square cells of the face."""
    pixel = pitch_mm / PIXELS
    half_width = int(np.ceil((np.abs(points).max() + np.abs(cells).max()) / pixel)) + 2
    grid = GelGrid((2 * half_width + 1,) * 2, (pixel, pixel), young_kpa, poisson, thickness_mm)
    load = np.zeros((2, *grid.shape))
    middle = slice(half_width - PIXELS // 2, half_width + PIXELS // 2 + 1)
    load[0, middle, middle] = 1.0
    along_x, along_y, _ = grid.displacement_mm(np.zeros(grid.shape), load)
    offset = (points[:, None] - cells[None]) / pixel + half_width
    places = (offset[..., 1], offset[..., 0])
    same, across = (scipy.ndimage.map_coordinates(field, places, order=1) for field in (along_x, along_y))
    other = scipy.ndimage.map_coordinates(
        along_x.T, places, order=1
    )  # the layer is isotropic: x and y change their roles
    return np.block([[same, across], [across, other]])


CELLS = 5  # of traction, along a contact's radius
SMOOTHNESS = 0.5  # of the contact's radius: correlation length of the traction
TRACTIONS_KPA = np.geomspace(0.03, 300.0, 17)  # standard deviations of the traction to choose from
WHOLE_SHIFT, MODEL_SHIFT = 0.05, 0.02  # of the largest movement: of all markers together, and of one against another


def shear_of_markers(
    relative: Floats, moved: Floats, radius: float, sd: float, *, young_kpa: float, poisson: float, thickness_mm: float
) -> tuple[Floats, float, float]:
    """Force in N, its standard deviation along one axis, and the fraction of the movement that is explained."""
    pitch = radius / CELLS
    side = (np.arange(2 * CELLS + 1) - CELLS) * pitch
    cells = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    cells = cells[np.hypot(*cells.T) <= radius]
    response = cell_response(relative, cells, pitch, young_kpa=young_kpa, poisson=poisson, thickness_mm=thickness_mm)
    gap = np.hypot(*(cells[:, None] - cells[None]).transpose(2, 0, 1))
    one = np.exp(-(gap**2) / (2.0 * (SMOOTHNESS * radius) ** 2)) + 1e-6 * np.eye(len(cells))
    prior = np.kron(np.eye(2), one)
    data, covariance = moved.T.ravel(), response @ prior @ response.T
    largest = float(np.abs(moved).max())
    noise = (sd**2 + (MODEL_SHIFT * largest) ** 2) * np.eye(data.size)
    noise += (WHOLE_SHIFT * largest) ** 2 * np.kron(np.eye(2), np.ones((len(moved), len(moved))))
    evidence = []
    for size in TRACTIONS_KPA:
        factor = np.linalg.cholesky(size**2 * covariance + noise)
        evidence.append(-np.square(np.linalg.solve(factor, data)).sum() / 2 - np.log(np.diagonal(factor)).sum())
    prior = prior * TRACTIONS_KPA[int(np.argmax(evidence))] ** 2
    gain = np.linalg.solve(response @ prior @ response.T + noise, response @ prior).T
    traction, area = gain @ data, pitch**2 / 1000.0  # kPa mm² are mN
    total = np.repeat(np.eye(2), len(cells), axis=1) * area
    left = total @ (prior - gain @ response @ prior) @ total.T
    left_over = (data - response @ traction).reshape(2, -1)
    left_over -= left_over.mean(axis=1, keepdims=True)
    unexplained = float(np.square(left_over).sum() / max(np.square(data).sum(), 1e-30))
    return total @ traction, float(np.sqrt(max(left[0, 0], 0.0))), 1.0 - unexplained
