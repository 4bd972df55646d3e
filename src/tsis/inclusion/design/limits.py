"""Limits of a planned press by model and camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.inclusion.frames import OUTER_FRACTION, covering_force_n, nominal_strains
from tsis.mechanics.small_strain.linear_press import STRAIN_LIMIT

if TYPE_CHECKING:
    from tsis.inclusion.design.information import PlannedView
    from tsis.inclusion.prior import Floats


ROUNDING = 1e-9  # relative: a force chosen on a limit satisfies it


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignLimits:
    """Values of a protocol that are limited.

    Attributes
    ----------
    strain
        Nominal strain of the strongest press on tissue without inclusion; at most 0.3 for small strain.
    least_force_n
        Force of the weakest press.
    covering_force_n
        Least force in newtons at which the contact covers the face on tissue without inclusion; 0 for a flat face.
    whole_fraction
        Fraction of the inclusions with full contact in the weakest press. Estimates of the others are not trusted.
    brightest_grey
        Largest grey level of any press, background included.
    full_scale
        Grey level at which the camera clips.
    read_mm
        Diameter of the evaluated face.
    view_mm
        Shorter side of the picture on the face.
    """

    strain: float
    least_force_n: float
    covering_force_n: float
    whole_fraction: float
    brightest_grey: float
    full_scale: float
    read_mm: float
    view_mm: float

    @property
    def broken(self) -> dict[str, str]:
        """Messages of the violated limits, by name: strain, contact, saturation or view."""
        slack, findings = 1 + ROUNDING, dict[str, str]()
        if self.strain > STRAIN_LIMIT * slack:
            findings["strain"] = (
                f"The nominal strain is {self.strain:.2f}; the limit of small strain is {STRAIN_LIMIT:g}: press less."
            )
        if self.least_force_n * slack < self.covering_force_n:
            findings["contact"] = (
                f"At {self.least_force_n:.2g} N the face touches the tissue only in part; full contact needs "
                f"{self.covering_force_n:.2g} N: press more."
            )
        if self.brightest_grey >= self.full_scale:
            findings["saturation"] = (
                f"The brightest point has {self.brightest_grey:.0f} grey levels; the camera clips at "
                f"{self.full_scale:g}: expose less."
            )
        if self.read_mm > self.view_mm * slack:
            findings["view"] = (
                f"The profile covers {self.read_mm:.1f} mm of the face; "
                f"the picture shows {self.view_mm:.1f} mm: use another lens."
            )
        return findings


def limits_of(view: PlannedView, inclusions: Floats) -> DesignLimits:
    """The limited values of a protocol without inclusion and on the inclusions (n, 3)."""
    forces, sensor = view.protocol.forces_n, view.sensor
    strain_at_no_force, per_newton = nominal_strains(view.surrogate, probe=view.protocol.probe, prior=view.model.prior)
    sides = (sensor.columns * sensor.mm_per_pixel[0], sensor.rows * sensor.mm_per_pixel[1])
    return DesignLimits(
        strain=strain_at_no_force + max(forces) * per_newton,
        least_force_n=min(forces),
        covering_force_n=_covering_force_n(view, None),
        whole_fraction=sum(
            _covering_force_n(view, inclusion) <= min(forces) * (1 + ROUNDING) for inclusion in inclusions
        )
        / len(inclusions),
        brightest_grey=float(max(view.grey(None).max(), view.grey(inclusions).max())),
        full_scale=sensor.full_scale,
        read_mm=2 * OUTER_FRACTION * view.protocol.probe.radius_mm,
        view_mm=min(sides),
    )


def greatest_covering_force_n(view: PlannedView, inclusions: Floats) -> float:
    """Least force at which the contact covers the face without inclusion and on all inclusions (n, 3)."""
    return max(_covering_force_n(view, inclusion) for inclusion in (None, *inclusions))


def _covering_force_n(view: PlannedView, inclusion: Floats | None) -> float:
    return covering_force_n(view.surrogate, view.model.prior, inclusion)
