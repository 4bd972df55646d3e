"""A press at small strain: compliances of probe and tissue, contact, and the limit of strain."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import one_blas_thread
from tsis.errors import MechanicsError
from tsis.files.cache import cached_arrays, content_key
from tsis.mechanics.mesh import FACE_POINTS, Face, block_radius_mm, central_cell_mm, shape_on_axis, sphere_on_axis
from tsis.mechanics.small_strain.slab import Resolution, Slab, SlabWithInclusion, face_of, probe_compliance
from tsis.mechanics.small_strain.unilateral import Elastic, FaceContact
from tsis.model.press import MN_PER_N, PressField

if TYPE_CHECKING:
    from tsis.mechanics.mesh import Floats, Spheroid
    from tsis.mechanics.small_strain.unilateral import PartialContact
    from tsis.model.phantom import Inclusion, Phantom
    from tsis.model.probe import Probe


STRAIN_LIMIT = 0.3  # nominal strain; the linear model is not valid beyond it
ENDLESS = 1e5  # thickness of the slab that approximates a half-space, in radii of the face
DIGITS = 12  # of the lines of a face of radius 1: what two sizes of it have in common
KIND, FORMAT_VERSION = "half-spaces", 1  # in the cache on disk; a change of their mesh is another version
TYPED_DIGITS = 3  # of a Poisson's ratio that is met again; drawn ones have more


def nominal_strain(approach_mm: float, probe: Probe, thickness_mm: float) -> float:
    """Travel over the thickness of probe and slab; the slab counts up to the face's width."""
    return approach_mm / (probe.thickness_mm + min(thickness_mm, 2 * probe.radius_mm))


def strain_problem(approach_mm: float, probe: Probe, thickness_mm: float) -> str | None:
    """Reason why small strain is not valid for a travel of the glass, or None."""
    strain = nominal_strain(approach_mm, probe, thickness_mm)
    if strain <= STRAIN_LIMIT:
        return None
    return (
        f"the glass would travel {approach_mm:.1f} mm, a strain of {strain:.2f}; small strain is valid to "
        f"{STRAIN_LIMIT:g}"
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FacePress:
    """Result of one press on the face, at the radii of its kernel.

    Attributes
    ----------
    pressure_kpa
        Mean contact pressure around each radius.
    face_displacement_mm
        Displacement of the probe's face relative to the glass.
    approach_mm
        Travel of the glass.
    """

    pressure_kpa: Floats
    face_displacement_mm: Floats
    approach_mm: float

    def __add__(self, other: FacePress) -> FacePress:
        return FacePress(**{name: getattr(self, name) + getattr(other, name) for name in FacePress.__slots__})

    def __sub__(self, other: FacePress) -> FacePress:
        return FacePress(**{name: getattr(self, name) - getattr(other, name) for name in FacePress.__slots__})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FullContactPress:
    """All presses that cover the face: ``shape + force_n * unit``, from ``force_n`` on."""

    unit: FacePress  # press by one newton
    shape: FacePress | None  # self-equilibrated press by a dome's gap; None when the face is flat
    force_n: float  # force at which the contact covers the face; 0 when the face is flat


class PressKernel:
    """One probe on slabs of one thickness: all values that do not depend on the inclusion, computed once.

    Parameters
    ----------
    probe
        The probe.
    thickness_mm, poisson
        The slab.
    block_mm
        Least radius of the block in which inclusions are meshed; see `block_radius_mm`.
    central_mm
        Largest cell of the face at the axis; see `central_cell_mm`.
    resolution
        Mesh density.
    points
        Number of radii of the results, evenly spaced from the axis to the edge.
    """

    def __init__(
        self,
        probe: Probe,
        *,
        thickness_mm: float,
        poisson: float,
        block_mm: float | None = None,
        central_mm: float = np.inf,
        resolution: Resolution | None = None,
        points: int = FACE_POINTS,
    ) -> None:
        resolution = resolution or Resolution()
        self.probe, self.thickness_mm, self.poisson, self._resolution = probe, thickness_mm, poisson, resolution
        self.radius_mm = np.linspace(0.0, probe.radius_mm, points)
        self.face: Face = face_of(probe.radius_mm, resolution, central_mm)
        self.probe_compliance = probe_compliance(probe, self.face, resolution)
        self.contact = FaceContact(probe, self.face, self.radius_mm)
        self._at_radius = self.face.interpolation(self.radius_mm)
        block = block_radius_mm(probe, thickness_mm) if block_mm is None else block_mm
        self._is_plain = central_mm == np.inf
        self._slab = Slab(
            thickness_mm=thickness_mm, poisson=poisson, face=self.face, block_mm=block, resolution=resolution
        )

    def slab(self, *, diameter_mm: float, depth_mm: float, poisson: float) -> SlabWithInclusion:
        """Mesh a sphere into the slab."""
        return self.slab_around(sphere_on_axis(diameter_mm, depth_mm), poisson=poisson)

    def slab_around(self, shape: Spheroid, *, poisson: float) -> SlabWithInclusion:
        """Mesh a spheroid into the slab."""
        return self._slab.with_inclusion(shape, poisson=poisson)

    def press(self, tissue_kpa: float, force_mn: float, change: Floats | None = None) -> FacePress:
        """Press tissue of ``tissue_kpa`` with ``force_mn`` > 0.

        ``change`` is the change of the compliance of tissue of 1 kPa by an inclusion. The tissue itself is solved on a
        mesh without inclusion, so that the press less the reference press contains the inclusion's effect only.
        """
        both, split = self._bodies(tissue_kpa, change)
        return self._face_press(self.contact.touch(both, force_mn, split))

    def covering(self, tissue_kpa: float, change: Floats | None = None) -> FullContactPress:
        """All presses whose contact covers the face; arguments as for `press`."""
        result = self.contact.covering(*self._bodies(tissue_kpa, change))
        return FullContactPress(
            unit=self._face_press(result.unit),
            shape=None if result.shape is None else self._face_press(result.shape),
            force_n=result.force_mn / MN_PER_N,
        )

    def _bodies(self, tissue_kpa: float, change: Floats | None) -> tuple[Floats, Elastic | None]:
        """Compliance of both bodies together, and split for a domed face."""
        both = self.probe_compliance + self.tissue_compliance(tissue_kpa, change)
        return both, self.split(both, tissue_kpa) if self.contact.is_domed else None

    def _face_press(self, touch: PartialContact) -> FacePress:
        return FacePress(
            pressure_kpa=touch.pressure_kpa,
            face_displacement_mm=self.face_displacement(touch.force),
            approach_mm=touch.approach_mm,
        )

    def face_displacement(self, force: Floats) -> Floats:
        """Displacement of the face from nodal forces; ``force`` may have columns."""
        return np.asarray(self._at_radius @ (self.probe_compliance @ force))

    def tissue_compliance(self, tissue_kpa: float, change: Floats | None = None) -> Floats:
        """Compliance of the face's nodes on tissue; ``change`` is an inclusion's at 1 kPa."""
        reference = self._slab.compliance
        return np.asarray((reference if change is None else reference + change) / tissue_kpa)

    def split(self, both: Floats, tissue_kpa: float) -> Elastic:
        """The compliance of ``both`` bodies with the tissue's half-space split off, for contact over a disc."""
        return Elastic(
            half_space=(1 - self.poisson**2) / tissue_kpa, smooth=both - self._half_space_compliance / tissue_kpa
        )

    @cached_property
    def _half_space_compliance(self) -> Floats:
        compliance = half_space_compliance(self.face, self.poisson, self._resolution, plain=self._is_plain)
        return (1 - self.poisson**2) * compliance


@lru_cache(maxsize=16)
def half_space_compliance(face: Face, poisson: float, resolution: Resolution, *, plain: bool = True) -> Floats:
    """Compliance of a face's nodes on a half-space of ``E / (1 - nu**2)`` = 1 kPa, from a very thick slab, (n, n).

    It is in inverse proportion to the size of the face, so that the face of radius 1 serves all that are like it. The
    cache on disk has ``plain`` faces, which suit no inclusion: those of every inclusion would fill it.
    """
    edge = float(face.lines[-1])
    unit = Face(lines=np.round(face.lines / edge, DIGITS), order=face.order)

    def solve() -> dict[str, Floats]:
        endless = Slab(thickness_mm=ENDLESS, poisson=poisson, face=unit, block_mm=0.5, resolution=resolution)
        return {"compliance": endless.compliance / (1 - poisson**2)}

    key = {"lines": unit.lines.tolist(), "order": unit.order, "poisson": poisson, "resolution": asdict(resolution)}
    is_met_again = plain and round(poisson, TYPED_DIGITS) == poisson
    solved = cached_arrays(KIND, content_key({"format": FORMAT_VERSION, **key}), solve) if is_met_again else solve()
    compliance = solved["compliance"] / edge
    compliance.flags.writeable = False  # shared through the cache
    return compliance


def small_strain_press(probe: Probe, phantom: Phantom, force_n: float, resolution: Resolution | None) -> PressField:
    """The press of `tsis.mechanics.press` at small strain; the arguments are valid."""
    with one_blas_thread():  # threads slow down matrices this small
        result = _face_press(probe, phantom, force_n * MN_PER_N, resolution or Resolution())
        problem = strain_problem(result.approach_mm, probe, phantom.thickness_mm)
        if problem is not None:
            valid = _valid_force(probe, phantom, force_n, resolution or Resolution())
            raise MechanicsError(
                f"{problem}: choose a force of at most {valid:.2g} N, stiffer tissue, or strain='finite'",
                problem=problem,
                largest_n=valid,
            )
    return PressField(
        radius_mm=np.linspace(0.0, probe.radius_mm, FACE_POINTS),
        face_displacement_mm=result.face_displacement_mm,
        pressure_kpa=result.pressure_kpa,
        approach_mm=result.approach_mm,
        force_n=force_n,
    )


def _face_press(probe: Probe, phantom: Phantom, force_mn: float, resolution: Resolution) -> FacePress:
    tissue, reference = phantom.young_kpa, _reference_kernel(probe, phantom, resolution)
    if phantom.inclusion is None:
        return reference.press(tissue, force_mn)
    kernel, change = _kernel_and_change(probe, phantom, phantom.inclusion, resolution)
    result = kernel.press(tissue, force_mn, change)
    if kernel is reference:
        return result
    # Another mesh of the face: it gives only the inclusion's change, so that its error cancels.
    return reference.press(tissue, force_mn) + (result - kernel.press(tissue, force_mn))


def _valid_force(probe: Probe, phantom: Phantom, force_n: float, resolution: Resolution) -> float:
    """The largest force within the strain limit, rounded down to two digits."""

    def excess(force: float) -> float:
        result = _face_press(probe, phantom, force * MN_PER_N, resolution)
        return nominal_strain(result.approach_mm, probe, phantom.thickness_mm) - STRAIN_LIMIT

    low = 0.1 * force_n
    while excess(low) > 0:
        low *= 0.1
    valid = float(scipy.optimize.brentq(excess, low, force_n, rtol=1e-3))
    digit = 10 ** (np.floor(np.log10(valid)) - 1)
    return float(digit * np.floor(0.999 * valid / digit))


def compliances(probe: Probe, phantom: Phantom, resolution: Resolution) -> tuple[PressKernel, Floats]:
    """The kernel of a press and the compliance of the phantom's tissue on its face's nodes, mm/mN."""
    if phantom.inclusion is None:
        kernel, change = _reference_kernel(probe, phantom, resolution), None
    else:
        kernel, change = _kernel_and_change(probe, phantom, phantom.inclusion, resolution)
    return kernel, kernel.tissue_compliance(phantom.young_kpa, change)


def _reference_kernel(probe: Probe, phantom: Phantom, resolution: Resolution) -> PressKernel:
    block = block_radius_mm(probe, phantom.thickness_mm)
    return _kernel(probe, phantom.thickness_mm, phantom.poisson, block, np.inf, resolution)


def _kernel_and_change(
    probe: Probe, phantom: Phantom, inclusion: Inclusion, resolution: Resolution
) -> tuple[PressKernel, Floats]:
    """A kernel whose mesh suits the inclusion, and the inclusion's change of the compliance of tissue of 1 kPa."""
    shape = shape_on_axis(phantom)
    width = 2 * shape.half_width
    central = central_cell_mm(width, inclusion.depth_mm, shape.centre_depth)
    # Deep inclusions use the kernel without inclusion: their cell is wider than all cells of the face.
    central = np.inf if central >= resolution.largest * probe.radius_mm else central
    block = block_radius_mm(probe, phantom.thickness_mm, width)
    kernel = _kernel(probe, phantom.thickness_mm, phantom.poisson, block, central, resolution)
    slab = kernel.slab_around(shape, poisson=inclusion.poisson)
    return kernel, slab.change(inclusion.young_kpa / phantom.young_kpa)


@lru_cache(maxsize=8)
def _kernel(
    probe: Probe, thickness_mm: float, poisson: float, block_mm: float, central_mm: float, resolution: Resolution
) -> PressKernel:
    return PressKernel(
        probe,
        thickness_mm=thickness_mm,
        poisson=poisson,
        block_mm=block_mm,
        central_mm=central_mm,
        resolution=resolution,
    )
