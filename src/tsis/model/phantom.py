"""Pressed bodies: a slab of tissue with or without inclusions, and a soft sphere."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import InputError
from tsis.model.require import require_array, require_number, require_pair, require_type

if TYPE_CHECKING:
    from numpy.typing import NDArray


INCLUSION_RANGES = {"diameter_mm": (0.1, 100.0), "depth_mm": (0.2, 200.0), "young_kpa": (0.1, 1e6)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Inclusion:
    """A homogeneous spherical or ellipsoidal inclusion.

    Parameters
    ----------
    diameter_mm
        Diameter d in mm, in [0.1, 100]; for an ellipsoid nominal.
    depth_mm
        Depth h in mm from the skin to the TOP of the inclusion, in [0.2, 200].
    young_kpa
        Young's modulus E in kPa, in [0.1, 1e6].
    poisson
        Poisson's ratio, in [0, 0.495].
    offset_mm
        Position (x, y) of its centre relative to the probe's axis, mm.
    semi_axes_mm
        Semi-axes (x, y, z) in mm of an ellipsoid, z along the probe's axis; None for a sphere.

    Raises
    ------
    InputError
        When a value lies outside its range.
    """

    diameter_mm: float
    depth_mm: float
    young_kpa: float
    poisson: float = 0.49
    offset_mm: tuple[float, float] = (0.0, 0.0)
    semi_axes_mm: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        within = INCLUSION_RANGES
        require_number("diameter_mm", self.diameter_mm, *within["diameter_mm"], hint="millimetres")
        from_skin = "millimetres from the skin to the inclusion's top"
        require_number("depth_mm", self.depth_mm, *within["depth_mm"], hint=from_skin)
        require_number("young_kpa", self.young_kpa, *within["young_kpa"], hint="kilopascals")
        require_number("poisson", self.poisson, 0.0, 0.495)
        object.__setattr__(self, "offset_mm", require_pair("offset_mm", self.offset_mm))
        if self.semi_axes_mm is not None:
            axes = require_array("semi_axes_mm", self.semi_axes_mm, ndim=1)
            if axes.shape != (3,) or axes.min() <= 0:
                raise InputError(f"semi_axes_mm must hold three positive numbers; got {self.semi_axes_mm!r}")
            object.__setattr__(self, "semi_axes_mm", tuple(float(axis) for axis in axes))

    @property
    def half_axes_mm(self) -> tuple[float, float, float]:
        """Semi-axes (x, y, z) in mm, for a sphere too."""
        return self.semi_axes_mm or (self.diameter_mm / 2,) * 3

    @property
    def centre_depth_mm(self) -> float:
        """Depth of its centre under the skin, mm."""
        return self.depth_mm + self.half_axes_mm[2]

    @property
    def bottom_mm(self) -> float:
        """Depth of its lowest point under the skin, mm."""
        return self.depth_mm + 2 * self.half_axes_mm[2]

    @property
    def is_axisymmetric(self) -> bool:
        """True for a sphere or spheroid around the probe's axis."""
        x, y, _ = self.half_axes_mm
        return self.offset_mm == (0.0, 0.0) and x == y


@dataclass(frozen=True, slots=True, kw_only=True)
class Phantom:
    """A slab of soft tissue on a rigid chest wall, with or without inclusions.

    Parameters
    ----------
    young_kpa
        Young's modulus of the tissue in kPa, in [0.05, 2000].
    thickness_mm
        Thickness of the slab in mm, in [2, 500].
    poisson
        Poisson's ratio of the tissue, in [0, 0.495].
    inclusion
        The inclusion, or None.
    more_inclusions
        Further inclusions, for the three-dimensional model alone.
    name
        Name in reports.
    assumed
        Names of the values that were assumed, not measured.

    Raises
    ------
    InputError
        When a value lies outside its range, an inclusion does not fit into the slab, or two overlap.

    Examples
    --------
    >>> lump = Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0)
    >>> phantom = Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=lump)
    >>> phantom.without_inclusion().inclusion is None
    True
    """

    young_kpa: float
    thickness_mm: float
    poisson: float = 0.49
    inclusion: Inclusion | None = None
    more_inclusions: tuple[Inclusion, ...] = ()
    name: str = ""
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require_number("young_kpa", self.young_kpa, 0.05, 2000.0, hint="kilopascals; 5 kPa is soft tissue")
        require_number("thickness_mm", self.thickness_mm, 2.0, 500.0, hint="millimetres")
        require_number("poisson", self.poisson, 0.0, 0.495)
        object.__setattr__(self, "assumed", tuple(self.assumed))
        object.__setattr__(self, "more_inclusions", tuple(self.more_inclusions))
        if self.inclusion is not None and not isinstance(self.inclusion, Inclusion):
            raise InputError(f"inclusion must be an Inclusion or None; got {self.inclusion!r}")
        if self.more_inclusions and self.inclusion is None:
            raise InputError("more_inclusions must stay empty where inclusion is None; give the first as inclusion")
        for inclusion in self.inclusions:
            if inclusion.bottom_mm >= self.thickness_mm:
                raise InputError(
                    f"depth_mm + diameter_mm must be less than thickness_mm = {self.thickness_mm:g}; "
                    f"got {inclusion.bottom_mm:g}"
                )
        for inclusion, other in combinations(self.inclusions, 2):
            _refuse_meeting(inclusion, other)

    @property
    def inclusions(self) -> tuple[Inclusion, ...]:
        """All inclusions."""
        return () if self.inclusion is None else (self.inclusion, *self.more_inclusions)

    @property
    def is_axisymmetric(self) -> bool:
        """True without inclusion and for one sphere or spheroid around the probe's axis."""
        return all(inclusion.is_axisymmetric for inclusion in self.inclusions) and not self.more_inclusions

    def without_inclusion(self) -> Phantom:
        """The same slab without inclusions: the baseline of a press."""
        return replace(self, inclusion=None, more_inclusions=())

    def on_tissue(self, young_kpa: float) -> Phantom:
        """The same slab of tissue with another modulus in kPa; inclusions keep their contrast.

        Examples
        --------
        >>> lump = Inclusion(diameter_mm=8, depth_mm=5, young_kpa=100)
        >>> Phantom(young_kpa=5, thickness_mm=30, inclusion=lump).on_tissue(10).inclusion.young_kpa
        200.0
        """
        stiffer = young_kpa / self.young_kpa
        changed = [replace(item, young_kpa=stiffer * item.young_kpa) for item in self.inclusions]
        inclusion = changed[0] if changed else None
        return replace(self, young_kpa=young_kpa, inclusion=inclusion, more_inclusions=tuple(changed[1:]))


def _refuse_meeting(item: Inclusion, other: Inclusion) -> None:
    # An ellipsoid counts as its circumscribed sphere.
    centres = np.array([[*inclusion.offset_mm, inclusion.centre_depth_mm] for inclusion in (item, other)])
    difference = float(np.linalg.norm(centres[0] - centres[1]))
    extent = max(item.half_axes_mm) + max(other.half_axes_mm)
    if difference <= extent:
        raise InputError(f"inclusions must not meet: centres at least {extent:g} mm apart; got {difference:g}")


@dataclass(frozen=True, slots=True, kw_only=True)
class SoftSphere:
    """A homogeneous elastic sphere.

    Parameters
    ----------
    radius_mm
        Radius in mm, in [0.1, 50].
    young_kpa
        Young's modulus in kPa, in [0.1, 1e6].
    poisson
        Poisson's ratio, in [0, 0.495].
    name
        Name in reports.

    Raises
    ------
    InputError
        When a value lies outside its range.
    """

    radius_mm: float
    young_kpa: float
    poisson: float = 0.49
    name: str = ""

    def __post_init__(self) -> None:
        require_number("radius_mm", self.radius_mm, 0.1, 50.0, hint="millimetres")
        require_number("young_kpa", self.young_kpa, 0.1, 1e6, hint="kilopascals")
        require_number("poisson", self.poisson, 0.0, 0.495)
        require_type("name", self.name, str)


@dataclass(frozen=True, slots=True, kw_only=True)
class Relaxation:
    """A Prony series of the modulus; one term is the standard linear solid.

    The modulus relaxes from the instantaneous ``young_kpa / (1 - sum(shares))`` to ``young_kpa``, that of the phantom,
    as ``E(t) = E(0) * (1 - sum(share * (1 - exp(-t / time))))``. Poisson's ratio is constant.

    Parameters
    ----------
    shares
        Fraction of the instantaneous modulus that each term loses, in (0, 1), with a sum of at most 0.99.
    times_s
        Time constants of the terms in s, in [1e-4, 1e6], all different.

    Raises
    ------
    InputError
        When a value lies outside its range, or the lengths differ.

    Examples
    --------
    >>> tissue = Relaxation(shares=(0.3,), times_s=(2.0,))
    >>> f"{float(tissue.modulus_ratio(2.0)):.4f}"
    '1.1577'
    """

    shares: tuple[float, ...]
    times_s: tuple[float, ...]

    def __post_init__(self) -> None:
        fractions, times = (require_array(name, getattr(self, name), ndim=1) for name in ("shares", "times_s"))
        if fractions.shape != times.shape:
            raise InputError(f"shares and times_s must have one value a term; got {fractions.size} and {times.size}")
        for fraction in fractions.tolist():
            require_number("shares", fraction, 1e-6, 0.99, hint="shares of the instantaneous modulus")
        for time in times.tolist():
            require_number("times_s", time, 1e-4, 1e6, hint="seconds")
        if fractions.sum() > 0.99:
            raise InputError(f"shares must add up to at most 0.99, or nothing is left; got {fractions.sum():g}")
        if len(set(times.tolist())) < times.size:
            raise InputError(f"times_s must all differ; got {self.times_s!r}; add the shares of equal ones")
        object.__setattr__(self, "shares", tuple(fractions.tolist()))
        object.__setattr__(self, "times_s", tuple(times.tolist()))

    @property
    def instantaneous_ratio(self) -> float:
        """Instantaneous over relaxed modulus, > 1."""
        return 1 / (1 - sum(self.shares))

    def modulus_ratio(self, time_s: Any) -> NDArray[np.float64]:
        """Modulus at ``time_s`` after a step of strain, over the relaxed modulus."""
        relaxed = 1 - np.exp(-np.asarray(time_s, dtype=float)[..., None] / np.array(self.times_s))
        return np.asarray(self.instantaneous_ratio * (1 - relaxed @ np.array(self.shares)))
