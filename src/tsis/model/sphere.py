"""A soft sphere that is touched directly."""

from __future__ import annotations

from dataclasses import dataclass

from tsis.model.check import require_number, require_type


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
        What reports call it.

    Raises
    ------
    InputError
        When a value lies outside its range.

    Examples
    --------
    >>> SoftSphere(radius_mm=3.0, young_kpa=103.0).poisson
    0.49
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
