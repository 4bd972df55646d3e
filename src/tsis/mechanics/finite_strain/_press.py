"""A probe pressed on a slab with large deformations: neo-Hookean bodies, frictionless sliding, unilateral contact."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from tsis.errors import InputError, MechanicsError
from tsis.mechanics._mesh import shape_on_axis
from tsis.mechanics.finite_strain._continuation import PressContinuation, SlabPress, SolvedPress, path_around
from tsis.mechanics.finite_strain._load_path import StalledError
from tsis.mechanics.finite_strain._meshes import FiniteResolution
from tsis.mechanics.finite_strain._probe_on_slab import FinitePress, ProbeOnSlab
from tsis.model import MN_PER_N, Phantom, PressField, Probe, require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


LARGEST_FORCE_N = 50.0
LIGHTEST = 2.5e-3  # of modulus times radius squared
MOST_BRANCHES = 8  # phantoms whose solved presses a series remembers, with and without contrast


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
    """Presses of one probe at many forces, each continued from the nearest earlier one.

    The fields are those of `press_finite`. The first press on a phantom costs a load path, each other a second or two.

    Parameters
    ----------
    probe
        The probe.
    resolution
        Mesh density.
    """

    def __init__(self, probe: Probe, resolution: FiniteResolution | None = None) -> None:
        require_type("probe", probe, Probe)
        self._probe, self._resolution = probe, resolution or FiniteResolution()
        self._branches: OrderedDict[Phantom, _Branch] = OrderedDict()

    def press(self, phantom: Phantom, *, force_n: float) -> PressField:
        """Press on a phantom; arguments and errors are those of `press_finite`."""
        _require_pressable(self._probe, phantom, (force_n,))
        with threadpool_limits(limits=1, user_api="blas"):
            field = self._on_own_mesh(phantom.without_inclusion()).uniform(force_n)
            if phantom.inclusion is None:
                return field
            branch = self._on_own_mesh(phantom)
            return _plus(field, branch.with_inclusion(force_n), branch.uniform(force_n))

    def _on_own_mesh(self, phantom: Phantom) -> _Branch:
        branch = self._branches.pop(phantom, None) or _Branch(self._probe, phantom, self._resolution)
        self._branches[phantom] = branch
        if len(self._branches) > MOST_BRANCHES:
            self._branches.popitem(last=False)
        return branch


class _Branch:
    """Solved presses on one mesh by their forces, with the inclusion and without its contrast."""

    def __init__(self, probe: Probe, phantom: Phantom, resolution: FiniteResolution) -> None:
        self._continuation = PressContinuation(probe, phantom, resolution)
        self._phantom = phantom
        self._uniform: dict[float, SolvedPress] = {}
        self._with: dict[float, SolvedPress] = {}

    def uniform(self, force_n: float) -> PressField:
        if force_n not in self._uniform:
            target = SlabPress(phantom=self._phantom, force_n=force_n).with_contrast(1.0)
            start = _nearest(self._uniform, force_n) or self._first(target)
            self._uniform[force_n] = self._continuation.follow(start, target)
        return self._uniform[force_n].result.field

    def with_inclusion(self, force_n: float) -> PressField:
        if force_n not in self._with:
            self.uniform(force_n)
            target = SlabPress(phantom=self._phantom, force_n=force_n)
            self._with[force_n] = self._continuation.follow(self._uniform[force_n], target)
        return self._with[force_n].result.field

    def _first(self, press: SlabPress) -> SolvedPress:
        """The press, or one on stiffer tissue where its own load path stalls."""
        try:
            return self._continuation.first(press)
        except StalledError:
            return self._continuation.first(press.on_stiffer_tissue())


def _nearest(solved: Mapping[float, SolvedPress], force_n: float) -> SolvedPress | None:
    return solved[min(solved, key=lambda force: abs(np.log(force / force_n)))] if solved else None


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
    with threadpool_limits(limits=1, user_api="blas"):  # threads slow down matrices this small
        try:
            return ProbeOnSlab(probe, phantom, resolution, contrast=contrast).path(forces_n)
        except StalledError:
            own = phantom.inclusion
            if own is not None and not contrast:
                same = replace(own, young_kpa=phantom.young_kpa, poisson=phantom.poisson)
                phantom = replace(phantom, inclusion=same)
            return path_around(probe, phantom, forces_n, resolution)
