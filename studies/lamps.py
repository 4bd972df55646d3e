"""Where to put four lamps, so that grey levels follow the pressure and not the shape of the dent.

The dissertation prints the lamps' viewing angle and that "the direction and incident angle of light is calibrated"; it
prints neither height nor aim. Lamps that shine straight in at half height, which one would try first, cross over the
axis: their light is bright in the middle, dark between the lamps, and grazes the face, so that flanks of a dent catch
several times what the level face does. Unevenness can be measured and divided out; light that runs along the face
(``flux``), changes with its height (``growth``) or is missing elsewhere once a contact has taken it (``depletion``)
cannot, since it depends on the press. So the places are ranked by the root of the sum of the squares of what a press on
tissue, 0.2 mm deep and with a slope of 0.05, would change, and of the depletion. Steep beams meet the face often and
are evened out, but a contact then darkens the whole face; level ones meet it once and graze it.

The catalog's lamps are not the first of this table. They are those under which, beside that, the line of section 5.1 is
straight (``studies/section_5_1.py --traced``) and the camera's map of light follows rays (``benchmarks/rays.py``).

Data sheets call "viewing angle" the whole cone; section 3.4 of the dissertation compares its 30 degrees with an angle
from the axis. The catalog follows the dissertation.
"""

from __future__ import annotations

import argparse
import itertools
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.special import erfinv

import tsis
from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.optics.rays.geometry import evenly_pressed_face, evenly_raised_face
from tsis.optics.rays.tracing import trace_rays

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from tsis.model.probe import Probe

HEIGHTS_MM = (2.5, 4.0, 5.0, 6.0, 7.0, 8.5)
AIMS_DEG = (-45.0, -30.0, -15.0, 0.0, 15.0, 30.0, 45.0, 60.0)
INNER, RINGS = 0.8, 5  # of the radius, which is what an estimate reads, and rings inside it
RAISED_MM = 0.4  # the whole face, to see how the light grows
TOUCHED_SHARE = 0.25  # of the whole face, to see what light that takes away
PRESS_MM, PRESS_SLOPE = 0.2, 0.05
HEADINGS = (
    "height mm",
    "aim deg",
    "press",
    "depletion",
    "flux",
    "growth 1/mm",
    "spread",
    "darkest / brightest",
    "reaches the face",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Lighting:
    """What lamps at one height and aim do inside 0.8 of the face's radius.

    Attributes
    ----------
    height_mm, aim_deg
        Of all four lamps.
    spread
        Standard deviation of the light over its mean.
    darkest
        Least light over the greatest.
    flux
        Light that runs outwards over the light that falls on the face, root mean square over the rings.
    growth_per_mm
        Relative growth of the light where the face is raised, root mean square over the rings.
    depletion
        Light on an untouched face over that on one in full contact, less one.
    reaching
        Light that meets the face, each time it does, as a share of what the lamps send out.
    """

    height_mm: float
    aim_deg: float
    spread: float
    darkest: float
    flux: float
    growth_per_mm: float
    depletion: float
    reaching: float

    @property
    def press_error(self) -> float:
        """Relative change of the light by a press on tissue."""
        return float(np.hypot(PRESS_SLOPE * self.flux, PRESS_MM * self.growth_per_mm))

    @property
    def error(self) -> float:
        """What the places are ranked by."""
        return float(np.hypot(self.press_error, self.depletion))


def lighting(probe: Probe, *, rays: float, seed: int) -> Lighting:
    """Measure the light of a probe whose four lamps stand alike."""
    saturation, pressure = 1.0, 2 / np.sqrt(np.pi) * float(erfinv(TOUCHED_SHARE))
    found, raised, touched = (
        trace_rays(probe, pressed, rays=rays, seed=seed, saturation_kpa=saturation)
        for pressed in (
            None,
            evenly_raised_face(probe.radius_mm, RAISED_MM),
            evenly_pressed_face(probe.radius_mm, pressure),
        )
    )
    radius = np.hypot(found.x_mm, found.y_mm[:, None])
    inner = radius < INNER * probe.radius_mm
    ring = np.floor(radius[inner] / (INNER * probe.radius_mm) * RINGS).astype(int)

    def rings(light: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.bincount(ring, light[inner]), dtype=float)

    arriving = _four_fold(found.arriving)
    flux = rings((found.flux_x * found.x_mm + found.flux_y * found.y_mm[:, None]) / radius) / rings(arriving)
    growth = np.log(rings(raised.arriving) / rings(arriving)) / RAISED_MM
    lit = arriving[inner]
    return Lighting(
        height_mm=probe.led_height_mm(probe.leds[0]),
        aim_deg=probe.leds[0].aim_deg,
        spread=float(lit.std() / lit.mean()),
        darkest=float(lit.min() / lit.max()),
        flux=float(np.sqrt((flux**2).mean())),
        growth_per_mm=float(np.sqrt((growth**2).mean())),
        depletion=float((found.arriving.sum() / touched.arriving.sum() - 1) / TOUCHED_SHARE),
        reaching=float(found.arriving.sum()),
    )


def _four_fold(light: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean over the turns and mirrors that leave four lamps as they are: the same light with fewer rays' noise."""
    turned: NDArray[np.float64] = np.mean([np.rot90(light, turns) for turns in range(4)], axis=0)
    return (turned + turned.T) / 2


def run(
    probe: Probe, places: Iterable[tuple[float, float]], *, rays: float = 400_000, seed: int = 1
) -> tuple[Lighting, ...]:
    """Light of four lamps at each (height in mm, aim in degrees), the steadiest first."""
    found = []
    for height, aim in places:
        leds = tuple(replace(led, height_mm=height, aim_deg=aim) for led in probe.leds)
        found.append(lighting(replace(probe, leds=leds), rays=rays, seed=seed))
    return tuple(sorted(found, key=lambda one: one.error))


def main() -> None:
    """Print the best places, and that of the catalog's lamps."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--probe", default="tsis-2011")
    parser.add_argument("--rays", type=float, default=400_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rows", type=int, default=15)
    options = parser.parse_args()
    probe, console = tsis.load_probe(options.probe), Console()
    own = lighting(probe, rays=options.rays, seed=options.seed)
    tried = list(itertools.product(HEIGHTS_MM, AIMS_DEG))
    places = track(tried, description="tracing", console=Console(stderr=True))
    table = Table(title=f"{len(probe.leds)} lamps around {probe.name}, inside {INNER} of its radius")
    for heading in HEADINGS:
        table.add_column(heading, justify="right")
    for one in run(probe, places, rays=options.rays, seed=options.seed)[: options.rows]:
        table.add_row(*_cells(one))
    table.add_section()
    table.add_row(*_cells(own), style="bold")
    console.print(table)
    console.print("Last row: the catalog's lamps.")
    console.print(RESEARCH_USE_ONLY, style="bold")


def _cells(one: Lighting) -> tuple[str, ...]:
    numbers = (f"{value:.2f}" for value in (one.flux, one.growth_per_mm, one.spread, one.darkest))
    return (
        f"{one.height_mm:g}",
        f"{one.aim_deg:g}",
        f"{one.press_error:.1%}",
        f"{one.depletion:.1%}",
        *numbers,
        f"{one.reaching:.1%}",
    )


if __name__ == "__main__":
    main()
