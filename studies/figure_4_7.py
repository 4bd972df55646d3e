"""Figure 4.7: an inclusion of 2 mm pressed with 0.7 N, seen raw, in colour and as a relief.

The source presses a bought phantom whose inclusion has a diameter of 2 mm, and reads from its picture that grey levels
are a bell, brightest at their centroid. It prints no number, and of the phantom nothing but that diameter. Here the
catalog's `mammacare-2` is pressed by the virtual probe; depth 5 mm, 100 kPa and tissue of 5 kPa are assumed.

Found: the picture is such a bell, but plain tissue makes it, too. Its shape is that of the lamps' light, which gathers
in the middle of the face; under even light the middle is flat. The inclusion, so small and so deep, adds little more
than one grey level to nearly sixty. The light rises again at the face's rim, where pressure concentrates.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage
from studies.shown import Shown

import tsis
from tsis.imaging import features
from tsis.imaging.corrections import signal
from tsis.imaging.sensor import Sensor
from tsis.imaging.surface import height_surface
from tsis.optics.face_light import irradiance
from tsis.present.figures import relief, tactile_image
from tsis.virtual.probe import VirtualProbe, nominal_calibration

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.imaging import Features
    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage

PROBE = tsis.load_probe("tsis-2011")
PHANTOM = tsis.load_phantom("mammacare-2")
FORCE_N = 0.7
SMOOTH_PX = 4.0  # of the cross-section that is drawn


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """One press.

    Attributes
    ----------
    raw, untouched
        Frames of the press and of the probe without contact.
    expected, plain
        Grey levels above the background without any error of the bench, over the inclusion and over plain tissue of
        the same modulus, shape (rows, columns).
    """

    raw: TactileImage
    untouched: TactileImage
    expected: NDArray[np.float64]
    plain: NDArray[np.float64]

    @property
    def seen(self) -> Features:
        """What the frame says of the contact."""
        return features(self.raw, self.untouched)

    @property
    def added(self) -> float:
        """What the inclusion adds where it adds most, grey levels, without errors."""
        return float((self.expected - self.plain).max())

    def row(self, image: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Places in mm and grey levels along the middle row."""
        x = (np.arange(image.shape[1]) - (image.shape[1] - 1) / 2) * self.raw.scale()[0]
        return x, image[image.shape[0] // 2]

    def off_the_centroid_mm(self) -> float:
        """How far the brightest place of the smoothed frame lies from the centroid."""
        centroid = self.seen.centroid_px
        if centroid is None:
            return float("nan")
        smooth = ndimage.gaussian_filter(signal(self.raw, self.untouched).grey, 4 * SMOOTH_PX)
        row, column = np.unravel_index(int(smooth.argmax()), smooth.shape)
        across, down = self.raw.scale()
        return float(np.hypot(across * (column - centroid[0]), down * (row - centroid[1])))


def run(rng: np.random.Generator) -> Result:
    """Press once, and once more without errors over the inclusion and over plain tissue."""
    light = irradiance(PROBE)
    probe = VirtualProbe(PROBE, rng=rng, light=light, strain="small")
    exact = VirtualProbe(
        PROBE, rng=rng, light=light, calibration=without_errors(nominal_calibration(Sensor(), light)), strain="small"
    )
    return Result(
        raw=probe.press(PHANTOM, force_n=FORCE_N),
        untouched=probe.no_contact(),
        expected=exact.light(PHANTOM, force_n=FORCE_N),
        plain=exact.light(PHANTOM.without_inclusion(), force_n=FORCE_N),
    )


def without_errors(answer: Calibration) -> Calibration:
    """The same answer to pressure of a bench that makes no errors."""
    return replace(
        answer,
        gain_sd=0.0,
        force_sd=0.0,
        offset_sd=0.0,
        pattern_sd=0.0,
        repeatability_sd=0.0,
        shading_sd=0.0,
        probe_young_sd=0.0,
    )


def values(result: Result) -> dict[str, float]:
    """Numbers of the picture."""
    seen = result.seen
    if seen.area_mm2 is None or seen.equivalent_diameter_mm is None:
        return {}
    return {
        "brightest grey level above the untouched probe": seen.peak,
        "brightest place, distance from the centroid": result.off_the_centroid_mm(),
        "equivalent diameter of the bright patch": seen.equivalent_diameter_mm,
        "area of the bright patch": seen.area_mm2,
        "sum of grey levels of the bright patch, in millions": seen.total / 1e6,
        "what the inclusion adds, greatest": result.added,
        "what the inclusion adds, over the brightest": 100 * result.added / float(result.plain.max()),
    }


def draw(result: Result, figure: Figure) -> None:
    """Raw, as a relief in colour, and its middle row beside that of plain tissue."""
    grid = figure.add_gridspec(2, 2, width_ratios=(1.0, 1.2))
    raw, across = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
    tactile_image(result.raw, raw, colours="gray").set_title(f"raw, {FORCE_N:g} N", fontsize=10)
    changed = signal(result.raw, result.untouched)
    solid = figure.add_subplot(grid[:, 1], projection="3d")
    relief(height_surface(changed, max_points=36), solid).set_title("in colour, as a relief", fontsize=10)
    solid.collections[0].set_antialiased(False)  # no white seams between faces
    solid.set_box_aspect((1.3, 1.0, 0.65), zoom=0.85)  # room for the label of the heights
    smooth = ndimage.gaussian_filter(changed.grey, SMOOTH_PX)
    across.plot(*result.row(smooth), color="#0072b2", label="over the inclusion")
    across.plot(*result.row(result.plain), color="#d55e00", linestyle="--", label="plain tissue, without errors")
    added = 10 * (result.expected - result.plain)
    across.plot(*result.row(added), color="#009e73", linestyle=":", label="ten times what the inclusion adds")
    across.set(xlabel="x / mm", ylabel="grey level", ylim=(-3.0, 115.0))  # room for the legend
    across.legend(loc="upper center", fontsize=8)


SHOWN = (Shown(name="figure-4-7", run=run, values=values, draw=draw),)


def main() -> None:
    """Print the numbers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    for quantity, value in values(run(np.random.default_rng(parser.parse_args().seed))).items():
        print(f"{quantity:54} {value:8.4g}")
    print("Research use only")


if __name__ == "__main__":
    main()
