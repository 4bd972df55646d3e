"""Prior of inclusion and tissue."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tsis.catalog.priors import inclusion_prior_toml, list_inclusion_priors, parse_prior, read_prior_file
from tsis.errors import InputError
from tsis.mechanics.surrogate.polynomial import Box
from tsis.model.require import require_number, require_pair, require_type

Booleans = NDArray[np.bool]
Complexes = NDArray[np.complex128]
Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

LIMITS = {"diameter_mm": (0.1, 100.0), "depth_mm": (0.2, 200.0), "young_kpa": (0.1, 1e5)}
PARAMETERS = tuple(LIMITS)
LONGEST_NAME, DEFAULT_NAME = 100, "phantom-2011"
LEAST_WIDTH = 0.01  # least relative width of a range; the grid does not resolve narrower ones
TISSUE_RANGE_SD, THICKNESS_RANGE_SD = 2.6, 1.8  # range of the surrogate; `CLEARANCE` may shorten it
CLEARANCE = 1.02  # the surrogate's thinnest slab over the deepest inclusion


@dataclass(frozen=True, slots=True, kw_only=True)
class InclusionPrior:
    """Uniform ranges of the inclusion, and normal distributions of the slab around it.

    Parameters
    ----------
    diameter_mm, depth_mm, young_kpa
        Ranges (low, high) of the inclusion; the defaults are the dissertation's, without the vanishing diameter.
    tissue_young_kpa, tissue_young_sd
        Modulus of the tissue and its relative standard deviation.
    thickness_mm, thickness_sd
        Thickness of the slab and its relative standard deviation.
    poisson, poisson_sd
        Common Poisson's ratio of tissue and inclusion, and its standard deviation.
    offset_sd_mm
        Standard deviation of either coordinate of the inclusion from the probe's axis, before the frames show it.
    heterogeneity_sd
        Largest standard deviation of the logarithm of the tissue's modulus from place to place, in [0, 0.45]; smaller
        ones are equally probable, and correlation lengths from 2 to 13 mm. 0 is even tissue.
    presence
        Probability of an inclusion, in [0.001, 0.999].
    name
        Names the prior in every result; printable, at most 100 characters.

    Raises
    ------
    InputError
        When a range is empty or the deepest inclusion does not fit into the slab.

    Examples
    --------
    >>> {name: round(sd, 2) for name, sd in InclusionPrior().sd.items()}
    {'diameter_mm': 4.04, 'depth_mm': 2.31, 'young_kpa': 23.09}
    """

    diameter_mm: tuple[float, float] = (1.0, 15.0)
    depth_mm: tuple[float, float] = (4.0, 12.0)
    young_kpa: tuple[float, float] = (40.0, 120.0)
    tissue_young_kpa: float = 5.0
    tissue_young_sd: float = 0.1
    thickness_mm: float = 30.0
    thickness_sd: float = 0.1
    poisson: float = 0.49
    poisson_sd: float = 0.002
    offset_sd_mm: float = 1.0
    heterogeneity_sd: float = 0.3
    presence: float = 0.5
    name: str = ""

    def __post_init__(self) -> None:
        require_type("name", self.name, str)
        if len(self.name) > LONGEST_NAME or not self.name.isprintable():
            raise InputError(f"name must be printable, at most {LONGEST_NAME} characters; got {self.name!r:.120}")
        require_number("poisson_sd", self.poisson_sd, 0.0, 0.05)
        require_number("offset_sd_mm", self.offset_sd_mm, 0.0, 5.0, hint="millimetres")
        require_number("heterogeneity_sd", self.heterogeneity_sd, 0.0, 0.45, hint="a relative standard deviation")
        require_number("presence", self.presence, 0.001, 0.999, hint="a probability")
        require_number("tissue_young_kpa", self.tissue_young_kpa, 0.05, 2000.0, hint="kilopascals")
        require_number("tissue_young_sd", self.tissue_young_sd, 1e-4, 0.3, hint="a fraction")
        require_number("thickness_mm", self.thickness_mm, 2.0, 500.0, hint="millimetres")
        require_number("thickness_sd", self.thickness_sd, 1e-4, 0.2, hint="a fraction")
        for name, (least, greatest) in LIMITS.items():
            low, high = require_pair(name, getattr(self, name))
            require_number(f"the low end of {name}", low, least, greatest)
            require_number(f"the high end of {name}", high, low * (1 + LEAST_WIDTH), greatest, hint="above the low end")
            object.__setattr__(self, name, (low, high))
        if self.young_kpa[0] <= self.box().tissue_young_kpa[1]:  # the box raises where an inclusion does not fit
            raise InputError(
                f"young_kpa must lie above tissue_young_kpa and its spread, {self.box().tissue_young_kpa[1]:g}: "
                f"an inclusion stiffer than its surroundings; got {self.young_kpa[0]:g}"
            )

    @property
    def low(self) -> Floats:
        """Lower ends of the ranges, in the order of `PARAMETERS`."""
        return np.array([getattr(self, name)[0] for name in PARAMETERS])

    @property
    def high(self) -> Floats:
        """Upper ends of the ranges, in the order of `PARAMETERS`."""
        return np.array([getattr(self, name)[1] for name in PARAMETERS])

    @property
    def sd(self) -> dict[str, float]:
        """Prior standard deviation of each parameter."""
        return dict(zip(PARAMETERS, ((self.high - self.low) / np.sqrt(12.0)).tolist(), strict=True))

    def __str__(self) -> str:
        name = self.name or (DEFAULT_NAME if self == InclusionPrior() else "")
        return (
            f"{name}{': ' if name else ''}diameter {_range(self.diameter_mm)} mm, depth {_range(self.depth_mm)} mm, "
            f"modulus {_range(self.young_kpa)} kPa, each uniform; tissue {self.tissue_young_kpa:g} kPa ± "
            f"{100 * self.tissue_young_sd:g} %, {self.thickness_mm:g} mm ± {100 * self.thickness_sd:g} % thick, "
            f"Poisson's ratio {self.poisson:g} ± {self.poisson_sd:g}, "
            f"{_unevenness(self.heterogeneity_sd)}; {self.offset_sd_mm:g} mm from the axis before "
            f"the frames show it; an inclusion with probability {self.presence:g}"
        )

    def box(self) -> Box:
        """Ranges of the surrogate."""
        deepest = self.depth_mm[1] + self.diameter_mm[1]
        if CLEARANCE * deepest >= self.thickness_mm:
            raise InputError(
                f"the largest depth_mm + diameter_mm must be less than thickness_mm = {self.thickness_mm:g} by "
                f"{100 * (CLEARANCE - 1):.0f} %; got {deepest:g} (narrow the prior)"
            )
        tissue = np.exp(TISSUE_RANGE_SD * self.tissue_young_sd)
        slab = np.exp(THICKNESS_RANGE_SD * self.thickness_sd)
        return Box(
            diameter_mm=self.diameter_mm,
            depth_mm=self.depth_mm,
            young_kpa=self.young_kpa,
            tissue_young_kpa=(self.tissue_young_kpa / tissue, self.tissue_young_kpa * tissue),
            thickness_mm=(max(CLEARANCE * deepest, self.thickness_mm / slab), self.thickness_mm * slab),
            poisson=self.poisson,
        )


def load_prior(name: str) -> InclusionPrior:
    """Load a shipped prior by its name, or one from a TOML file by its path.

    Raises
    ------
    FileInputError
        When ``name`` is no shipped prior, and the file is missing or no prior.

    Examples
    --------
    >>> load_prior("breast-ex-vivo").young_kpa
    (7.5, 65.0)
    """
    if name not in list_inclusion_priors():
        return read_prior_file(name, InclusionPrior)
    return replace(parse_prior(inclusion_prior_toml(name), InclusionPrior), name=name)


def _unevenness(sd: float) -> str:
    return f"uneven by up to {100 * sd:g} %" if sd else "even"


def _range(ends: tuple[float, float]) -> str:
    return f"{ends[0]:g} to {ends[1]:g}"
