"""Targets of a search: half hold an inclusion, most beside the probe's axis, all in uneven tissue, with every nuisance.

The inclusion is solved on the axis on a mesh finer and of another order than the estimator's, for the drawn tissue, and
its change is moved; lumps are added as `benchmarks.uneven_tissue` says. Light is traced, cameras see pixels, and each
virtual probe makes all its errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.simulated_presses import Protocol, SimulatedCase
from benchmarks.uneven_tissue import FaceGrid, Site, lump_changes, uneven

from tsis.imaging.rendering import render
from tsis.inclusion import InclusionPrior
from tsis.mechanics import press
from tsis.model.phantom import Inclusion, Phantom
from tsis.virtual.examinations import surround
from tsis.virtual.probe import FINE_RESOLUTION, VirtualProbe

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.image import TactileImage
    from tsis.model.press import PressField, PressMap
    from tsis.model.probe import Probe

DIAMETER_MM, DEPTH_MM, YOUNG_KPA = (2.0, 15.0), (4.0, 12.0), (40.0, 120.0)
OFFSET_MM = 5.0  # largest; distances are uniform
UNEVEN_SD = 0.1  # largest standard deviation of the log moduli of lumps; uniform
PRIOR = InclusionPrior()
COVERING_N = (0.5, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """What was drawn.

    Attributes
    ----------
    index
        In the row of targets; even ones hold an inclusion.
    site, reference
        Where is pressed, and plain tissue nearby, with lumps of its own.
    drawn
        The inclusion that it holds, or that a blank would hold: so blanks have nuisances like those of the others.
    uneven_sd
        Standard deviation of the log moduli of the lumps of both.
    """

    index: int
    drawn: Inclusion
    site: Site
    reference: Site
    uneven_sd: float

    @property
    def inclusion(self) -> Inclusion | None:
        """What is to be found."""
        return self.site.phantom.inclusion


def draw(seed: int, index: int, *, site_sd: float, uneven_most: float = UNEVEN_SD) -> Target:
    """Target ``index`` of the endless row that ``seed`` stands for. Blanks have tissue like that of the others."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index, 0)))
    diameter, depth, young = (float(rng.uniform(*ends)) for ends in (DIAMETER_MM, DEPTH_MM, YOUNG_KPA))
    away, angle = rng.uniform(0.0, OFFSET_MM), 2 * np.pi * rng.random()
    lump = Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=young)
    phantom = surround(lump, PRIOR, rng)
    phantom = replace(phantom, poisson=round(phantom.poisson, 3))  # few values: what a dome needs of each is kept
    beside = replace(
        lump, poisson=phantom.poisson, offset_mm=(float(away * np.cos(angle)), float(away * np.sin(angle)))
    )
    phantom = replace(phantom, inclusion=beside if index % 2 == 0 else None)
    nearby = phantom.young_kpa * float(np.exp(site_sd * rng.standard_normal()))
    sd = uneven_most * rng.random()
    return Target(
        index=index,
        drawn=beside,
        site=uneven(phantom, sd, rng),
        reference=uneven(replace(phantom.without_inclusion(), young_kpa=nearby), sd, rng),
        uneven_sd=float(sd),
    )


class MovingProbe(VirtualProbe):
    """A virtual probe that presses what lies beside its axis by moving what it would change there."""

    def __init__(self, probe: Probe, *, rng: np.random.Generator) -> None:
        super().__init__(probe, rng=rng, strain="small")
        self._grid = FaceGrid(probe)
        self._lumps: tuple[Inclusion, ...] = ()

    def press_site(self, site: Site, *, force_n: float) -> TactileImage:
        """One frame."""
        self._lumps = site.lumps
        return self.press(site.phantom, force_n=force_n)

    def _rendered_press(self, phantom: Phantom, force_n: float) -> NDArray[np.float64]:
        stiffer = self._stiffness
        soft, force = replace(phantom.without_inclusion(), young_kpa=phantom.young_kpa / stiffer), force_n / stiffer
        plain = self._nominal_press(soft, force)
        around = plain.on_grid(self._grid.axis, self._grid.axis)
        found = self._moved_press(phantom, soft, plain, around)
        below, beside, still = (
            render(each, self.sensor, self.calibration, contact_model=self._contact_model, light=self._light_on(each))
            for each in (replace(one, pressure_kpa=stiffer * one.pressure_kpa) for one in (plain, found, around))
        )
        # The grid blurs the rim, of which the round press knows all; so only a change is taken.
        return np.maximum(below + beside - still, 0.0)

    def _nominal_press(self, phantom: Phantom, force_n: float) -> PressField:
        """A press of what is round about the axis, by the nominal probe."""
        return press(self.probe, phantom, force_n=force_n, resolution=FINE_RESOLUTION)

    def _moved_press(self, phantom: Phantom, soft: Phantom, plain: PressField, around: PressMap) -> PressMap:
        lump, moved = phantom.inclusion, np.zeros((2, *self._grid.x.shape))
        if lump is not None:
            young = lump.young_kpa / self._stiffness
            centred = replace(soft, inclusion=replace(lump, offset_mm=(0.0, 0.0), young_kpa=young))
            field = self._nominal_press(centred, plain.force_n)
            change = np.array(
                [field.pressure_kpa - plain.pressure_kpa, field.face_displacement_mm - plain.face_displacement_mm]
            )
            moved += self._grid.moved(plain.radius_mm, change, lump.offset_mm)
        for one in self._lumps:
            changes = lump_changes(self.probe, COVERING_N)
            change = changes(one, phantom.young_kpa, plain.force_n)
            moved += self._grid.moved(changes.radius_mm, change, one.offset_mm)
        return replace(
            around,
            pressure_kpa=around.pressure_kpa + moved[0],
            face_displacement_mm=around.face_displacement_mm + moved[1],
        )


def examine(target: Target, protocol: Protocol, *, seed: int) -> SimulatedCase:
    """Press a target and its reference."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(target.index, 1)))
    probe = MovingProbe(protocol.probe, rng=rng)
    frames, references = (
        tuple(probe.press_site(site, force_n=force) for force in protocol.forces_n)
        for site in (target.site, target.reference)
    )
    return SimulatedCase(
        phantom=target.site.phantom, frames=frames, references=references, calibration=probe.calibration
    )
