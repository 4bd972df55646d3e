"""The pressed body: a slab of tissue with or without one stiff inclusion."""

from __future__ import annotations

from dataclasses import dataclass, replace

from tsis.model import check
from tsis.model.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Inclusion:
    """A homogeneous spherical (or ellipsoidal) inclusion.

    Parameters
    ----------
    diameter_mm
        Diameter d in mm, in [0.1, 100].
    depth_mm
        Depth h in mm from the skin to the TOP of the inclusion, in [0.2, 200].
    young_kpa
        Young's modulus E in kPa, in [0.1, 1e6].
    poisson
        Poisson's ratio, in [0, 0.495].
    offset_mm
        Position (x, y) of its centre relative to the probe's axis, mm.
    semi_axes_mm
        Semi-axes (x, y, z) in mm of an ellipsoid; None for a sphere.

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
        check.number("diameter_mm", self.diameter_mm, 0.1, 100.0, hint="millimetres")
        check.number("depth_mm", self.depth_mm, 0.2, 200.0, hint="millimetres from the skin to the inclusion's top")
        check.number("young_kpa", self.young_kpa, 0.1, 1e6, hint="kilopascals")
        check.number("poisson", self.poisson, 0.0, 0.495)
        object.__setattr__(self, "offset_mm", check.pair("offset_mm", self.offset_mm))
        if self.semi_axes_mm is not None:
            axes = check.array("semi_axes_mm", self.semi_axes_mm, ndim=1)
            if axes.shape != (3,) or axes.min() <= 0:
                raise InputError(f"semi_axes_mm must hold three positive numbers; got {self.semi_axes_mm!r}")
            object.__setattr__(self, "semi_axes_mm", tuple(float(axis) for axis in axes))

    @property
    def is_centred_sphere(self) -> bool:
        """True when the inclusion is a sphere on the probe's axis."""
        return self.offset_mm == (0.0, 0.0) and self.semi_axes_mm is None


@dataclass(frozen=True, slots=True, kw_only=True)
class Phantom:
    """A slab of soft tissue on a rigid chest wall, with at most one inclusion.

    Parameters
    ----------
    young_kpa
        Young's modulus of the tissue in kPa, in [0.05, 2000].
    thickness_mm
        Thickness of the slab in mm, in [2, 500].
    poisson
        Poisson's ratio of the tissue, in [0, 0.495].
    inclusion
        The inclusion, or None for plain tissue.
    name
        What reports call it.
    assumed
        Names of the values that were assumed and not measured.

    Raises
    ------
    InputError
        When a value lies outside its range or the inclusion does not fit into the slab.

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
    name: str = ""
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check.number("young_kpa", self.young_kpa, 0.05, 2000.0, hint="kilopascals; 5 kPa is soft tissue")
        check.number("thickness_mm", self.thickness_mm, 2.0, 500.0, hint="millimetres")
        check.number("poisson", self.poisson, 0.0, 0.495)
        object.__setattr__(self, "assumed", tuple(self.assumed))
        if self.inclusion is None:
            return
        if not isinstance(self.inclusion, Inclusion):
            raise InputError(f"inclusion must be an Inclusion or None; got {self.inclusion!r}")
        bottom = self.inclusion.depth_mm + self.inclusion.diameter_mm
        if bottom >= self.thickness_mm:
            raise InputError(
                f"depth_mm + diameter_mm must be less than thickness_mm = {self.thickness_mm:g}; got {bottom:g}"
            )

    def without_inclusion(self) -> Phantom:
        """The same slab of plain tissue: the baseline of a press."""
        return replace(self, inclusion=None)
