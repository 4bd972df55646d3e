"""Fresh presses for judging an estimate: every nuisance drawn, made by another path than the estimator's model.

The virtual probe solves each press on a mesh that is finer and of another order than the one behind the estimator, for
the drawn tissue itself and not by interpolation; lamps are traced by rays and the camera sees pixels, not rings. Drawn
are the inclusion, the tissue's modulus, Poisson's ratio and thickness, the reference site's modulus, and all that a
virtual probe draws: its gain, stiffness, fixed pattern and shading, and each press's force, stray
light, pattern and noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.solved_data import solved_data

import tsis
from tsis.inclusion.prior import PARAMETERS
from tsis.virtual.examinations import draw_phantom, reference_site
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from tsis.inclusion import InclusionPrior
    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage
    from tsis.model.phantom import Phantom
    from tsis.model.probe import Probe


@dataclass(frozen=True, slots=True, kw_only=True)
class Protocol:
    """What is pressed how.

    Attributes
    ----------
    name
        What tables call it.
    probe_name
        Probe of the catalog.
    forces_n
        Forces of the target's presses.
    with_reference
        Whether plain tissue nearby is pressed with the same forces.
    strain
        Mechanics that make the presses: ``"small"``, as inside the estimator, or ``"finite"``.
    """

    name: str
    probe_name: str
    forces_n: tuple[float, ...]
    with_reference: bool = True
    strain: str = "small"

    @property
    def probe(self) -> Probe:
        """What presses."""
        return tsis.load_probe(self.probe_name)

    @property
    def described(self) -> str:
        """The protocol in words."""
        forces = " and ".join(f"{force:g}" for force in self.forces_n)
        reference = "each with a reference press" if self.with_reference else "no reference press"
        return f"{self.probe_name}, {forces} N, {reference}, presses at {self.strain} strain"


SMALL = (
    Protocol(name="flat-alone", probe_name="tsis-2011", forces_n=(1.0,), with_reference=False),
    Protocol(name="flat", probe_name="tsis-2011", forces_n=(1.0,)),
    Protocol(name="domed", probe_name="tsis-domed", forces_n=(0.5, 1.0)),
)
FINITE = tuple(replace(one, name=f"{one.name}-finite", strain="finite") for one in SMALL)
PROTOCOLS = {one.name: one for one in SMALL + FINITE}
DEFAULT = "domed"
DRAWN = (  # fields of a prior that decide what is drawn
    *PARAMETERS,
    "tissue_young_kpa",
    "tissue_young_sd",
    "thickness_mm",
    "thickness_sd",
    "poisson",
    "poisson_sd",
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SimulatedCase:
    """The truth, and what an examiner would hold in hand.

    Attributes
    ----------
    phantom
        Tissue and inclusion as drawn.
    frames, references
        Presses on the target, and on plain tissue nearby.
    calibration
        What the laboratory believes about the probe.
    """

    phantom: Phantom
    frames: tuple[TactileImage, ...]
    references: tuple[TactileImage, ...]
    calibration: Calibration


def examine(protocol: Protocol, phantom: Phantom, rng: np.random.Generator) -> SimulatedCase:
    """Press a phantom by the protocol, with a virtual probe and a reference site of its own."""
    virtual = VirtualProbe(protocol.probe, rng=rng, strain=protocol.strain)
    site = reference_site(virtual, phantom, rng)
    with solved_data():
        frames = tuple(virtual.press(phantom, force_n=force) for force in protocol.forces_n)
        references = tuple(virtual.press(site, force_n=force) for force in protocol.forces_n if protocol.with_reference)
    return SimulatedCase(phantom=phantom, frames=frames, references=references, calibration=virtual.calibration)


def simulate(protocol: Protocol, prior: InclusionPrior, *, seed: int, index: int) -> SimulatedCase:
    """Case ``index`` of the endless row that ``seed`` stands for: the same however many are asked for."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
    return examine(protocol, draw_phantom(prior, rng), rng)
