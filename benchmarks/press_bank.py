"""Simulated cases of one protocol in one world, each made when it is asked for."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

from benchmarks.simulated_presses import DRAWN, Protocol, SimulatedCase, simulate
from benchmarks.worlds import WORLDS, World, seen_by_product, simulate_world

import tsis
from tsis.imaging.sensor import Sensor
from tsis.optics.face_light import irradiance
from tsis.virtual.probe import nominal_calibration

if TYPE_CHECKING:
    from tsis.inclusion import InclusionPrior
    from tsis.model.calibration import Calibration


@dataclass(frozen=True, slots=True, kw_only=True)
class PressBank:
    """An endless row of cases.

    Attributes
    ----------
    protocol, prior, seed
        What is simulated.
    world, blank
        What differs from the estimator's model, and whether the inclusion is left out.
    """

    protocol: Protocol
    prior: InclusionPrior
    seed: int
    world: World = WORLDS["as-model"]
    blank: bool = False

    @property
    def name(self) -> str:
        """Protocol, world and whether blank."""
        world = "" if self.world == WORLDS["as-model"] else f"-{self.world.name}"
        return f"{self.protocol.name}{world}{'-blank' if self.blank else ''}"

    @property
    def strain(self) -> str:
        """Mechanics of the presses."""
        return "finite" if "finite" in (self.world.strain, self.protocol.strain) else "small"

    def content(self) -> dict[str, Any]:
        """What decides the frames, but for the code that makes them."""
        known = believed(self.protocol)
        light = None if known.light is None else known.light.sha256
        differs = {} if self.name == self.protocol.name else {"world": asdict(self.world), "blank": self.blank}
        return differs | {
            "tsis": tsis.__version__,
            "seed": self.seed,
            "protocol": asdict(self.protocol),
            "probe": asdict(self.protocol.probe),
            "drawn from": {name: getattr(self.prior, name) for name in DRAWN},
            "calibration": asdict(replace(known, light=None)) | {"light": light},
        }

    def case(self, index: int) -> SimulatedCase:
        """Case ``index``; a MechanicsError where the drawn tissue is too soft for the mechanics."""
        return seen_by_product(self.world, self.protocol, self.raw(index), seed=self.seed)

    def raw(self, index: int) -> SimulatedCase:
        """Case ``index`` before the product corrects its frames for lamps."""
        if self.name == self.protocol.name:
            return simulate(self.protocol, self.prior, seed=self.seed, index=index)
        return simulate_world(self.world, self.protocol, self.prior, seed=self.seed, index=index, blank=self.blank)


def believed(protocol: Protocol) -> Calibration:
    """What every virtual probe of the protocol is believed to answer."""
    probe = protocol.probe
    return replace(nominal_calibration(Sensor(), irradiance(probe)), probe=probe.name)
