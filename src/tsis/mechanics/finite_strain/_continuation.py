"""Continuation in state: equilibria of neighbouring slabs, each started from the last one.

All slabs are meshed on the same lines, so that their meshes have one topology and their nodes move smoothly with
diameter, depth and thickness. Displacements and pressures of one equilibrium then start Newton's method in the next;
where it does not converge, a state in between comes first.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from tsis.errors import MechanicsError
from tsis.files.cache import content_key, read_cached_arrays, write_cached_arrays
from tsis.mechanics._mesh import mechanical_content
from tsis.mechanics.finite_strain import _load_path as load_path
from tsis.mechanics.finite_strain._meshes import FiniteResolution, slab_lines
from tsis.mechanics.finite_strain._potential import Load
from tsis.mechanics.finite_strain._probe_on_slab import SPRING, TRAVEL, ProbeOnSlab, suited
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.press import MN_PER_N

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.mechanics._element import Floats
    from tsis.mechanics.finite_strain._load_path import State
    from tsis.mechanics.finite_strain._potential import Pressures
    from tsis.mechanics.finite_strain._probe_on_slab import FinitePress
    from tsis.model.probe import Probe


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
