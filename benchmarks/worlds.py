"""Worlds that differ from the estimator's: uneven or layered tissue, finite strain, lamps, misplaced presses, and all.

Uneven tissue is a random field of the logarithm of the modulus in three dimensions, a sum of plane waves, the same for
all forces at one site and drawn anew for the reference site, zero inside the inclusion. What it changes is solved for
the drawn tissue, inclusion and probe on a finer mesh of another order than the estimator's table, with six harmonics
around the axis, and added to the press of even tissue. `benchmarks.misplaced` has offsets and tilts.

A superficial layer, which target and reference have in common, is solved with the layer in the mesh, where the
estimator's table is linear in the logarithm of its modulus.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.lamp_laws import LAMP_LAWS, CalibratedProbe, calibrated_probe
from benchmarks.misplaced import SphereField, field_change, moved_change, tilt_change
from benchmarks.simulated_presses import Protocol, SimulatedCase
from benchmarks.solved_data import solved_data
from scipy.special import jv

from tsis.mechanics.tissue_field import FieldMesh, TissueFieldResponse
from tsis.virtual.examinations import draw_phantom
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.inclusion import InclusionPrior
    from tsis.model.image import TactileImage
    from tsis.model.phantom import Phantom
    from tsis.model.probe import Probe

WAVES, HARMONICS, GRID_MM = 100, 6, 0.25
FARTHEST = 2.5  # of the face's radius; tissue beyond hardly matters to the press
FINE_MESH = FieldMesh(order=4, finest=0.04, largest=0.14, growth=1.8, points=121)
STRAY_SD = 0.01  # of the light of a press, under lamps
RANDOM_SD, RANDOM_MM = (0.0, 0.2), (2.0, 13.0)  # ranges of fields that are drawn anew in each case


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """What differs from the estimator's model.

    Attributes
    ----------
    name
        What tables call it.
    sd, length_mm
        Standard deviation of the log modulus and its correlation length; None draws both.
    rough
        Whether the correlation is exponential in the distance, and not Gaussian.
    strain
        Mechanics of the presses of even tissue.
    lamps
        One of `LAMP_LAWS`, with the calibration that the product makes; empty for the estimator's own light map.
    dents_measured
        Whether that calibration includes the step with soft pads.
    """

    name: str
    sd: float | None = 0.0
    length_mm: float | None = 5.0
    rough: bool = False
    strain: str = "small"
    lamps: str = ""
    dents_measured: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class MisplacedWorld(World):
    """A world in which the examiner misses.

    Attributes
    ----------
    offset_mm
        Largest distance of the inclusion from the axis; each case draws one, uniform.
    tilt_deg
        Largest tilt of the probe; each site draws one, uniform, for all its presses.
    """

    offset_mm: float = 0.0
    tilt_deg: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LayeredWorld(World):
    """A world with a superficial layer: its thickness in mm and its modulus over the tissue's."""

    layer: tuple[float, float]


LAYERS = tuple((thickness, factor) for thickness in (0.5, 1.0, 2.0, 3.0) for factor in (0.3, 0.7, 1.4, 3.0, 10.0))
WORLDS: dict[str, World] = {
    world.name: world
    for world in (
        World(name="as-model"),
        World(name="prior", sd=None, length_mm=None),
        World(name="finite", strain="finite"),
        *(
            World(name=f"uneven-{100 * sd:.0f}-{length:g}", sd=sd, length_mm=length)
            for sd in (0.05, 0.1, 0.15)
            for length in (2.5, 5.0, 10.0)
        ),
        World(name="rough-10-5", sd=0.1, rough=True),
        World(name="finite-uneven-10-5", sd=0.1, strain="finite"),
        World(name="together", sd=0.1, strain="finite", lamps="traced"),
        MisplacedWorld(name="off-axis", offset_mm=4.0),
        MisplacedWorld(name="tilt", tilt_deg=3.0),
        MisplacedWorld(name="all", sd=0.1, strain="finite", lamps="traced", offset_mm=4.0, tilt_deg=3.0),
        *(LayeredWorld(name=f"layer-{mm:g}-{factor:g}", layer=(mm, factor)) for mm, factor in ((1.0, 1.0), *LAYERS)),
        *(World(name=f"lamps-{law}", lamps=law) for law in LAMP_LAWS),
        *(World(name=f"lamps-{law}-no-pads", lamps=law, dents_measured=False) for law in LAMP_LAWS),
    )
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RandomField:
    """A field of log modulus of unit variance: plane waves of random direction and phase."""

    wave_per_mm: NDArray[np.float64]  # shape (waves, 3)
    phase: NDArray[np.float64]

    @classmethod
    def drawn(cls, length_mm: float, rng: np.random.Generator, *, rough: bool) -> RandomField:
        """A field of one correlation length."""
        wave = rng.standard_normal((WAVES, 3)) / length_mm
        if rough:  # the spectrum of an exponential correlation is a mixture of normal ones
            wave /= np.sqrt(rng.chisquare(1, size=(WAVES, 1)))
        return cls(wave_per_mm=wave, phase=rng.uniform(0, 2 * np.pi, WAVES))

    def harmonic(
        self, order: int, radius_mm: NDArray[np.float64], depth_mm: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Parts of cos and sin of ``order`` times the angle around the axis, shape (2, points)."""
        across = np.hypot(self.wave_per_mm[:, 0], self.wave_per_mm[:, 1])
        angle = np.arctan2(self.wave_per_mm[:, 1], self.wave_per_mm[:, 0])
        beta = np.outer(self.wave_per_mm[:, 2], depth_mm) + self.phase[:, None] + order * np.pi / 2
        ring = jv(order, np.outer(across, radius_mm)) * np.cos(beta) * (1 if order == 0 else 2)
        parts = np.stack([np.cos(order * angle), np.sin(order * angle)])
        return np.asarray(np.sqrt(2 / WAVES) * parts @ ring)


class UnevenProbe(VirtualProbe):
    """A virtual probe on tissue whose modulus is a random field."""

    def __init__(
        self, probe: Probe, *, rng: np.random.Generator, strain: str, lamps: CalibratedProbe | None = None
    ) -> None:
        light, truth = (None, None) if lamps is None else (lamps.light, lamps.truth)
        super().__init__(probe, rng=rng, strain=strain, light=light, calibration=truth)
        self._level = None if light is None else light.at(*self.sensor.axes_mm())
        steps = int(np.ceil(probe.radius_mm / GRID_MM))
        self._axis = GRID_MM * np.arange(-steps, steps + 1)
        x, y = np.meshgrid(self._axis, self._axis)
        self._grid = np.hypot(x, y), np.arctan2(y, x)
        self._change = np.zeros((2, 2, *x.shape))
        self._place, self._kernels = (0.0, 0.0), np.zeros((2, *self._change.shape))

    def on_site(self, phantom: Phantom, field: RandomField, sd: float) -> None:
        """Solve what the field changes, by unit and shape of a press: pressure and displacement over the grid."""
        self._change[:] = 0.0
        self._kernels[:] = 0.0
        if sd == 0:
            return
        slab = self._slab(phantom)
        for order in range(HARMONICS + 1):
            radius, depth = slab.points_mm(order)
            parts = np.zeros((2, len(radius)))
            tissue = (radius < FARTHEST * self.probe.radius_mm) & ~slab.inside(radius, depth)
            parts[:, tissue] = sd * field.harmonic(order, radius[tissue], depth[tissue])
            self._change += field_change(slab, order, slab.response(order), parts, self._grid)

    def on_layer(self, phantom: Phantom, layer: tuple[float, float]) -> None:
        """Solve what a layer changes: the press with it less that without it, on one mesh."""
        slab, even = (self._slab(phantom, (layer[0], factor)) for factor in (layer[1], 1.0))
        change = np.array(slab.press()) - np.array(even.press())
        radius, _ = self._grid
        inside = radius <= self.probe.radius_mm
        self._change = np.array(
            [[inside * np.interp(radius, slab.radius_mm, press) for press in part] for part in change]
        )

    def misplaced(self, phantom: Phantom, place: tuple[float, float], tilt: tuple[float, float]) -> None:
        """Move the inclusion of this site from the axis to a distance in mm and an angle, and tilt the probe.

        The tilt is in degrees, with its direction.
        """
        self._place = place
        self._change[:, 1] += tilt_change(self._slab(phantom), *tilt, self._grid)
        if phantom.inclusion is None:
            return
        slab = self._slab(phantom.without_inclusion())
        spheres = [SphereField.of(phantom.inclusion, offset, place[1]) for offset in (0.0, place[0])]
        for order in range(HARMONICS + 1):
            response = slab.response(order)
            for kernel, sphere in zip(self._kernels, spheres, strict=True):
                parts = sphere.harmonic(order, response.radius_mm, response.depth_mm)
                kernel += field_change(slab, order, response, parts, self._grid)

    def _slab(self, phantom: Phantom, layer: tuple[float, float] | None = None) -> TissueFieldResponse:
        """The site's tissue under the nominal probe."""
        stiffer, inclusion = self._stiffness, phantom.inclusion
        return TissueFieldResponse(
            self.probe,
            young_kpa=phantom.young_kpa / stiffer,
            thickness_mm=phantom.thickness_mm,
            poisson=phantom.poisson,
            inclusion=None
            if inclusion is None
            else (inclusion.diameter_mm, inclusion.depth_mm, inclusion.young_kpa / stiffer),
            layer=layer,
            mesh=FINE_MESH,
        )

    def light(self, phantom: Phantom, *, force_n: float) -> NDArray[np.float64]:
        """As for a `VirtualProbe`; the stray light of lamps follows their light on the face, as does the machine's."""
        light = super().light(phantom, force_n=force_n)
        if self._level is None:
            return light
        stray = STRAY_SD * self._rng.standard_normal() * float(np.median(light / np.maximum(self._level, 0.02)))
        return light + stray * self._level

    def _rendered_press(self, phantom: Phantom, force_n: float) -> NDArray[np.float64]:
        if not phantom.is_axisymmetric:
            return super()._rendered_press(phantom, force_n)
        even = self._round_press(phantom, force_n)
        stiffer = self._stiffness
        change = self._change[:, 1] + force_n / stiffer * self._change[:, 0]
        change[0] *= stiffer
        if self._kernels.any():
            kernels = self._kernels[:, :, 1] + force_n / stiffer * self._kernels[:, :, 0]
            kernels[:, 0] *= stiffer
            bare = self._round_press(phantom.without_inclusion(), force_n)
            change += moved_change((even, bare), (kernels[0], kernels[1]), self._place, self._grid)
        if not change.any():
            return self._rendered(even)
        around = even.on_grid(self._axis, self._axis)
        beside = replace(
            around,
            pressure_kpa=np.maximum(around.pressure_kpa + change[0], 0.0),
            face_displacement_mm=around.face_displacement_mm + change[1],
        )
        # The grid blurs the rim, which the round press has in full: the grid gives only the change.
        return np.maximum(self._rendered(even) + self._rendered(beside) - self._rendered(around), 0.0)


def simulate_world(
    world: World, protocol: Protocol, prior: InclusionPrior, *, seed: int, index: int, blank: bool = False
) -> SimulatedCase:
    """Case ``index`` of a seed in a world; ``blank`` leaves the inclusion out.

    The frames are raw, with the nominal calibration; `seen_by_product` gives those of a world of lamps to an estimate.
    Under lamps the probe and its calibration are drawn by the seed too, the same for all its cases.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
    phantom = draw_phantom(prior, rng)
    phantom = phantom.without_inclusion() if blank else phantom
    lamps = calibrated_probe(world.lamps, protocol.probe, seed) if world.lamps else None
    virtual = UnevenProbe(protocol.probe, rng=rng, strain=world.strain, lamps=lamps)
    nearby = phantom.young_kpa * float(np.exp(virtual.calibration.site_sd * rng.standard_normal()))
    layer = world.layer if isinstance(world, LayeredWorld) else None
    if layer is None:
        drawn_sd, drawn_mm = rng.uniform(*RANDOM_SD), float(np.exp(rng.uniform(*np.log(RANDOM_MM))))
        sd = drawn_sd if world.sd is None else world.sd
        length = drawn_mm if world.length_mm is None else world.length_mm
    missed = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index, 1)))
    presses: list[tuple[TactileImage, ...]] = []
    for site in (phantom, replace(phantom.without_inclusion(), young_kpa=nearby)):
        with solved_data():
            if layer is None:
                virtual.on_site(site, RandomField.drawn(length, rng, rough=world.rough), sd)
            else:
                virtual.on_layer(site, layer)
            if isinstance(world, MisplacedWorld):
                place, tilt = (
                    (missed.uniform(0.0, most), missed.uniform(0.0, 2 * np.pi))
                    for most in (world.offset_mm, world.tilt_deg)
                )
                virtual.misplaced(site, place, tilt)
            presses.append(tuple(virtual.press(site, force_n=force) for force in protocol.forces_n))
    return SimulatedCase(phantom=phantom, frames=presses[0], references=presses[1], calibration=virtual.calibration)


def seen_by_product(world: World, protocol: Protocol, case: SimulatedCase, *, seed: int) -> SimulatedCase:
    """The case with the frames and the calibration that the product hands to an estimate."""
    if not world.lamps:
        return case
    lamps = calibrated_probe(world.lamps, protocol.probe, seed)
    frames, known = lamps.corrected((*case.frames, *case.references), with_dents=world.dents_measured)
    count = len(case.frames)
    return replace(case, frames=frames[:count], references=frames[count:], calibration=known)
