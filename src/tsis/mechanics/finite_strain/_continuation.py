"""Continuation in state: equilibria of neighbouring slabs, each started from the last one.

All slabs are meshed on the same lines, so that their meshes have one topology and their nodes move smoothly with
diameter, depth and thickness. Displacements and pressures of one equilibrium then start Newton's method in the next;
where it does not converge, a state in between comes first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.errors import MechanicsError
from tsis.mechanics.finite_strain import _load_path as load_path
from tsis.mechanics.finite_strain._meshes import FiniteResolution, slab_lines
from tsis.mechanics.finite_strain._potential import Load
from tsis.mechanics.finite_strain._probe_on_slab import SPRING, ProbeOnSlab
from tsis.model import MN_PER_N, Inclusion, Phantom

if TYPE_CHECKING:
    from tsis.mechanics.finite_strain._load_path import State
    from tsis.mechanics.finite_strain._meshes import SlabLines
    from tsis.mechanics.finite_strain._probe_on_slab import FinitePress
    from tsis.model import Probe


SMALLEST_PART = 1 / 256  # of the way to a state, before the continuation gives up
GROWTH = 2.0
FIRST_LOAD = 0.1  # of the force: the load path to the first state begins there


@dataclass(frozen=True, slots=True, kw_only=True)
class SlabPress:
    """A press on a slab with a sphere under the axis; a contrast of 1 is tissue without inclusion.

    Attributes
    ----------
    diameter_mm, depth_mm
        Diameter of the sphere and depth of its top.
    contrast
        Modulus of the sphere over that of the tissue.
    tissue_young_kpa, thickness_mm, poisson
        The slab; Poisson's ratio is also that of the sphere.
    force_n
        Force of the press.
    """

    diameter_mm: float
    depth_mm: float
    contrast: float
    tissue_young_kpa: float
    thickness_mm: float
    force_n: float
    poisson: float = 0.49

    @property
    def phantom(self) -> Phantom:
        """The slab with its sphere."""
        sphere = Inclusion(
            diameter_mm=self.diameter_mm,
            depth_mm=self.depth_mm,
            young_kpa=self.contrast * self.tissue_young_kpa,
            poisson=self.poisson,
        )
        return Phantom(
            young_kpa=self.tissue_young_kpa, poisson=self.poisson, thickness_mm=self.thickness_mm, inclusion=sphere
        )

    def towards(self, other: SlabPress, fraction: float) -> SlabPress:
        """State at a fraction of the way; lengths in proportion, moduli and forces in their logarithms."""

        def linear(name: str) -> float:
            return float((1 - fraction) * getattr(self, name) + fraction * getattr(other, name))

        def geometric(name: str) -> float:
            return float(getattr(self, name) ** (1 - fraction) * getattr(other, name) ** fraction)

        if fraction == 1.0:
            return other
        return SlabPress(
            diameter_mm=linear("diameter_mm"),
            depth_mm=linear("depth_mm"),
            thickness_mm=linear("thickness_mm"),
            poisson=linear("poisson"),
            contrast=geometric("contrast"),
            tissue_young_kpa=geometric("tissue_young_kpa"),
            force_n=geometric("force_n"),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SolvedPress:
    """A press in equilibrium, from which others start."""

    press: SlabPress
    state: State
    result: FinitePress


class PressContinuation:
    """Presses of one probe on slabs whose meshes have one topology, that of ``like``."""

    def __init__(self, probe: Probe, like: Phantom, resolution: FiniteResolution | None = None) -> None:
        self.probe, self._resolution = probe, resolution or FiniteResolution()
        self._lines: SlabLines = slab_lines(like, probe, self._resolution)
        self.solves = 0  # calls of Newton's method, those without convergence included

    def first(self, press: SlabPress) -> SolvedPress:
        """A press without a neighbour, by load steps."""
        model = self._model(press)
        force = press.force_n * MN_PER_N
        touch = load_path.find_first_contact(
            model.potential, model.deformed, model.touch_mm, SPRING, below_mn=FIRST_LOAD * force / 2
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
        done, part, here = 0.0, 1.0, start
        while done < 1.0:
            ahead = 1.0 if done + part > 0.999 else done + part
            press = start.press.towards(target, ahead)
            solved = self._solve(here, press, exact=ahead == 1.0)
            if isinstance(solved, SolvedPress):
                part, done, here = (ahead - done) * GROWTH, ahead, solved
                continue
            part = (ahead - done) / 2
            if part < SMALLEST_PART:
                raise MechanicsError(
                    f"{solved} between {start.press} and {target}, {100 * done:.0f} % of the way: choose a state "
                    "nearer to the first"
                )
        return here

    def _model(self, press: SlabPress) -> ProbeOnSlab:
        return ProbeOnSlab(self.probe, press.phantom, self._resolution, lines=self._lines)

    def _solve(self, start: SolvedPress, press: SlabPress, *, exact: bool) -> SolvedPress | str:
        """The press, or why there is none."""
        model = self._model(press)
        self.solves += 1
        state = load_path.solve_equilibrium(
            model.potential,
            start.state.unknowns,
            start.state.pressures,
            Load(force_mn=press.force_n * MN_PER_N),
            decrement=load_path.DECREMENT if exact else load_path.ROUGH,
        )
        if state is None:
            return "the press does not converge"
        reason = model.refuse(state)
        if reason is not None:
            return reason
        return SolvedPress(press=press, state=state, result=model.read(state, press.force_n))
