"""A probe pressed on a slab with large deformations: neo-Hookean bodies, frictionless sliding, unilateral contact."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from tsis.compiled import one_blas_thread
from tsis.errors import InputError, MechanicsError
from tsis.mechanics._mesh import shape_on_axis
from tsis.mechanics.finite_strain._continuation import (
    PressContinuation,
    SlabPress,
    SolvedPress,
    path_around,
    solved_once,
)
from tsis.mechanics.finite_strain._load_path import StalledError
from tsis.mechanics.finite_strain._meshes import NARROW, FiniteResolution
from tsis.mechanics.finite_strain._probe_on_slab import FinitePress, ProbeOnSlab
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.press import MN_PER_N, PressField
from tsis.model.probe import Probe
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Sequence


LARGEST_FORCE_N = 50.0
LIGHTEST = 2.5e-3  # of modulus times radius squared
MOST_FIELDS = 64  # that a series remembers
WIDTHS = (NARROW, 2.2)  # of the face's radius: widest spheres on the two kinds of lines
THICKEST, THICKNESSES = 3.6, (2.5, 5.0)  # of the face's radius: limit between the two kinds of lines, and their slabs
ANCHOR_LOADS = (0.1, 0.25, 0.5, 0.9, 1.4)  # of tissue modulus times radius squared
ANCHOR_TISSUE = 0.15  # of the modulus of the probe's softest layer


def press_finite(
    probe: Probe, phantom: Phantom, *, force_n: float, resolution: FiniteResolution | None = None
) -> PressField:
    """Press a probe on a phantom, with large deformations.

    Probe, tissue and inclusion are neo-Hookean. The tissue is bonded to the chest wall; it slides without friction on
    the face and may leave it. The face ends in a rim rounded with 0.5 mm (less on thin first layers and small faces).
    A radius on the rim belongs to the undeformed probe. A field with an inclusion is that of tissue without it plus its
    change, computed with and without contrast on one mesh: a converged signal.

    Parameters
    ----------
    probe, phantom
        The probe and the tissue under it; an inclusion is a sphere or spheroid on the probe's axis.
    force_n
        Force in newtons, in [1e-6, 50].
    resolution
        Mesh density.

    Raises
    ------
    InputError
        When a value lies outside its range or the inclusion is not axisymmetric.
    MechanicsError
        When the load does not converge or strains leave the range of the model; the message names the last valid load.

    Examples
    --------
    >>> import tsis
    >>> from tsis.mechanics.finite_strain import press_finite
    >>> field = press_finite(tsis.load_probe("tsis-2011"), tsis.load_phantom("plain"), force_n=0.25)
    >>> f"{field.approach_mm:.2f} mm of travel"
    '1.07 mm of travel'
    """
    (field,) = press_path(probe, phantom, forces_n=(force_n,), resolution=resolution)
    return field


def press_path(
    probe: Probe, phantom: Phantom, *, forces_n: Sequence[float], resolution: FiniteResolution | None = None
) -> tuple[PressField, ...]:
    """Fields of `press_finite` at several ascending forces in newtons, on one load path."""
    reference = press_steps(probe, phantom.without_inclusion(), tuple(forces_n), resolution)
    if phantom.inclusion is None:
        return tuple(step.field for step in reference)
    pairs = press_pairs(probe, phantom, forces_n=forces_n, resolution=resolution)
    return tuple(_plus(step.field, *pair) for step, pair in zip(reference, pairs, strict=True))


def press_pairs(
    probe: Probe, phantom: Phantom, *, forces_n: Sequence[float], resolution: FiniteResolution | None = None
) -> tuple[tuple[PressField, PressField], ...]:
    """Fields with the inclusion and without it, ON ONE MESH, at several ascending forces in newtons.

    Their difference is the signal. This costs two load paths; two calls of `press_finite` cost three.
    """
    with_it = press_steps(probe, phantom, tuple(forces_n), resolution)
    without = press_steps(probe, phantom, tuple(forces_n), resolution, contrast=False)
    return tuple((item.field, other.field) for item, other in zip(with_it, without, strict=True))


class PressSeries:
    """Presses of one probe, each continued from one of a few solved presses of that probe on uniform tissue.

    A field is that of `press_finite` on other element boundaries: tissue without inclusion, plus the change by the
    inclusion on one mesh. It depends on nothing that was pressed before. A press costs about a second. The solved
    presses are computed once for a probe, in half a minute, and cached on disk; the catalog's probes have them.
    Spheroids, and spheres much wider than the face, take the load path of `press_finite`.

    Parameters
    ----------
    probe
        The probe.
    resolution
        Mesh density.
    """

    def __init__(self, probe: Probe, resolution: FiniteResolution | None = None) -> None:
        require_type("probe", probe, Probe)
        self.probe, self.resolution = probe, resolution or FiniteResolution()
        self._solved: OrderedDict[tuple[Phantom, float], PressField] = OrderedDict()
        self._on: dict[tuple[bool, bool], tuple[PressContinuation, tuple[SolvedPress, ...]]] = {}

    def press(self, phantom: Phantom, *, force_n: float) -> PressField:
        """Press on a phantom; arguments and errors are those of `press_finite`."""
        _require_pressable(self.probe, phantom, (force_n,))
        phantom = replace(phantom, name="", assumed=())
        field = self._solved.pop((phantom, force_n), None) or self._press(phantom, force_n)
        self._solved[phantom, force_n] = field
        if len(self._solved) > MOST_FIELDS:
            self._solved.popitem(last=False)
        return field

    def _press(self, phantom: Phantom, force_n: float) -> PressField:
        own, radius = phantom.inclusion, self.probe.radius_mm
        wide = own is not None and own.diameter_mm > WIDTHS[0] * radius
        if own is not None and (own.semi_axes_mm is not None or own.diameter_mm > WIDTHS[1] * radius):
            return press_finite(self.probe, phantom, force_n=force_n, resolution=self.resolution)
        thick = phantom.thickness_mm > THICKEST * radius
        with one_blas_thread():
            field = self._without_inclusion(phantom.without_inclusion(), force_n)
            if own is None:
                return field
            continuation, anchors = self._anchored(wide=wide, thick=thick)
            target = SlabPress(phantom=phantom, force_n=force_n)
            without = _reached(continuation, anchors, target.with_contrast(1.0))
            with_it = continuation.follow(without, target)
        return _plus(field, with_it.result.field, without.result.field)

    def _without_inclusion(self, slab: Phantom, force_n: float) -> PressField:
        """Press on the mesh of a small sphere of the tissue's own material, the same for all inclusions."""
        radius = self.probe.radius_mm
        continuation, anchors = self._anchored(wide=False, thick=slab.thickness_mm > THICKEST * radius)
        target = _slab_press(slab.thickness_mm, slab.young_kpa, slab.poisson, force_n)
        return _reached(continuation, anchors, target).result.field

    def _anchored(self, *, wide: bool, thick: bool) -> tuple[PressContinuation, tuple[SolvedPress, ...]]:
        if (wide, thick) not in self._on:
            tissue = ANCHOR_TISSUE * min(layer.young_kpa for layer in self.probe.layers)
            thickness = THICKNESSES[thick] * self.probe.radius_mm
            lines = Inclusion(diameter_mm=WIDTHS[wide] * self.probe.radius_mm, depth_mm=0.5, young_kpa=1.0)
            like = Phantom(young_kpa=1.0, thickness_mm=thickness, inclusion=lines)
            continuation = PressContinuation(self.probe, like, self.resolution)
            unit_n = tissue * self.probe.radius_mm**2 / MN_PER_N
            presses = [_slab_press(thickness, tissue, 0.49, load * unit_n) for load in ANCHOR_LOADS]
            self._on[wide, thick] = continuation, solved_once(continuation, presses)
        return self._on[wide, thick]


def _slab_press(thickness_mm: float, young_kpa: float, poisson: float, force_n: float) -> SlabPress:
    """A press on uniform tissue, meshed with a small sphere in the upper half."""
    return SlabPress.on_sphere(
        diameter_mm=0.3 * thickness_mm,
        depth_mm=0.2 * thickness_mm,
        contrast=1.0,
        tissue_young_kpa=young_kpa,
        thickness_mm=thickness_mm,
        force_n=force_n,
        poisson=poisson,
    )


def _reached(continuation: PressContinuation, anchors: Sequence[SolvedPress], target: SlabPress) -> SolvedPress:
    """A press from the anchor whose tissue deforms most like it, or from the next where Newton's method stalls."""

    def distance(solved: SolvedPress) -> float:
        press = solved.press
        ratio = press.force_n * target.phantom.young_kpa / press.phantom.young_kpa / target.force_n
        return float(abs(np.log(ratio)))

    stalled = None
    for anchor in sorted(anchors, key=distance):
        try:
            return continuation.follow(anchor, target)
        except StalledError as error:
            stalled = stalled or error
    raise stalled or AssertionError("there are always anchors")


def _plus(field: PressField, with_it: PressField, without: PressField) -> PressField:
    return PressField(
        radius_mm=field.radius_mm,
        face_displacement_mm=field.face_displacement_mm + with_it.face_displacement_mm - without.face_displacement_mm,
        pressure_kpa=field.pressure_kpa + with_it.pressure_kpa - without.pressure_kpa,
        approach_mm=field.approach_mm + with_it.approach_mm - without.approach_mm,
        force_n=field.force_n,
    )


def press_steps(
    probe: Probe,
    phantom: Phantom,
    forces_n: tuple[float, ...],
    resolution: FiniteResolution | None = None,
    *,
    contrast: bool = True,
) -> tuple[FinitePress, ...]:
    """States of one load path on the phantom's own mesh, with their energy and largest stretch."""
    require_type("probe", probe, Probe)
    _require_pressable(probe, phantom, forces_n)
    return _solve_path(probe, phantom, forces_n, resolution or FiniteResolution(), contrast)


def _require_pressable(probe: Probe, phantom: Phantom, forces_n: Sequence[float]) -> None:
    require_type("phantom", phantom, Phantom)
    require_ascending_forces(forces_n)
    softer = min(phantom.young_kpa, probe.layers[0].young_kpa)
    require_enough_force(forces_n[0], softer, probe.radius_mm, lightest=LIGHTEST)
    if phantom.inclusion is not None:
        shape_on_axis(phantom)  # refuses other inclusions


def require_ascending_forces(forces_n: Sequence[float]) -> None:
    """Refuse forces in newtons that are none, out of range or not ascending."""
    if not forces_n:
        raise InputError("forces_n must contain at least one force; got none")
    for force in forces_n:
        require_number("force_n", force, 1e-6, LARGEST_FORCE_N, hint="newtons")
    if any(later <= earlier for earlier, later in pairwise(forces_n)):
        raise InputError(f"forces_n must ascend; got {tuple(forces_n)}")


def require_enough_force(force_n: float, young_kpa: float, radius_mm: float, *, lightest: float) -> None:
    """Refuse forces below ``lightest`` of modulus times radius squared: the mesh does not resolve their contact."""
    least = lightest * young_kpa * radius_mm**2 / MN_PER_N
    if force_n < least:
        raise MechanicsError(
            f"force_n must be at least {least:.2g} here for strain='finite', or the contact is smaller than its mesh; "
            f"got {force_n:g}: use strain='small'"
        )


@lru_cache(maxsize=16)
def _solve_path(
    probe: Probe, phantom: Phantom, forces_n: tuple[float, ...], resolution: FiniteResolution, contrast: bool
) -> tuple[FinitePress, ...]:
    with one_blas_thread():  # threads slow down matrices this small
        try:
            return ProbeOnSlab(probe, phantom, resolution, contrast=contrast).path(forces_n)
        except StalledError:
            own = phantom.inclusion
            if own is not None and not contrast:
                same = replace(own, young_kpa=phantom.young_kpa, poisson=phantom.poisson)
                phantom = replace(phantom, inclusion=same)
            return path_around(probe, phantom, forces_n, resolution)
