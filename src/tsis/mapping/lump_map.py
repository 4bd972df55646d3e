"""The map: lumps, probability in every voxel, blind zone, next place.

A `LumpMap` behaves like a `tsis.Estimate`: where a check finds that the model does not hold, its numbers are withheld
and asking for them raises; ``untrusted`` has them for those who know what they do.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import InputError, UntrustedError
from tsis.model.content import ContentValue
from tsis.model.estimate import NOT_TRUSTED, Estimate
from tsis.model.require import freeze_mappings, require_array, require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray


LUMP_PARAMETERS = ("x_mm", "y_mm", "centre_depth_mm", "depth_mm", "diameter_mm", "contrast", "young_kpa")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lump(ContentValue):
    """One lump of the map.

    Attributes
    ----------
    name
        ``"lump 1"`` and so on, the most probable first.
    probability
        Probability that a lump is here.
    estimate
        Posterior of x_mm, y_mm, centre_depth_mm, depth_mm (of its TOP, as everywhere in tsis), diameter_mm, contrast
        (its modulus over the tissue's) and young_kpa, given that it is there. A contrast above what can be told is not
        identified: its mean is withheld, and ``contrast_above`` has the bound.
    contrast_above
        The contrast lies above this with a probability of 0.95, where only a bound can be told; else None.
    """

    name: str
    probability: float
    estimate: Estimate
    contrast_above: float | None = None

    def __post_init__(self) -> None:
        require_type("name", self.name, str)
        _require_posterior("estimate", self.estimate, LUMP_PARAMETERS)
        require_number("probability", self.probability, 0.0, 1.0, hint="a probability")


def _require_posterior(name: str, value: object, parameters: tuple[str, ...]) -> None:
    """Require the posterior of these parameters; the whole map is withheld, and none of its parts."""
    require_type(name, value, Estimate)
    assert isinstance(value, Estimate)
    if set(value.names) != set(parameters) or not value.trusted:
        raise InputError(
            f"{name} must be a trusted estimate of {', '.join(parameters)}; got one of {', '.join(value.names):.200}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class NextPlace:
    """A place to press next: x and y in mm, and the expected gain of information there in nats."""

    x_mm: float
    y_mm: float
    gain_nats: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapNumbers(ContentValue):
    """The numbers of a map; those of a `LumpMap` are withheld where they must not be used.

    Attributes
    ----------
    x_mm, y_mm, depth_mm
        Centres of the voxels in the scan's frame, ascending, shapes (nx,), (ny,) and (nz,); the depth is from the skin.
    probability
        Probability that a voxel lies in a lump, shape (nz, ny, nx).
    area_probability
        Probability that a lump's centre lies under an area of ``area_mm`` width around the point, shape (ny, nx).
    area_mm
        Width of that square area.
    modulus_kpa, modulus_sd_kpa
        Posterior mean and standard deviation of Young's modulus of each voxel, lumps and uneven tissue together, shape
        (nz, ny, nx).
    count_probability
        Probability of 0, 1, 2, ... lumps, shape (n,).
    lumps
        Lumps with a probability of at least 0.8, the most probable first.
    unevenness
        Posterior of ``sd``, the standard deviation of the logarithm of the tissue's modulus, and ``length_mm``.
    blind_diameter_mm
        Least diameter of a lump of contrast 5 with its TOP at each depth under each point that the scan would have
        shown nine times in ten; infinite where none of the prior's would, shape (nz, ny, nx).
    next_places
        Where to press next, the largest expected gain first.
    """

    x_mm: NDArray[np.float64]
    y_mm: NDArray[np.float64]
    depth_mm: NDArray[np.float64]
    probability: NDArray[np.float64]
    area_probability: NDArray[np.float64]
    area_mm: float
    modulus_kpa: NDArray[np.float64]
    modulus_sd_kpa: NDArray[np.float64]
    count_probability: NDArray[np.float64]
    lumps: tuple[Lump, ...]
    unevenness: Estimate
    blind_diameter_mm: NDArray[np.float64]
    next_places: tuple[NextPlace, ...]

    def __post_init__(self) -> None:
        for name in ("x_mm", "y_mm", "depth_mm", "count_probability"):
            object.__setattr__(self, name, require_array(name, getattr(self, name), ndim=1))
        shape = (len(self.depth_mm), len(self.y_mm), len(self.x_mm))
        for name in ("probability", "modulus_kpa", "modulus_sd_kpa"):
            values = require_array(name, getattr(self, name), ndim=3)
            if values.shape != shape:
                raise InputError(f"{name} must have the shape {shape} of depth_mm, y_mm and x_mm; got {values.shape}")
            object.__setattr__(self, name, values)
        area, blind = require_array("area_probability", self.area_probability, ndim=2), self.blind_diameter_mm
        blind = np.array(blind, dtype=float)  # may be infinite
        if area.shape != shape[1:] or blind.shape != shape or not (blind >= 0).all():
            raise InputError(
                f"area_probability and blind_diameter_mm must have the shapes {shape[1:]} and {shape}, the diameters "
                f"none below 0; got {area.shape} and {blind.shape}"
            )
        object.__setattr__(self, "area_probability", area)
        blind.flags.writeable = False
        object.__setattr__(self, "blind_diameter_mm", blind)
        _require_posterior("unevenness", self.unevenness, ("sd", "length_mm"))
        for name in ("lumps", "next_places"):
            object.__setattr__(self, name, tuple(getattr(self, name)))

    @property
    def spacing_mm(self) -> tuple[float, float, float]:
        """Widths of the voxels along x, y and depth; 1 along an axis of one voxel."""
        x, y, depth = (
            float(centres[1] - centres[0]) if len(centres) > 1 else 1.0
            for centres in (self.x_mm, self.y_mm, self.depth_mm)
        )
        return x, y, depth


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LumpMap(ContentValue):
    """A map whose numbers are withheld where they must not be used.

    Parameters
    ----------
    untrusted
        The numbers, never withheld.
    trusted
        False where a flag tells that the model does not hold.
    flags, notes
        Short names of warnings, and a sentence for each.
    left_out
        Presses that were not used, each as a sentence with its name and reason.
    places_mm
        Places of the presses that were used, shape (n, 2).
    place_shift_mm
        Posterior mean of the error of each of these places, shape (n, 2).
    provenance
        Version, inputs, prior and settings.

    Raises
    ------
    UntrustedError
        By every number of a map that is not trusted.
    """

    untrusted: MapNumbers
    trusted: bool = True
    flags: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    places_mm: NDArray[np.float64]
    place_shift_mm: NDArray[np.float64]
    provenance: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))

    def __post_init__(self) -> None:
        require_type("untrusted", self.untrusted, MapNumbers)
        require_type("trusted", self.trusted, bool)
        for name in ("flags", "notes", "left_out"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        for name in ("places_mm", "place_shift_mm"):
            places = require_array(name, getattr(self, name), ndim=2)
            if places.shape != (len(self.places_mm), 2):
                raise InputError(f"{name} must have a row of x and y for each press; got the shape {places.shape}")
            object.__setattr__(self, name, places)
        freeze_mappings(self, "provenance")

    @property
    def numbers(self) -> MapNumbers:
        """All numbers of a trusted map."""
        if not self.trusted:
            raise UntrustedError(f"{NOT_TRUSTED} ({', '.join(self.flags)}); .untrusted has them")
        return self.untrusted

    @property
    def lumps(self) -> tuple[Lump, ...]:
        """Lumps with a probability of at least 0.8."""
        return self.numbers.lumps

    @property
    def probability(self) -> NDArray[np.float64]:
        """Probability that a voxel lies in a lump, shape (nz, ny, nx)."""
        return self.numbers.probability

    @property
    def area_probability(self) -> NDArray[np.float64]:
        """Probability of a lump under each area, shape (ny, nx)."""
        return self.numbers.area_probability

    @property
    def count_probability(self) -> NDArray[np.float64]:
        """Probability of 0, 1, 2, ... lumps."""
        return self.numbers.count_probability

    @property
    def unevenness(self) -> Estimate:
        """Posterior of the tissue's unevenness, ``sd`` and ``length_mm``."""
        return self.numbers.unevenness

    @property
    def blind_diameter_mm(self) -> NDArray[np.float64]:
        """Least diameter that the scan would have shown, shape (nz, ny, nx)."""
        return self.numbers.blind_diameter_mm

    @property
    def next_places(self) -> tuple[NextPlace, ...]:
        """Where to press next."""
        return self.numbers.next_places


NEVER_SEEN_MM = 0.0  # in a file, for the infinite diameters of a blind zone, which JSON lacks


def with_finite_numbers(found: LumpMap) -> LumpMap:
    """The map as a file holds it, without infinite numbers."""
    blind = found.untrusted.blind_diameter_mm
    finite = np.where(np.isinf(blind), NEVER_SEEN_MM, blind)
    return replace(found, untrusted=replace(found.untrusted, blind_diameter_mm=finite))


def with_infinite_numbers(found: LumpMap) -> LumpMap:
    """The map whose `with_finite_numbers` a file holds."""
    blind = found.untrusted.blind_diameter_mm
    infinite = np.where(blind == NEVER_SEEN_MM, np.inf, blind)
    return replace(found, untrusted=replace(found.untrusted, blind_diameter_mm=infinite))
