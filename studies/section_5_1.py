"""Section 5.1: the sum of grey levels against the force, and which contact model it agrees with.

The source presses tips of 2, 10 and 14 mm radius on the probe, 0 to 2 N in steps of 0.1 N, and finds a straight line,
``1e6 (0.056 + 1.4778 F)`` with F in newtons, and 2.45 % between the tips of 10 and 14 mm at 0.8 N. It says nothing of
the probe's modulus, of the camera's gain nor of the roughness. Here the tips are Hertz's, on a half-space of the
catalog probe's effective modulus (3.78); beyond 0.35 N the tip of 2 mm would sink in over its equator, so that its part
of the plot continues the formula and not the experiment.

Chosen for the bench: asperities of a root mean square slope of 1.25, so that the real contact saturates at
``E* slope / 2 = 115 kPa`` of the skin, half as much again as the peak of 75 kPa under the tip of 2 mm at 2 N; a gain
that makes the line as steep as the printed one; the default lens, whose 26 x 19 mm hold every contact. With the printed
6.79 um a pixel the frame would be 5.2 x 3.3 mm and crop most of the wide contacts.

Found: rough contact gives straight lines that hardly depend on the tip. Smooth contact contradicts them. Light that
leaves by curvature bends the line too, but its tips differ little, since ``int |grad u| dA`` inside Hertz's contact is
proportional to the force for every tip; what speaks against it is the cross-section of figure 5.2, brightest in the
middle, where a dent has no slope. Asperities gentler than a slope of 1 saturate under the tip of 2 mm, and its exponent
falls below 0.97; the printed intercept over the printed slope, 0.038 N, is that of a slope between 0.8 and 1.

All that is for even light. Under the traced light of the catalog's lamps the wide tips' exponents are 0.92 to 0.94 if
only the light of the untouched face counts, and 0.99 to 1.01 with what the dents make of it: wider contacts reach into
dimmer light and deeper dents catch more, and with these lamps both cancel. Between the two tips 5 % are left.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import tsis
from tsis.imaging.rendering import CONTACT_MODELS, find_lost_light, render
from tsis.imaging.sensor import LedDrift, Sensor, expose
from tsis.mechanics.closed_forms import effective_modulus_kpa, hertz_under_force
from tsis.mechanics.small_strain.rigid_ball import indent
from tsis.model.calibration import Calibration
from tsis.model.press import PressField
from tsis.optics.face_light import irradiance
from tsis.virtual.probe import nominal_calibration

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from tsis.imaging.rendering import LostLight
    from tsis.model.calibration import LightMap
    from tsis.optics.face_light import Irradiance


PRINTED_SLOPE = 1.4778e6  # grey levels a newton, (5.4)
RMS_SLOPE = 1.25
MN = 1000.0
PROBE = tsis.load_probe("tsis-2011")
SENSOR = Sensor()


def plane_strain(young_kpa: float, poisson: float) -> float:
    """``E* = E / (1 - nu**2)``."""
    return young_kpa / (1 - poisson**2)


def half_space_kpa() -> float:
    """``E*`` of the half-space that stands for the probe."""
    return plane_strain(effective_modulus_kpa(PROBE.layers), PROBE.layers[0].poisson)


def saturation_kpa(rms_slope: float) -> float:
    """Pressure at which asperities of that slope touch all over: they touch a share ``2 p / (E* slope)`` at first."""
    skin = PROBE.layers[0]
    return plane_strain(skin.young_kpa, skin.poisson) * rms_slope / 2


def bench(rms_slope: float = RMS_SLOPE) -> Calibration:
    """A gain that gives the printed slope while no asperity saturates."""
    pixel = SENSOR.mm_per_pixel[0] * SENSOR.mm_per_pixel[1]
    return Calibration(gain_grey_per_kpa=PRINTED_SLOPE * pixel / MN, saturation_kpa=saturation_kpa(rms_slope))


def full_contact() -> float:
    """Grey levels where all asperities touch."""
    return bench().gain_grey_per_kpa * bench().saturation_kpa


def pressed(tip_mm: float, force_n: float) -> PressField:
    """Hertz's pressure and displacement on a half-space with the probe's effective modulus."""
    contact = hertz_under_force(
        radius_mm=tip_mm,
        force_mn=force_n * MN,
        young_kpa=effective_modulus_kpa(PROBE.layers),
        poisson=PROBE.layers[0].poisson,
    )
    edge = contact.contact_radius_mm
    inner = edge * np.sin(np.linspace(0.0, np.pi / 2, 400))  # dense where the pressure ends
    radius = np.concatenate([inner, np.geomspace(edge, max(PROBE.radius_mm, 1.01 * edge), 400)[1:]])
    return PressField(
        radius_mm=radius,
        pressure_kpa=np.where(radius < edge, contact.pressure_kpa(radius), 0.0),
        face_displacement_mm=displaced(radius, edge, tip_mm),
        approach_mm=edge**2 / tip_mm,
        force_n=force_n,
    )


def displaced(radius: NDArray[np.float64], edge: float, tip_mm: float) -> NDArray[np.float64]:
    """Displacement of a half-space under Hertz's pressure: the sphere's paraboloid inside, what it drags along outside.

    ``u = ((2 a**2 - r**2) asin(a / r) + a sqrt(r**2 - a**2)) / (pi R)`` for r > a.
    """
    beyond = np.maximum(radius, edge)
    dragged = (2 * edge**2 - radius**2) * np.arcsin(edge / beyond) + edge * np.sqrt(beyond**2 - edge**2)
    return np.where(radius <= edge, (2 * edge**2 - radius**2) / (2 * tip_mm), dragged / (np.pi * tip_mm))


TIPS_MM = (2.0, 10.0, 14.0)
FORCES_N = np.arange(1, 21) / 10
COMPARED_N = 0.8
PRINTED_INTERCEPT, PRINTED_DIFFERENCE = 0.056e6, 0.0245
PRINTED_PIXEL_MM = 6.79e-3
OTHER_SLOPES = (0.25, 0.5, 0.8, 1.0, 1.25, 2.0)
GENTLE_N = np.arange(2, 11) / 20  # the tip of 10 mm then presses no slope above 0.4 and no depth above 1.5 mm
LAYERED_N = np.array([0.2, 0.4, 0.8, 1.6])
WARM_S, STEP_S = 1800.0, 10.0  # from switching on to the first frame, and between two


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """Straight line through sums against forces, and the power of the force that they follow."""

    slope_per_n: float
    intercept: float
    r_squared: float
    exponent: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """Sums of grey levels above the background over the forces, by contact model and tip.

    Attributes
    ----------
    sums
        Expected sums, by model and tip, shape (forces,) each.
    noisy
        Sums of frames with noise and rounding, rough model, by tip: loading, then unloading, shape (2, forces).
    row_mm, rows
        A cross-section of the picture of the tip of 10 mm at 0.8 N, by model.
    losses
        What the bench, the default gain and the printed scale crop and clip: by setting, tip and force.
    rougher
        Line of the tip of 2 mm under the rough model, by the root mean square slope of the asperities.
    layered_area_mm2
        Contact area on the layered probe by finite elements, tips of 10 and 14 mm, at each of `LAYERED_N`.
    """

    sums: Mapping[str, Mapping[float, NDArray[np.float64]]]
    noisy: Mapping[float, NDArray[np.float64]]
    row_mm: NDArray[np.float64]
    rows: Mapping[str, NDArray[np.float64]]
    losses: Mapping[tuple[str, float, float], LostLight]
    rougher: Mapping[float, Line]
    layered_area_mm2: Mapping[float, NDArray[np.float64]]

    def line(self, model: str, tip_mm: float) -> Line:
        """The line of a model and a tip."""
        return fitted(FORCES_N, self.sums[model][tip_mm])

    def noisy_line(self, tip_mm: float) -> Line:
        """The line of noisy frames, loading and unloading together."""
        return fitted(np.tile(FORCES_N, 2), self.noisy[tip_mm].ravel())

    def hysteresis(self, tip_mm: float) -> float:
        """Largest difference of loading and unloading over the largest sum."""
        up, down = self.noisy[tip_mm]
        return float(np.abs(up - down).max() / self.noisy[tip_mm].max())

    def difference(self, model: str) -> float:
        """Sum under the tip of 14 mm over that under the tip of 10 mm at 0.8 N, less one."""
        return between(FORCES_N, self.sums[model][14.0], self.sums[model][10.0])

    def layered_difference(self) -> float:
        """The same for the contact areas on the layered probe, which smooth contact shows."""
        return between(LAYERED_N, self.layered_area_mm2[14.0], self.layered_area_mm2[10.0])


def between(force_n: NDArray[np.float64], one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """How much more one curve is than the other at 0.8 N, as a share."""
    at = int(np.abs(force_n - COMPARED_N).argmin())
    return float(one[at] / other[at] - 1)


def fitted(force_n: NDArray[np.float64], sums: NDArray[np.float64]) -> Line:
    """Least squares of the sums against the forces, and of their logarithms."""
    slope, intercept = np.polyfit(force_n, sums, 1)
    left = sums - (intercept + slope * force_n)
    return Line(
        slope_per_n=float(slope),
        intercept=float(intercept),
        r_squared=float(1 - left.var() / sums.var()),
        exponent=float(np.polyfit(np.log(force_n), np.log(sums), 1)[0]),
    )


def run(rng: np.random.Generator | None = None) -> Result:
    """Press every tip with every force and add up what each model shows under even light."""
    rng = rng or np.random.default_rng(51)
    answer = bench()

    def seen(model: str, tip_mm: float, force_n: float, calibration: Calibration = answer) -> NDArray[np.float64]:
        return render(pressed(tip_mm, force_n), SENSOR, calibration, contact_model=model)

    def sums(model: str, tip_mm: float, calibration: Calibration = answer) -> NDArray[np.float64]:
        return np.array([seen(model, tip_mm, float(force), calibration).sum() for force in FORCES_N])

    middle = SENSOR.rows // 2
    return Result(
        sums={model: {tip: sums(model, tip) for tip in TIPS_MM} for model in CONTACT_MODELS},
        noisy={tip: noisy_sums(partial(seen, "rough", tip), rng) for tip in TIPS_MM},
        row_mm=SENSOR.axes_mm()[0],
        rows={model: seen(model, 10.0, COMPARED_N)[middle] for model in CONTACT_MODELS},
        losses=losses(),
        rougher={slope: fitted(FORCES_N, sums("rough", 2.0, bench(slope))) for slope in OTHER_SLOPES},
        layered_area_mm2=layered_areas(),
    )


def noisy_sums(seen: Callable[[float], NDArray[np.float64]], rng: np.random.Generator) -> NDArray[np.float64]:
    """Sums of whole frames less a frame without contact, loading and unloading, under warm lamps, shape (2, forces)."""
    path = np.concatenate([FORCES_N, FORCES_N[::-1]])
    lamps = LedDrift().factors(WARM_S + STEP_S * np.arange(len(path)), rng)
    dark = expose(np.zeros((SENSOR.rows, SENSOR.columns)), SENSOR, rng)
    sums = [
        (expose(lamp * seen(float(force)), SENSOR, rng) - dark).sum() for lamp, force in zip(lamps, path, strict=True)
    ]
    up, down = np.reshape(sums, (2, len(FORCES_N)))
    return np.array([up, down[::-1]])


def losses() -> dict[tuple[str, float, float], LostLight]:
    """Cropped and clipped shares of the rough model's pictures, by setting, tip and force."""
    settings = {
        "bench": (SENSOR, bench()),
        "gain for soft tissue": (SENSOR, nominal_calibration(SENSOR)),
        "printed scale": (replace(SENSOR, mm_per_pixel=(PRINTED_PIXEL_MM, PRINTED_PIXEL_MM)), bench()),
    }
    return {
        (name, tip, force): find_lost_light(pressed(tip, force), sensor, answer)
        for name, (sensor, answer) in settings.items()
        for tip in TIPS_MM
        for force in (0.1, 2.0)
    }


def layered_areas() -> dict[float, NDArray[np.float64]]:
    """Contact areas in mm2 on the layered probe by finite elements; under the tip of 2 mm small strain ends at once."""
    return {
        tip: np.array([indent(PROBE, sphere_radius_mm=tip, force_n=float(f)).contact_area_mm2 for f in LAYERED_N])
        for tip in TIPS_MM[1:]
    }


def traced_lines(light: Irradiance) -> dict[tuple[str, float], Line]:
    """Lines of the wide tips under the rough model, by light and tip, at forces whose dents the tracing describes.

    ``even`` light; ``face``, the light of the untouched face; ``dent``, what the dent's depth and flanks make of it.
    """
    first = light.near_undented()
    none = np.zeros_like(first.relative)
    untouched = replace(first, flux_x=none, flux_y=none, growth_per_mm=none)

    def line(tip: float, falling: Callable[[PressField], LightMap | None]) -> Line:
        fields = [pressed(tip, float(force)) for force in GENTLE_N]
        return fitted(GENTLE_N, np.array([render(one, SENSOR, bench(), light=falling(one)).sum() for one in fields]))

    lights = {"even": lambda _: None, "face": lambda _: untouched, "dent": light.on}
    return {(name, tip): line(tip, falling) for name, falling in lights.items() for tip in TIPS_MM[1:]}


def draw(result: Result, path: Path) -> None:
    """The sums of the three models against the force, and their cross-sections."""
    from matplotlib.figure import Figure
    from studies.panels import grey_sums

    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    axes = figure.subplots(2, 2).ravel()
    for ax, model in zip(axes, CONTACT_MODELS, strict=False):
        for tip, marker in zip(TIPS_MM, "os^", strict=True):
            grey_sums(FORCES_N, result.sums[model][tip], ax, label=f"{tip:g} mm tip", marker=marker)
        ax.set_title(f"{model}: 14 mm over 10 mm at {COMPARED_N:g} N {result.difference(model):+.1%}", fontsize=10)
        ax.legend()
    for model, row in result.rows.items():
        axes[3].plot(result.row_mm, row / row.max(), label=model)
    axes[3].set(xlabel="x / mm", ylabel="grey level / largest", xlim=(-10.0, 10.0), ylim=(0.0, 1.2))
    axes[3].set_title(f"cross-section, 10 mm tip, {COMPARED_N:g} N", fontsize=10)
    axes[3].legend(loc="upper center", ncols=3)
    figure.supxlabel("Research use only", fontsize=8)
    figure.savefig(path, dpi=110)


def report(result: Result) -> None:
    """Print every number of the text above."""
    print(f"saturation {bench().saturation_kpa:.1f} kPa, full contact {full_contact():.0f} grey levels")
    peak, engulfed = (
        pressed(TIPS_MM[0], FORCES_N[-1]).pressure_kpa.max(),
        4 / 3 * half_space_kpa() * TIPS_MM[0] ** 2 / MN,
    )
    print(f"2 mm tip: {peak:.0f} kPa at {FORCES_N[-1]:g} N, sinks in to its equator at {engulfed:.2f} N")
    print(f"{'model':>10} {'tip mm':>7} {'exponent':>9} {'R2':>9} {'slope / N':>11} {'intercept':>10}")
    lines = [(model, tip, result.line(model, tip)) for model in result.sums for tip in TIPS_MM]
    lines += [("noisy", tip, result.noisy_line(tip)) for tip in TIPS_MM]
    for name, tip, line in lines:
        numbers = f"{line.exponent:9.3f} {line.r_squared:9.5f} {line.slope_per_n:11.4g} {line.intercept:10.3g}"
        print(f"{name:>10} {tip:7g} {numbers}")
    print(f"{'printed':>10} {2:7g} {'':9} {'':9} {PRINTED_SLOPE:11.5g} {PRINTED_INTERCEPT:10.3g}")
    for model in result.sums:
        print(f"{model}: 14 mm over 10 mm at {COMPARED_N:g} N {result.difference(model):+.2%}")
    print(f"printed: {PRINTED_DIFFERENCE:.2%}, without a sign")
    for tip in TIPS_MM:
        print(f"hysteresis of noisy frames, {tip:g} mm tip: {result.hysteresis(tip):.2%} of the largest sum")
    for slope, line in result.rougher.items():
        starts = f"intercept over slope {line.intercept / line.slope_per_n:.3f} N"
        print(
            f"2 mm tip, asperities of slope {slope:g}, {saturation_kpa(slope):.0f} kPa: {line.exponent:.3f}, {starts}"
        )
    print(f"printed: intercept over slope {PRINTED_INTERCEPT / PRINTED_SLOPE:.3f} N")
    for tip, area in result.layered_area_mm2.items():
        print(f"contact area on the layered probe, {tip:g} mm tip: exponent {fitted(LAYERED_N, area).exponent:.3f}")
    print(f"layered probe, smooth: 14 mm over 10 mm at {COMPARED_N:g} N {result.layered_difference():+.2%}")
    for (setting, tip, force), lost in result.losses.items():
        cropped = f"cropped {lost.light_outside:.1%} of light, {lost.force_outside:.1%} of force"
        clipped = f"clipped {lost.pixels_clipped:.1%} of pixels, {lost.light_clipped:.1%} of light"
        print(f"{setting}, {tip:g} mm tip, {force:g} N: {cropped}; {clipped}")


def report_traced(lines: Mapping[tuple[str, float], Line]) -> None:
    """Print the lines under traced light."""
    print(f"rough model under traced light, {GENTLE_N[0]:g} to {GENTLE_N[-1]:g} N")
    print(f"{'light':>10} {'tip mm':>7} {'exponent':>9} {'R2':>9} {'slope / N':>11}")
    for (name, tip), line in lines.items():
        print(f"{name:>10} {tip:7g} {line.exponent:9.3f} {line.r_squared:9.5f} {line.slope_per_n:11.4g}")


def main() -> None:
    """Print the numbers, and draw them where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--figure", type=Path, help="picture to write, e.g. sums.png")
    parser.add_argument("--traced", action="store_true", help="trace the light, too, and see what becomes of the lines")
    arguments = parser.parse_args()
    result = run()
    report(result)
    if arguments.traced:
        report_traced(traced_lines(irradiance(PROBE)))
    print("Research use only")
    if arguments.figure is not None:
        draw(result, arguments.figure)


if __name__ == "__main__":
    main()
