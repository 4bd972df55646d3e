"""A probe pressed on a slab with large deformations: neo-Hookean bodies, frictionless sliding, unilateral contact.

Equilibria of neighbouring slabs are continued, each started from the last one. All slabs are meshed on the same lines,
so that their meshes have one topology and their nodes move smoothly with diameter, depth and thickness. Displacements
and pressures of one equilibrium then start Newton's method in the next; where it does not converge, a state in between
comes first.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from tsis.compiled import one_blas_thread
from tsis.errors import InputError, MechanicsError
from tsis.files.cache import content_key, read_cached_arrays, write_cached_arrays
from tsis.mechanics.finite_strain import equilibrium as load_path
from tsis.mechanics.finite_strain.equilibrium import Load, StalledError
from tsis.mechanics.finite_strain.patches import NARROW, FiniteResolution, slab_lines
from tsis.mechanics.finite_strain.probe_on_slab import SPRING, TRAVEL, FinitePress, ProbeOnSlab, suited
from tsis.mechanics.mesh import mechanical_content, shape_on_axis
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.press import MN_PER_N, PressField
from tsis.model.probe import Probe
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.mechanics.finite_strain.equilibrium import Pressures, State
    from tsis.mechanics.finite_strain.probe_on_slab import FinitePress
    from tsis.mechanics.mesh import Floats


FORMAT_VERSION = 1
KIND = "finite-press-states"
PARTS = ("unknowns", "volumetric", "contact")  # of a stored press
SMALLEST_PART = 1 / 256  # of the way to a state, before the continuation gives up
GROWTH = 2.0
STEERINGS = (1.0, 0.2, 5.0)  # of the contact, over the usual one: the next where Newton's method stalls
LARGER = 4  # parts of the way that the next one starts with, over the smallest
STIFFER = 1.5  # tissue of the press from which a stalled load path is circumvented


@dataclass(frozen=True, slots=True, kw_only=True)
class SlabPress:
    """A press with ``force_n`` on a phantom; an inclusion of the tissue's own material leaves the tissue uniform."""

    phantom: Phantom
    force_n: float

    @classmethod
    def on_sphere(
        cls,
        *,
        diameter_mm: float,
        depth_mm: float,
        contrast: float,
        tissue_young_kpa: float,
        thickness_mm: float,
        force_n: float,
        poisson: float = 0.49,
    ) -> SlabPress:
        """A press on a sphere ``contrast`` times stiffer than the tissue, both with one Poisson's ratio."""
        sphere = Inclusion(
            diameter_mm=diameter_mm, depth_mm=depth_mm, young_kpa=contrast * tissue_young_kpa, poisson=poisson
        )
        slab = Phantom(young_kpa=tissue_young_kpa, poisson=poisson, thickness_mm=thickness_mm, inclusion=sphere)
        return cls(phantom=slab, force_n=force_n)

    def with_contrast(self, contrast: float) -> SlabPress:
        """The press with an inclusion ``contrast`` times stiffer than the tissue; 1 is uniform tissue, same mesh."""
        own = self.phantom.inclusion
        if own is None:
            return self
        same = replace(own, young_kpa=contrast * self.phantom.young_kpa, poisson=self.phantom.poisson)
        return replace(self, phantom=replace(self.phantom, inclusion=same))

    def on_stiffer_tissue(self) -> SlabPress:
        """A press with `STIFFER` times the force on uniform tissue that much stiffer: a way around a stalled path."""
        slab = replace(self.phantom, young_kpa=STIFFER * self.phantom.young_kpa)
        stiffer = SlabPress(phantom=slab, force_n=STIFFER * self.force_n)
        return stiffer.with_contrast(1.0)

    def towards(self, other: SlabPress, fraction: float) -> SlabPress:
        """Press at a fraction of the way; lengths in proportion, moduli and forces in their logarithms."""
        if fraction == 1.0:
            return other
        here, there = self.phantom, other.phantom
        inclusion = there.inclusion
        if here.inclusion is not None and there.inclusion is not None:
            lengths = ("diameter_mm", "depth_mm", "poisson")
            inclusion = replace(there.inclusion, **_between(here.inclusion, there.inclusion, fraction, lengths))
        # Slab and inclusion change together: the target's inclusion need not fit into a slab on the way.
        between = _between(here, there, fraction, ("thickness_mm", "poisson"))
        slab = replace(there, **between, inclusion=inclusion)
        return SlabPress(phantom=slab, force_n=_geometric(self.force_n, other.force_n, fraction))


Body = TypeVar("Body", Phantom, Inclusion)


def _between(here: Body, there: Body, fraction: float, linear: Sequence[str]) -> dict[str, Any]:
    mixed = {name: (1 - fraction) * getattr(here, name) + fraction * getattr(there, name) for name in linear}
    return {"young_kpa": _geometric(here.young_kpa, there.young_kpa, fraction), **mixed}


def _geometric(here: float, there: float, fraction: float) -> float:
    return float(here ** (1 - fraction) * there**fraction)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SolvedPress:
    """A press in equilibrium, from which others start."""

    press: SlabPress
    state: State
    result: FinitePress


class PressContinuation:
    """Presses of one probe on slabs whose meshes have one topology: those of ``like``."""

    def __init__(
        self,
        probe: Probe,
        like: Phantom,
        resolution: FiniteResolution | None = None,
    ) -> None:
        self.probe, self._resolution = probe, resolution or FiniteResolution()
        self._lines = slab_lines(like, probe, suited(self._resolution, probe))
        self.solves = 0  # calls of Newton's method, those without convergence included

    def first(self, press: SlabPress) -> SolvedPress:
        """A press without a neighbour, by load steps."""
        model = self._model(press)
        force = press.force_n * MN_PER_N
        touch = load_path.find_first_contact(
            model.potential, model.deformed, model.touch_mm, SPRING, below_mn=force / 2
        )
        (state,) = load_path.follow_load_path(model.potential, touch, [force], refuse=model.refuse)
        return SolvedPress(press=press, state=state, result=model.read(state, press.force_n))

    def follow(self, start: SolvedPress, target: SlabPress) -> SolvedPress:
        """The press ``target``, started from another one.

        Raises
        ------
        MechanicsError
            When a state on the way does not converge or lies outside the range of the model; the message names it.
        """
        done, part, here, steerings = 0.0, 1.0, start, list(STEERINGS)
        while done < 1.0:
            ahead = 1.0 if done + part > 0.999 else done + part
            press = start.press.towards(target, ahead)
            solved = self._solve(here, press, exact=ahead == 1.0, steering=steerings[0])
            if isinstance(solved, SolvedPress):
                part, done, here = (ahead - done) * GROWTH, ahead, solved
                continue
            part = (ahead - done) / 2
            if part < SMALLEST_PART:
                # Near an edge of the contact Newton's choice of closed points can alternate between two for ever.
                steerings.pop(0)
                part = LARGER * SMALLEST_PART
            if not steerings:
                raise self._end(here, press, target, solved)
        return here

    def _end(self, here: SolvedPress, press: SlabPress, target: SlabPress, problem: str) -> MechanicsError:
        """Why ``press``, on the way to ``target``, does not follow from the last one that converged."""
        reason = self._model(here.press).explain(here.state)
        cause, last = f" because {reason}" if reason else "", here.press
        problem = (
            f"{problem} at {press.force_n:.3g} N on tissue of {press.phantom.young_kpa:.3g} kPa{cause}; the "
            f"last press that converged has {last.force_n:.3g} N on {last.phantom.young_kpa:.3g} kPa"
        )
        valid = load_path.rounded_down(last.force_n * target.phantom.young_kpa / last.phantom.young_kpa)
        largest = valid if valid < target.force_n else None
        cure = "a press nearer to it" if largest is None else f"a force of at most {largest:.3g} N"
        kind = MechanicsError if reason else load_path.StalledError
        return kind(f"{problem}: choose {cure}", problem=problem, largest_n=largest)

    def _model(self, press: SlabPress) -> ProbeOnSlab:
        return ProbeOnSlab(self.probe, press.phantom, self._resolution, lines=self._lines)

    def _solve(self, start: SolvedPress, press: SlabPress, *, exact: bool, steering: float = 1.0) -> SolvedPress | str:
        """The press, or why there is none; ``steering`` multiplies that of the contact."""
        model = self._model(press)
        model.contact.steering *= steering
        self.solves += 1
        state = load_path.solve_equilibrium(
            model.potential,
            *self._predicted(start, press),
            Load(force_mn=press.force_n * MN_PER_N),
            decrement=load_path.DECREMENT if exact else load_path.ROUGH,
        )
        if state is None:
            return "the press does not converge"
        reason = model.refuse(state)
        if reason is not None:
            return reason
        return SolvedPress(press=press, state=state, result=model.read(state, press.force_n))

    def resumed(self, press: SlabPress, unknowns: Floats, pressures: Pressures) -> SolvedPress:
        """A press that was solved before and is stored by its unknowns and pressures."""
        model, load = self._model(press), Load(force_mn=press.force_n * MN_PER_N)
        quadratic = model.potential.quadratic(unknowns, pressures, load)
        state = load_path.State(unknowns=unknowns, pressures=pressures, load=load, model=quadratic, rounds=0)
        return SolvedPress(press=press, state=state, result=model.read(state, press.force_n))

    def content(self) -> dict[str, Any]:
        """All that decides its presses, as JSON values."""
        lines = {"radial_mm": self._lines.radial_mm.tolist(), "depth": self._lines.depth.tolist()}
        lines |= {"split": self._lines.split, "extent": self._lines.extent}
        if self._lines.layers != self._resolution.ray_layers:
            lines |= {"layers": self._lines.layers}
        return {"probe": mechanical_content(self.probe), "resolution": asdict(self._resolution), "lines": lines}

    def _predicted(self, start: SolvedPress, press: SlabPress) -> tuple[Floats, Pressures]:
        """Unknowns and pressures near a press: tissue stiffer by a factor under as much more force deforms alike."""
        state, stiffer = start.state, press.phantom.young_kpa / start.press.phantom.young_kpa
        ahead = press.force_n * MN_PER_N / stiffer - start.press.force_n * MN_PER_N
        tangent = ahead * state.model.solution(TRAVEL)
        rates = state.model.pressures_by(tangent)
        pressures = tuple(stiffer * (now + rate) for now, rate in zip(state.pressures, rates, strict=True))
        return state.unknowns + tangent, pressures


def solved_once(continuation: PressContinuation, presses: Sequence[SlabPress]) -> tuple[SolvedPress, ...]:
    """The presses, each continued from the one before, or read from the disk cache."""
    key = content_key(
        {"format": FORMAT_VERSION, "presses": [asdict(press) for press in presses]} | continuation.content()
    )
    arrays = read_cached_arrays(KIND, key)
    if arrays is None:
        arrays, here = {}, None
        for index, press in enumerate(presses):
            here = continuation.first(press) if here is None else continuation.follow(here, press)
            for name, values in zip(PARTS, (here.state.unknowns, *here.state.pressures), strict=True):
                arrays[f"{name}-{index}"] = values.astype("f4")
        write_cached_arrays(KIND, key, arrays)
    states = []
    for index, press in enumerate(presses):
        unknowns, *pressures = (np.asarray(arrays[f"{name}-{index}"], dtype=float) for name in PARTS)
        states.append(continuation.resumed(press, unknowns, tuple(pressures)))
    return tuple(states)


def path_around(
    probe: Probe, phantom: Phantom, forces_n: Sequence[float], resolution: FiniteResolution
) -> tuple[FinitePress, ...]:
    """The presses of a load path that stalls, reached through stiffer tissue."""
    continuation = PressContinuation(probe, phantom, resolution)
    here, results = continuation.first(SlabPress(phantom=phantom, force_n=forces_n[0]).on_stiffer_tissue()), []
    for force in forces_n:
        here = continuation.follow(here, SlabPress(phantom=phantom, force_n=force))
        results.append(here.result)
    return tuple(results)


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
    >>> from tsis.mechanics.finite_strain.neo_hookean_press import press_finite
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
