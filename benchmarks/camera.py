"""How long a frame of the virtual camera takes, stage by stage, beside other programs, in one run.

    python -m benchmarks.camera

One thread. A full frame is 768 x 492 pixels under an uneven map of light that also answers to the dent's depth and
slope. Every time is the least of several repetitions; a peer that is not installed is named and left out
(`pip install galsim` brings the one that simulates detectors of telescopes).
"""

from __future__ import annotations

import sys
from importlib import import_module, metadata, util
from typing import TYPE_CHECKING

import cv2
import numpy as np
from benchmarks.harness import Bench, duration
from benchmarks.mechanics import Row, least
from rich.console import Console
from scipy.ndimage import gaussian_filter

import tsis
from tsis.imaging.rendering import render, render_reference
from tsis.imaging.sensor import Sensor, expose
from tsis.model.calibration import LightMap
from tsis.virtual.probe import nominal_calibration

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from tsis.model.press import PressField

REPEATS = 15
BLUR_MM = 0.05
SENSOR = Sensor(field_angle_deg=15.0)
ANSWER = nominal_calibration(SENSOR)


def uneven_light() -> LightMap:
    """A map of 97 x 97 nodes without symmetry, as tracing gives."""
    knots = np.linspace(-12.0, 12.0, 97)
    x, y = knots[None, :], knots[:, None]
    return LightMap(
        x_mm=knots,
        y_mm=knots,
        relative=1 + 0.2 * np.cos(0.3 * x + 0.1) * np.sin(0.25 * y),
        flux_x=0.3 * np.sin(0.2 * x) + 0 * y,
        flux_y=0.3 * np.sin(0.2 * y) + 0 * x,
        growth_per_mm=0.1 + 0.01 * np.cos(0.2 * x + 0 * y),
        error=0.0,
    )


def timed(task: str, *programs: tuple[str, Callable[[], object]]) -> Iterator[Row]:
    """A row a program; the outcome is its time over that of the first."""
    base = 0.0
    for program, call in programs:
        call()  # compiles and fills what is remembered
        seconds = least(call, REPEATS)
        base = base or seconds
        yield Row(task=task, program=program, seconds=seconds, outcome=f"{seconds / base:.2f}")


def rows() -> Iterator[Row]:
    """Every stage, then the whole frame."""
    field = tsis.mechanics.press(tsis.load_probe("tsis-2011"), tsis.load_phantom("size-8"), force_n=1.0)
    light, rng = uneven_light(), np.random.default_rng(1)
    picture = render(field, SENSOR, ANSWER, light=light)
    sigma = [BLUR_MM / size for size in SENSOR.mm_per_pixel]
    frame, plain_frame = whole_frames(field, light, rng)
    yield from timed(
        "light, shading and contact of every pixel",
        ("tsis", lambda: render(field, Sensor(), ANSWER, light=light, blur_mm=0.0)),
        ("NumPy, the formula as written", lambda: render_reference(field, Sensor(), ANSWER, light=light, blur_mm=0.0)),
    )
    yield from timed(
        "point spread",
        (
            f"OpenCV {cv2.__version__} (used)",
            lambda: cv2.GaussianBlur(picture, (0, 0), sigmaX=sigma[0], sigmaY=sigma[1]),
        ),
        (f"SciPy {metadata.version('scipy')}", lambda: gaussian_filter(picture, sigma[::-1])),
    )
    yield from timed("vignetting", ("tsis", SENSOR.vignetting))
    yield from timed(
        "normal numbers",
        ("NumPy, double precision (used)", lambda: rng.standard_normal(picture.shape)),
        ("NumPy, single precision", lambda: rng.standard_normal(picture.shape, dtype=np.float32)),
    )
    yield from timed(
        "noise, rounding, clipping",
        ("tsis", lambda: expose(picture, SENSOR, rng)),
        ("NumPy", lambda: expose_plainly(picture, rng)),
        ("NumPy, every electron counted", lambda: rng.poisson(picture / SENSOR.shot_noise_grey)),
        *galsim_noise(picture),
    )
    yield from timed("whole frame", ("tsis", frame), ("NumPy and SciPy", plain_frame))


def whole_frames(
    field: PressField, light: LightMap, rng: np.random.Generator
) -> tuple[Callable[[], NDArray[np.float64]], Callable[[], NDArray[np.float64]]]:
    """The calls that make a frame, by tsis and in NumPy's and SciPy's own passes."""
    return (
        lambda: expose(render(field, SENSOR, ANSWER, light=light), SENSOR, rng),
        lambda: expose_plainly(render_reference(field, SENSOR, ANSWER, light=light), rng),
    )


def expose_plainly(light: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """`expose` in NumPy's own passes."""
    deviation = np.sqrt(SENSOR.read_noise_grey**2 + SENSOR.shot_noise_grey * np.maximum(light, 0.0))
    noisy = light + SENSOR.background_grey + deviation * rng.standard_normal(light.shape)
    return np.clip(np.rint(noisy), 0.0, SENSOR.full_scale)


def galsim_noise(picture: NDArray[np.float64]) -> Iterator[tuple[str, Callable[[], object]]]:
    """GalSim's noise of a CCD, without rounding and clipping."""
    if util.find_spec("galsim") is None:
        Console(stderr=True).print("galsim is not installed and left out")
        return
    galsim = import_module("galsim")
    image = galsim.Image(np.ascontiguousarray(picture, dtype=np.float32))
    read = SENSOR.read_noise_grey / SENSOR.shot_noise_grey
    noise = galsim.CCDNoise(galsim.BaseDeviate(1), gain=1 / SENSOR.shot_noise_grey, read_noise=read)
    yield f"GalSim {metadata.version('galsim')}", lambda: image.copy().addNoise(noise)


def main() -> int:
    """Measure and print."""
    bench = Bench(__doc__)
    cv2.setNumThreads(1)
    found = list(rows())
    cells = [(row.task, row.program, duration(row.seconds), row.outcome) for row in found]
    bench.table("A frame", ("stage", "program", "time", "over the first"), cells)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
