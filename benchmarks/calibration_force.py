"""How often the 95 % intervals of the force calibration hold the truth, on virtual loading machines.

    python -m benchmarks.calibration_force --runs 500

Each run is a new machine with a stiffness, gain, shading, hysteresis, gauge, tips and lamps of its own, a reference of
dark, untouched and flat frames, one loading a tip of 2, 10 and 14 mm, 0 to 2 N and back in steps of 0.1 N, and three
new frames of a tip that was not calibrated. The camera has the pixels and the noise of the default one but sees a
smaller field, 256 x 216 pixels around the axis, which all contacts fit in: nothing is lost but dark pixels.

The truth of the line is the least-squares line through the machine's own noise-free sums at true forces, averaged over
the tips, under the lamps of the untouched frames. It bends a little with saturation, as a real one does.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench, Choice, Goal

import tsis
from tsis.calibration.camera_reference import make_reference
from tsis.calibration.force_line import (
    HYSTERESIS_POINT,
    TIPS_MM,
    Loading,
    fit_force_line,
    loading_forces,
    read_loading_frame,
)
from tsis.calibration.response import fit_response
from tsis.imaging.sensor import Sensor
from tsis.virtual.loading_machine import FLAT_LEVELS, VirtualLoadingMachine

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from tsis.calibration.camera_reference import CameraReference
    from tsis.calibration.force_line import ForceLine

PROBE = tsis.load_probe("tsis-direct")
SENSOR = Sensor(columns=256, rows=216)
DARK_FRAMES = UNTOUCHED_FRAMES = 8
FLAT_FRAMES = 6
NEW_FRAMES = 3
NEW_TIPS_MM, NEW_FORCES_N = (3.0, 13.0), (0.15, 1.9)


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One quantity of one run: its truth, its 95 % interval and its value."""

    quantity: str
    truth: float
    low: float
    high: float
    value: float

    @property
    def held(self) -> bool:
        """Whether the interval holds the truth."""
        return self.low <= self.truth <= self.high


def one_run(
    rng: np.random.Generator, *, patch: bool = True, repeats: int = 1, method: str = "threshold"
) -> list[Trial]:
    """Calibrate one machine and compare with its truth."""
    machine = VirtualLoadingMachine(PROBE, rng=rng, sensor=SENSOR, patch=patch)
    reference, lamps = taken_reference(machine)
    loadings = [
        loaded(machine, reference, tip, run=run + 1, method=method) for run in range(repeats) for tip in TIPS_MM
    ]
    line, diagnostics = fit_force_line(loadings, reference=reference, method=method)
    response = fit_response(loadings, reference=reference)
    intercept, slope = true_line(machine, lamps)
    gain = machine.truth.response.gain_grey_per_kpa * lamps
    low, high = response.saturation.interval()
    loop = (
        -4 * HYSTERESIS_POINT**2 * (1 - HYSTERESIS_POINT) * machine.truth.hysteresis_fraction
    )  # of the sum f (1 + 4 h f (1 - f))
    assert diagnostics.hysteresis is not None  # every tip was unloaded
    found = (
        ("intercept", intercept, line.intercept_grey),
        ("slope", slope, line.slope_grey_per_n),
        ("read noise", SENSOR.read_noise_grey, reference.read_noise_grey),
        ("shot noise", SENSOR.shot_noise_grey, reference.shot_noise_grey),
        ("gain", gain, response.gain_grey_per_kpa),
        ("hysteresis", loop, diagnostics.hysteresis),
    )
    trials = [
        Trial(quantity=name, truth=truth, low=value.interval()[0], high=value.interval()[1], value=value.value)
        for name, truth, value in found
    ]
    trials.append(
        Trial(
            quantity="saturation",
            truth=machine.truth.response.saturation_kpa,
            low=low,
            high=high,
            value=response.saturation.value_kpa,
        )
    )
    return trials + new_forces(machine, reference, line, rng)


def taken_reference(machine: VirtualLoadingMachine) -> tuple[CameraReference, float]:
    """Dark, untouched and flat frames, and the mean brightness of the lamps in the untouched ones."""
    dark = [machine.dark() for _ in range(DARK_FRAMES)]
    untouched = [machine.no_contact() for _ in range(UNTOUCHED_FRAMES)]
    lamps = float(np.mean(machine.lamps[-UNTOUCHED_FRAMES:]))
    flats = [[machine.flat(level) for _ in range(FLAT_FRAMES)] for level in FLAT_LEVELS]
    return make_reference(dark, untouched, flats, patch_px=machine.patch_px), lamps


def loaded(
    machine: VirtualLoadingMachine,
    reference: CameraReference,
    tip_mm: float,
    *,
    run: int = 1,
    forces_n: Sequence[float] | None = None,
    method: str = "threshold",
) -> Loading:
    """One loading of a tip, frames read as they come."""
    forces = loading_forces() if forces_n is None else forces_n
    readings = [
        read_loading_frame(image, reference, force_n=shown, touched=force > 0, method=method)
        for force in forces
        for image, shown in [machine.press(tip_mm, force)]
    ]
    return Loading.from_frames(tip_mm, readings, run=run)


def true_line(machine: VirtualLoadingMachine, lamps: float) -> tuple[float, float]:
    """Intercept and slope of the mean line through the noise-free sums."""
    force = np.array([one for one in loading_forces() if one > 0])
    lines = [np.polyfit(force, [lamps * machine.expected_grey(tip, float(one)) for one in force], 1) for tip in TIPS_MM]
    slope, intercept = np.mean(lines, axis=0)
    return float(intercept), float(slope)


def new_forces(
    machine: VirtualLoadingMachine, reference: CameraReference, line: ForceLine, rng: np.random.Generator
) -> list[Trial]:
    """Forces of frames of a tip that was not calibrated, with the gauge's true force beside."""
    tip, trials = float(rng.uniform(*NEW_TIPS_MM)), []
    for force in rng.uniform(*NEW_FORCES_N, NEW_FRAMES):
        image, shown = machine.press(tip, float(force))
        truth = (shown - machine.truth.gauge_zero_n) / machine.truth.gauge_gain
        total = read_loading_frame(image, reference, force_n=shown, touched=True, method=line.method).total_grey
        found = line.force_n(total)
        low, high = found.interval()
        trials.append(Trial(quantity="force of a new frame", truth=truth, low=low, high=high, value=found.value))
    return trials


def coverage(trials: Iterable[Trial]) -> dict[str, tuple[float, int, float]]:
    """By quantity: share of intervals that hold the truth, how many there were, and their median half width over it."""
    by_name: dict[str, list[Trial]] = {}
    for one in trials:
        by_name.setdefault(one.quantity, []).append(one)
    return {
        name: (
            float(np.mean([one.held for one in found])),
            len(found),
            float(np.median([(one.high - one.low) / 2 / abs(one.truth) for one in found])),
        )
        for name, found in by_name.items()
    }


def main() -> int:
    """Print the coverage of every interval."""
    bench = Bench(
        __doc__, runs=500, seed=71, repeats=1, no_patch=False, method=Choice(("threshold", "canny"), "threshold")
    )
    trials: list[Trial] = []
    for seed in np.random.SeedSequence(bench.seed).spawn(bench.runs):
        rng = np.random.default_rng(seed)
        trials += one_run(rng, patch=not bench.no_patch, repeats=bench.repeats, method=bench.method)
    chance = math.sqrt(0.95 * 0.05 / bench.runs)
    found = coverage(trials)
    rows = [
        (name, f"{chance:.1%}", "open above" if math.isinf(width) else f"{width:.2%}")
        for name, (_, _, width) in found.items()
    ]
    bench.table(f"{bench.runs} machines, {bench.method}", ("quantity", "chance", "median half width"), rows)
    return bench.end(
        Goal(name=f"{name}: 95 % interval holds, %", value=100 * share, least=93, most=97)
        for name, (share, _, _) in found.items()
    )


if __name__ == "__main__":
    sys.exit(main())
