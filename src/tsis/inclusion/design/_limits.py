"""What a planned press must keep to, for the model of an estimate to hold and the camera to see it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.inclusion._frames import OUTER_FRACTION, covering_force_n, largest_force_n, nominal_strains
from tsis.mechanics.small_strain import STRAIN_LIMIT

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tsis.inclusion.design._information import PlannedView


ROUNDING = 1e-9  # relative: a force chosen to lie on a limit keeps to it


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignLimits:
    """How near a protocol comes to each limit.

    Attributes
    ----------
    strain
        Nominal strain of the strongest press on plain tissue; small strain takes 0.3.
    least_force_n
        Force of the weakest press.
    covering_force_n
        Force in newtons from which the contact covers the face on plain tissue; 0 of a flat one.
    whole_fraction
        Share of the inclusions on which the weakest press touches with the whole face. On the others an estimate would
        say that its model does not hold.
    brightest_grey
        Largest grey level of any press, background included.
    full_scale
        Grey level at which the camera clips.
    read_mm
        Diameter of the face that is read.
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
        """What is broken, by name: strain, contact, saturation or view; one sentence each."""
        slack, findings = 1 + ROUNDING, dict[str, str]()
        if self.strain > STRAIN_LIMIT * slack:
            findings["strain"] = (
                f"The nominal strain is {self.strain:.2f}; small strain takes {STRAIN_LIMIT:g}: press less."
            )
        if self.least_force_n * slack < self.covering_force_n:
            findings["contact"] = (
                f"At {self.least_force_n:.2g} N the face touches plain tissue only in part; from "
                f"{self.covering_force_n:.2g} N on it touches as a whole: press more."
            )
        if self.brightest_grey >= self.full_scale:
            findings["saturation"] = (
                f"The brightest place has {self.brightest_grey:.0f} grey levels; the camera clips at "
                f"{self.full_scale:g}: expose less."
            )
        if self.read_mm > self.view_mm * slack:
            findings["view"] = (
                f"The face is read over {self.read_mm:.1f} mm; the picture shows {self.view_mm:.1f} mm: use another "
                "lens."
            )
        return findings


def limits_of(view: PlannedView, inclusions: NDArray[np.float64]) -> DesignLimits:
    """How near a protocol comes to its limits on plain tissue and on the inclusions (n, 3)."""
    forces, sensor = view.protocol.forces_n, view.sensor
    at_none, per_newton = nominal_strains(view.surrogate, probe=view.protocol.probe, prior=view.model.prior)
    sides = (sensor.columns * sensor.mm_per_pixel[0], sensor.rows * sensor.mm_per_pixel[1])
    return DesignLimits(
        strain=at_none + max(forces) * per_newton,
        least_force_n=min(forces),
        covering_force_n=_covers(view, None),
        whole_fraction=sum(_covers(view, inclusion) <= min(forces) * (1 + ROUNDING) for inclusion in inclusions)
        / len(inclusions),
        brightest_grey=float(max(view.grey(None).max(), view.grey(inclusions).max())),
        full_scale=sensor.full_scale,
        read_mm=2 * OUTER_FRACTION * view.protocol.probe.radius_mm,
        view_mm=min(sides),
    )


def covering_n(view: PlannedView, inclusions: NDArray[np.float64]) -> float:
    """Force from which the contact covers the face on plain tissue and on every one of the inclusions (n, 3)."""
    return max(_covers(view, inclusion) for inclusion in (None, *inclusions))


def _covers(view: PlannedView, inclusion: NDArray[np.float64] | None) -> float:
    return covering_force_n(view.surrogate, view.model.prior, inclusion)


def largest_force_of(view: PlannedView) -> float:
    """Force at which the nominal strain on plain tissue reaches the limit."""
    return largest_force_n(view.surrogate, probe=view.protocol.probe, prior=view.model.prior)
