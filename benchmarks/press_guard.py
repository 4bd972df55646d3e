"""How often the press guard raises a flag where it should and where it should not.

    python -m benchmarks.press_guard --presses 100 --seed 1

Each press draws a probe, a phantom and a force; a virtual probe with its own gain, stiffness, pattern and traced light
presses. Faults are made on the light of the press by other means than the guard reads it with, at a random size: clear
ones of 1.5 to 4 times the limit, slight ones of 0.1 to 0.67 times. A second table follows settling against the
mechanics of a relaxing press, which knows nothing of the fit. Intervals are Wilson's, at 95 %.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench
from scipy import ndimage
from scipy.optimize import brentq
from scipy.stats import binomtest, norm

import tsis
from tsis.calibration.guard.limits import GuardLimits
from tsis.calibration.guard.reading import FrameShape, GuardReference
from tsis.calibration.guard.watch import PressHistory, PressWatch, WatchState, check_press
from tsis.calibration.lamps import ReferencePatch
from tsis.calibration.settling import assess_history
from tsis.cli.progress import progress_bar
from tsis.instrument.camera import Frame
from tsis.mechanics.small_strain.relaxation import relaxing_press, settling_time_s
from tsis.model.image import TactileImage
from tsis.model.phantom import Relaxation
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    Light = NDArray[np.float64]

PHANTOMS = ("plain", "size-2", "size-8", "size-14", "depth-4", "depth-8", "hardness-40", "hardness-100")
PROBES, FORCES_N = ("tsis-2011", "tsis-domed"), (0.3, 1.2)
CLEAR, SLIGHT = (1.5, 4.0), (0.1, 0.67)
LIMITS = GuardLimits()
LIT = ReferencePatch(first_row=0, last_row=24, first_column=728, last_column=768)  # in a corner, beyond the face
LIT_GREY = 80.0
FOOT = 0.05  # of the peak: what counts as the contact
FRAMES, RATE_HZ = 48, 30.0  # of a series that is looked at for flicker


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Press:
    """The light of a press, with the probe that made it and what it is compared with."""

    light: Light
    virtual: VirtualProbe
    force_n: float
    reference: GuardReference

    @property
    def contact(self) -> NDArray[np.bool]:
        """Pixels that the press lights."""
        return np.asarray(self.light > FOOT * self.light.max())

    def radius_px(self) -> float:
        """Of the disc of the contact's area, in pixels along x."""
        size = self.virtual.sensor.mm_per_pixel
        return float(np.sqrt(self.contact.sum() * size[1] / size[0] / np.pi))

    def frame(self, light: Light, rng: np.random.Generator, *, lamps: float = 1.0, everywhere: float = 0.0) -> Light:
        """What the camera makes of it: noise drawn here, not by the sensor's own routine."""
        sensor = self.virtual.sensor
        seen = light * lamps
        seen[LIT.first_row : LIT.last_row, LIT.first_column : LIT.last_column] = LIT_GREY * lamps
        seen = seen + everywhere + sensor.background_grey
        noise = np.sqrt(sensor.read_noise_grey**2 + sensor.shot_noise_grey * seen) * rng.standard_normal(seen.shape)
        return np.clip(np.rint(seen + noise), 0.0, sensor.full_scale)

    def image(self, grey: Light) -> TactileImage:
        """A frame with what the bench knows of it."""
        return TactileImage(
            grey=grey, mm_per_pixel=self.virtual.sensor.mm_per_pixel, force_n=self.force_n, name="a press"
        )


def drawn_press(rng: np.random.Generator) -> Press:
    probe = tsis.load_probe(PROBES[int(rng.integers(len(PROBES)))])
    virtual = VirtualProbe(probe, rng=rng, strain="small")
    phantom = tsis.load_phantom(PHANTOMS[int(rng.integers(len(PHANTOMS)))])
    force = float(rng.uniform(*FORCES_N))
    bare = Press(
        light=virtual.light(phantom, force_n=force), virtual=virtual, force_n=force, reference=GuardReference()
    )
    level = virtual.light(tsis.load_phantom("plain"), force_n=1.0)
    reference = GuardReference(
        untouched=bare.image(bare.frame(np.zeros_like(level), rng)),
        level=bare.image(bare.frame(level, rng)),
        patch=LIT,
        face_radius_mm=probe.radius_mm,
        dark_grey=virtual.sensor.background_grey,
    )
    return Press(light=bare.light, virtual=virtual, force_n=force, reference=reference)


def tilted(press: Press, over: float, rng: np.random.Generator) -> Light:
    """A face that leans presses more by a share that grows evenly across the contact."""
    x, y = press.virtual.sensor.axes_mm()
    angle, radius = rng.uniform(0, 2 * np.pi), press.radius_px() * press.virtual.sensor.mm_per_pixel[0]
    along = (np.cos(angle) * x[None, :] + np.sin(angle) * y[:, None]) / radius
    return press.frame(press.light * np.maximum(1 + LIMITS.tilt * over * along, 0.0), rng)


def moved(press: Press, by_px: float, rng: np.random.Generator) -> Light:
    """The press moved in the picture, by so many of its pixels along x."""
    angle, size = rng.uniform(0, 2 * np.pi), press.virtual.sensor.mm_per_pixel
    return np.asarray(
        ndimage.shift(press.light, (by_px * np.sin(angle) * size[0] / size[1], by_px * np.cos(angle)), order=1)
    )


def off_centre(press: Press, over: float, rng: np.random.Generator) -> Light:
    return press.frame(moved(press, LIMITS.off_centre * over * press.radius_px(), rng), rng)


def saturated(press: Press, over: float, rng: np.random.Generator) -> Light:
    """So bright that a share of the contact's pixels is expected at full scale, noise and rounding counted."""
    sensor = press.virtual.sensor
    light = press.light[press.contact]

    def beyond(factor: float) -> float:
        seen = factor * light + sensor.background_grey
        noise = np.sqrt(sensor.read_noise_grey**2 + sensor.shot_noise_grey * seen)
        return float(norm.sf((sensor.full_scale - 0.5 - seen) / noise).mean()) - LIMITS.saturated * over

    brightest = sensor.full_scale / light.max()
    return press.frame(press.light * brentq(beyond, 0.5 * brightest, 4.0 * brightest), rng)


def dark(press: Press, over: float, rng: np.random.Generator) -> Light:
    """So dim that its peak lies below the limit by the factor; ``over`` below one is brighter."""
    peak = float(ndimage.uniform_filter(press.light, 5).max())
    return press.frame(press.light * (LIMITS.dark * press.virtual.sensor.full_scale / over / peak), rng)


def ambient(press: Press, over: float, rng: np.random.Generator) -> Light:
    """Light from one side, half as bright again there as in the middle."""
    rows, columns = press.light.shape
    slope = np.linspace(-0.5, 0.5, columns)[None, :] * np.ones((rows, 1)) * rng.choice([-1.0, 1.0])
    share = LIMITS.ambient * over * float(press.light.mean())
    return press.frame(press.light + share * (1 + slope), rng)


def drifted(press: Press, over: float, rng: np.random.Generator) -> Light:
    return press.frame(press.light, rng, lamps=1 + LIMITS.led_drift * over * rng.choice([-1.0, 1.0]))


def cropped(press: Press, over: float, rng: np.random.Generator) -> Light:
    """Moved until its patch, at the level that far beyond the limit, reaches the border (at most nine tenths)."""
    level = min(LIMITS.cropped * over, 0.9)
    width = press.light.shape[1]
    for by in np.linspace(0.0, 0.6, 25) * width:
        light = moved(press, float(by), np.random.default_rng(int(1e3 * over)))  # one direction
        labels, _ = ndimage.label(light > level * light.max())
        part = labels == labels[np.unravel_index(int(np.argmax(light)), light.shape)]
        if any(edge.any() for edge in (part[0], part[-1], part[:, 0], part[:, -1])):
            break
    return press.frame(light, rng)


def no_contact(press: Press, over: float, rng: np.random.Generator) -> Light:
    """A touch whose peak is below the limit by the factor; ``over`` below one is a press."""
    return press.frame(press.light * (LIMITS.contact * press.virtual.sensor.full_scale / over / press.light.max()), rng)


FAULTS: dict[str, Callable[[Press, float, np.random.Generator], Light]] = {
    "no-contact": no_contact,
    "saturated": saturated,
    "dark-frame": dark,
    "cropped": cropped,
    "off-centre": off_centre,
    "tilted": tilted,
    "ambient-light": ambient,
    "led-drift": drifted,
}


def raised(press: Press, grey: Light) -> set[str]:
    return {flag.name for flag in check_press(press.image(grey), reference=press.reference, limits=LIMITS)}


def flickers(press: Press, over: float, rng: np.random.Generator) -> bool:
    """Whether a live view raises the flag at the end of a series under a lamp that swings at 100 or 120 Hz."""
    watch = PressWatch(FrameShape.of(press.image(press.light)), reference=press.reference, limits=LIMITS)
    hertz, rate = rng.choice([100.0, 120.0]), RATE_HZ * rng.uniform(0.9, 0.98)  # at 30 Hz even 120 Hz stands still
    swing, phase = LIMITS.flicker * over * float(press.light.mean()), rng.uniform(0, 2 * np.pi)
    state = WatchState()
    for number in range(FRAMES):
        time = number / rate
        light = swing * (1 + np.cos(2 * np.pi * hertz * time + phase)) if over else 0.0
        grey = press.frame(press.light, rng, everywhere=light)
        _, state = watch.step(state, Frame(pixels=grey.astype(np.uint8), sequence=number, time_s=time))
    return "flicker" in state.raised


def shares(hits: Sequence[bool]) -> str:
    """``hits of all, share (interval)``."""
    count, total = sum(hits), len(hits)
    if not total:
        return "-"
    low, high = binomtest(count, total).proportion_ci(0.95, method="wilson")
    return f"{count} of {total}, {count / total:.1%} ({low:.1%} to {high:.1%})"


def rates(presses: int, seed: int) -> Iterable[tuple[str, str, str, str]]:
    """A row a flag: where the fault is clear, where it is slight, where there is none or another."""
    clear: dict[str, list[bool]] = defaultdict(list)
    slight: dict[str, list[bool]] = defaultdict(list)
    innocent: dict[str, list[bool]] = defaultdict(list)
    for number, child in enumerate(_each(presses, seed, "presses")):
        rng = np.random.default_rng(child)
        press = drawn_press(rng)
        names = raised(press, press.frame(press.light, rng))
        for flag, fault in FAULTS.items():
            innocent[flag].append(flag in names)
            clear[flag].append(flag in raised(press, fault(press, _factor(CLEAR, rng), rng)))
            slight[flag].append(flag in raised(press, fault(press, _factor(SLIGHT, rng), rng)))
        if number % 5 == 0:  # a series takes as long as fifty frames
            for found, over in ((clear, _factor(CLEAR, rng)), (slight, _factor(SLIGHT, rng)), (innocent, 0.0)):
                found["flicker"].append(flickers(press, over, rng))
    for flag in (*FAULTS, "flicker"):
        yield flag, shares(clear[flag]), shares(slight[flag]), shares(innocent[flag])


def _each(presses: int, seed: int, what: str) -> Iterator[np.random.SeedSequence]:
    with progress_bar(what) as progress:
        for number, child in enumerate(np.random.SeedSequence(seed).spawn(presses)):
            yield child
            progress(number + 1, presses)


def _factor(between: tuple[float, float], rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(*np.log(between))))


def settling_rows(presses: int, seed: int) -> Iterable[tuple[str, str, str, str, str]]:
    """Held presses on relaxing tissue, watched at 10 values a second: first "settled", and waiting times."""
    probe, phantom = tsis.load_probe("tsis-2011"), tsis.load_phantom("plain")
    for noise in (1e-3, 3e-3, 1e-2):
        false, late, errors = [], [], []
        for child in _each(presses, seed, f"noise {noise:g}"):
            rng = np.random.default_rng(child)
            count = int(rng.integers(1, 4))
            given = rng.dirichlet(np.ones(count)) * rng.uniform(0.1, 0.6)
            tissue = Relaxation(
                shares=tuple(np.maximum(given, 1e-3)),
                times_s=tuple(np.exp(rng.uniform(np.log(0.3), np.log(30.0), count))),
            )
            ramp = float(rng.uniform(0.2, 2.0))
            asked = partial(settling_time_s, probe, phantom, tissue, approach_mm=1.0, ramp_s=ramp)
            settled_s = asked(tolerance=LIMITS.moving)
            time = np.arange(0.1, 4.0 * settled_s + 60.0, 0.1)
            force = relaxing_press(probe, phantom, tissue, approach_mm=1.0, time_s=time, ramp_s=ramp).force_n
            said, halfway = _watched(time, force * (1 + noise * rng.standard_normal(len(time))), settled_s)
            if said is not None:
                false.append(said < settled_s)
                late.append(said - settled_s)
            if halfway is not None:
                errors.append(halfway / (settled_s / 2) - 1)
        yield (
            f"{noise:g}",
            shares(false),
            f"{np.median(late):.1f} s" if late else "-",
            f"{np.median(errors):+.0%}, spread {np.median(np.abs(errors)):.0%}" if errors else "-",
            f"{len(errors)} of {presses}",
        )


def _watched(time: Light, value: Light, settled_s: float) -> tuple[float | None, float | None]:
    """When "settled" is said first, and the waiting time that is stated at half of the true time."""
    history, halfway, asked = PressHistory(), None, 0
    for now, seen in zip(time.tolist(), value.tolist(), strict=True):
        history = history.with_sample(now, seen)
        if len(history.time_s) == asked:
            continue
        asked = len(history.time_s)
        found = assess_history(np.array(history.time_s), np.array(history.value), tolerance=LIMITS.moving)
        if now <= settled_s / 2:
            halfway = found.wait_s
        if found.settled:
            return now, halfway
    return None, halfway


def main() -> int:
    """Measure and print."""
    bench = Bench(__doc__, presses=100, settling=100, seed=1)
    bench.table(
        "Share of presses in which a flag is raised (95 % interval)",
        ("flag", "fault of 1.5 to 4 limits", "fault of 0.1 to 0.67 limits", "no fault"),
        rates(bench.presses, bench.seed),
    )
    bench.table(
        'Held presses on relaxing tissue: when "settled" is said first, and waiting times stated halfway there',
        ("noise", "said too early", "later than true (median)", "error of the waiting time (median)", "stated"),
        settling_rows(bench.settling, bench.seed),
    )
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
