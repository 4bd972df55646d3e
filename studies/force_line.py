"""Figures 5.2 to 5.4: grey levels across the contact of a rigid tip, and their sum over the force, up and down.

The source presses a tip of 2 mm radius with 0 to 2 N in steps of 0.1 N and back, calls the cross-sections Gaussian and
the sums a straight line without hysteresis, and finds 2.45 % between the lines of tips of 10 and 14 mm at 0.8 N.
`studies/section_5_1.py` asks which contact model makes such a line, with Hertz's contact on a soft half-space into
which the tip of 2 mm would sink over its equator. Here the probe is the catalog's stiff one, on which all twenty forces
of that tip can be solved with large strains; the wide tips are those of
`tsis.mechanics.small_strain.rigid_ball.indent`.

The pressure is Hertz's with the solved contact radius: pointwise pressures under a rigid tip carry the elements' own
waves, the radius does not. Frames are a camera's, with lamps that drift, noise and rounding, less a frame without
contact. The camera's exposure is chosen so that nothing clips, so that the printed slope, which belongs to another
gain and scale, says nothing here.

Found: sums are straight lines for every tip, since rough contact lights in proportion to the pressure and the pressure
adds up to the force. What the source calls Gaussian is nearer to Hertz's half-ellipse here: both are domes. Between the
tips of 10 and 14 mm the contact makes no difference of a tenth of a per cent; one untouched frame, whose noise adds up
over all pixels, and lamps that drift make some tenths. The printed 2.45 % are larger, as light and probe that are not
even would make them, which is what the source supposes.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import curve_fit
from studies.panels import grey_sums
from studies.section_5_1 import (
    COMPARED_N,
    FORCES_N,
    PRINTED_DIFFERENCE,
    PRINTED_INTERCEPT,
    PRINTED_SLOPE,
    SENSOR,
    TIPS_MM,
    between,
    fitted,
    noisy_sums,
)
from studies.shown import Shown

import tsis
from tsis.hardness.sphere import hertzian_radius_mm, press_fields
from tsis.imaging.rendering import render
from tsis.imaging.sensor import expose
from tsis.mechanics.closed_forms import HertzContact
from tsis.mechanics.finite_strain.soft_sphere import SphereResolution
from tsis.mechanics.small_strain.rigid_ball import indent
from tsis.model.phantom import SoftSphere
from tsis.model.press import MN_PER_N, PressField
from tsis.present.figures import contact_rows
from tsis.virtual.direct_contact import direct_contact_calibration

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from matplotlib.figure import Figure
    from numpy.typing import NDArray
    from studies.section_5_1 import Line

    from tsis.model.calibration import Calibration

PROBE = tsis.load_probe("tsis-direct")
RIGID_KPA = 3e5  # two hundred times the skin's modulus
FINE = SphereResolution(order=4, cells=10, rings=2, face_cells=10)
COARSE = SphereResolution(order=3, cells=6, rings=2, face_cells=6)
PEAK_KPA = 700.0  # a little more than the tip of 2 mm presses at 2 N


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """Cross-sections and sums of grey levels above the untouched face.

    Attributes
    ----------
    contact_mm
        Contact radii in mm by tip, shape (forces,).
    row_mm, rows
        Cross-sections of frames under the tip of 2 mm through the middle, shapes (columns,) and (forces, columns).
    sums
        By tip: loading, then unloading, shape (2, forces).
    expected
        By tip: without noise, drift and rounding, shape (forces,).
    """

    contact_mm: Mapping[float, NDArray[np.float64]]
    row_mm: NDArray[np.float64]
    rows: NDArray[np.float64]
    sums: Mapping[float, NDArray[np.float64]]
    expected: Mapping[float, NDArray[np.float64]]

    def line(self, tip_mm: float) -> Line:
        """The straight line of a tip, loading and unloading together."""
        return fitted(np.tile(FORCES_N, 2), self.sums[tip_mm].ravel())

    def residual(self, tip_mm: float) -> float:
        """Largest departure from the line over the largest sum."""
        line, sums = self.line(tip_mm), self.sums[tip_mm]
        return float(np.abs(sums - line.intercept - line.slope_per_n * FORCES_N).max() / sums.max())

    def hysteresis(self, tip_mm: float) -> float:
        """Largest difference of loading and unloading over the largest sum."""
        up, down = self.sums[tip_mm]
        return float(np.abs(up - down).max() / self.sums[tip_mm].max())

    def difference(self) -> float:
        """Line of the tip of 14 mm over that of the tip of 10 mm at 0.8 N, less one."""
        ten, fourteen = (self.line(tip).intercept + self.line(tip).slope_per_n * COMPARED_N for tip in TIPS_MM[1:])
        return fourteen / ten - 1

    def expected_difference(self) -> float:
        """The same of sums without noise."""
        return between(FORCES_N, self.expected[14.0], self.expected[10.0])

    def best(self, shape: Callable[..., NDArray[np.float64]]) -> NDArray[np.float64]:
        """Parameters of a shape that fits the last cross-section best."""
        row = self.rows[-1]
        found, _ = curve_fit(shape, self.row_mm, row, p0=(row.max(), self.contact_mm[2.0][-1]))
        return np.asarray(found)

    def misfit(self, shape: Callable[..., NDArray[np.float64]]) -> float:
        """Root mean square of what a shape leaves of the last cross-section, over its height."""
        row = self.rows[-1]
        lit = np.abs(self.row_mm) < 2 * self.contact_mm[2.0][-1]
        return float(np.sqrt(np.mean((row - shape(self.row_mm, *self.best(shape)))[lit] ** 2)) / row.max())


def gaussian(x: NDArray[np.float64], peak: float, width: float) -> NDArray[np.float64]:
    """What the source calls the cross-section."""
    return np.asarray(peak * np.exp(-0.5 * (x / width) ** 2))


def half_ellipse(x: NDArray[np.float64], peak: float, radius: float) -> NDArray[np.float64]:
    """Hertz's pressure."""
    return np.asarray(peak * np.sqrt(np.maximum(0.0, 1 - (x / radius) ** 2)))


def run(rng: np.random.Generator | None = None, *, resolution: SphereResolution = FINE) -> Result:
    """Press each tip with all forces, up and down, and read the frames."""
    rng = rng or np.random.default_rng(52)
    contact = contact_radii(resolution)
    answer = direct_contact_calibration(SENSOR, probe=PROBE, peak_kpa=PEAK_KPA)

    def seen(tip_mm: float, force_n: float) -> NDArray[np.float64]:
        return glow(float(np.interp(force_n, FORCES_N, contact[tip_mm])), force_n, answer)

    dark = expose(np.zeros((SENSOR.rows, SENSOR.columns)), SENSOR, rng)
    middle = SENSOR.rows // 2
    return Result(
        contact_mm=contact,
        row_mm=SENSOR.axes_mm()[0],
        rows=np.array([(expose(seen(2.0, float(f)), SENSOR, rng) - dark)[middle] for f in FORCES_N]),
        sums={tip: noisy_sums(partial(seen, tip), rng) for tip in TIPS_MM},
        expected={tip: np.array([seen(tip, float(force)).sum() for force in FORCES_N]) for tip in TIPS_MM},
    )


def contact_radii(resolution: SphereResolution) -> dict[float, NDArray[np.float64]]:
    """Contact radii in mm: of the small tip with large strains, of the wide ones, which sink in little, with small."""
    tip = SoftSphere(radius_mm=TIPS_MM[0], young_kpa=RIGID_KPA, poisson=0.3)
    fields = press_fields(PROBE, tip, forces_n=FORCES_N.tolist(), resolution=resolution)
    found = {TIPS_MM[0]: np.array([hertzian_radius_mm(field) for field in fields])}
    for wide in TIPS_MM[1:]:
        found[wide] = np.array(
            [indent(PROBE, sphere_radius_mm=wide, force_n=float(force)).contact_radius_mm for force in FORCES_N]
        )
    return found


def glow(contact_mm: float, force_n: float, answer: Calibration) -> NDArray[np.float64]:
    """Grey levels above the background of a Hertzian pressure."""
    peak = 1.5 * force_n * MN_PER_N / (np.pi * contact_mm**2)
    contact = HertzContact(force_mn=force_n * MN_PER_N, contact_radius_mm=contact_mm, peak_pressure_kpa=peak)
    inner = contact_mm * np.sin(np.linspace(0.0, np.pi / 2, 400))  # dense where the pressure ends
    radius = np.concatenate([inner, np.linspace(contact_mm, PROBE.radius_mm, 200)[1:]])
    field = PressField(
        radius_mm=radius,
        pressure_kpa=np.where(radius < contact_mm, contact.pressure_kpa(radius), 0.0),
        face_displacement_mm=np.zeros_like(radius),
        approach_mm=0.0,
        force_n=force_n,
    )
    return render(field, SENSOR, answer)


def row_values(result: Result) -> dict[str, float]:
    """Numbers of figure 5.2."""
    row, x = result.rows[-1], result.row_mm
    above = np.abs(x[row > row.max() / 2])
    return {
        "what a Gaussian leaves of the cross-section at 2 N, over its height": 100 * result.misfit(gaussian),
        "what Hertz's half-ellipse leaves of it": 100 * result.misfit(half_ellipse),
        "where the cross-section's centroid lies from the middle": 1000 * abs(float((x * row).sum() / row.sum())),
        "width at half height at 2 N": 2 * float(above.max()),
    }


def line_values(result: Result) -> dict[str, float]:
    """Numbers of figure 5.3."""
    tip = TIPS_MM[0]
    line = result.line(tip)
    return {
        "slope, in millions of grey levels": line.slope_per_n / 1e6,
        "intercept, in millions of grey levels": line.intercept / 1e6,
        "intercept over slope": line.intercept / line.slope_per_n,
        "exponent of the sum over the force": line.exponent,
        "largest departure from the line, over the largest sum": 100 * result.residual(tip),
        "largest difference of loading and unloading, over the largest sum": 100 * result.hysteresis(tip),
    }


def tip_values(result: Result) -> dict[str, float]:
    """Numbers of figure 5.4."""
    return {
        "lines of 14 and 10 mm at 0.8 N, difference without its sign": 100 * abs(result.difference()),
        "the same without noise and drift": 100 * abs(result.expected_difference()),
        **{f"slope of the {tip:g} mm tip, in millions": result.line(tip).slope_per_n / 1e6 for tip in TIPS_MM[1:]},
    }


def draw_rows(result: Result, figure: Figure) -> None:
    """Figure 5.2, and what the last of its curves is."""
    rows, last = figure.subplots(1, 2)
    drawn = slice(3, None, 4)
    contact_rows(result.row_mm, result.rows[drawn], FORCES_N[drawn], rows)
    rows.set(xlim=(-2.5, 2.5), ylim=(-8.0, 1.5 * result.rows.max()))
    rows.legend(loc="upper center", ncols=3, frameon=False, fontsize=9)
    last.plot(result.row_mm, result.rows[-1], color="0.6", label=f"{FORCES_N[-1]:g} N")
    for shape, name, style in ((gaussian, "Gaussian, as the source says", "--"), (half_ellipse, "Hertz", "-")):
        curve = shape(result.row_mm, *result.best(shape))
        colour = "#d55e00" if shape is gaussian else "#0072b2"
        last.plot(result.row_mm, curve, style, color=colour, label=f"{name}: {result.misfit(shape):.1%} off")
    last.set(xlabel="x / mm", ylabel="grey level", xlim=(-2.5, 2.5), ylim=(-8.0, 1.5 * result.rows.max()))
    last.legend(loc="upper center", frameon=False, fontsize=9)


def draw_line(result: Result, figure: Figure) -> None:
    """Figure 5.3, and what its line leaves; the printed line is scaled to the slope found here."""
    sums, left = figure.subplots(1, 2)
    line = result.line(TIPS_MM[0])
    for one, name, marker in zip(result.sums[TIPS_MM[0]], ("loading", "unloading"), "ox", strict=True):
        grey_sums(FORCES_N, one, sums, label=name, marker=marker)
        departure = one - line.intercept - line.slope_per_n * FORCES_N
        left.plot(FORCES_N, 100 * departure / result.sums[TIPS_MM[0]].max(), marker, label=name)
    ends = np.array([0.0, FORCES_N[-1]])
    printed = (PRINTED_INTERCEPT + PRINTED_SLOPE * ends) * line.slope_per_n / PRINTED_SLOPE
    sums.plot(ends, printed / 1e6, "k--", linewidth=1, label="printed, scaled to this slope")
    sums.legend(loc="upper left", frameon=False)
    left.axhline(0.0, color="0.4", linewidth=0.8)
    left.set(xlabel="force / N", ylabel="departure from the line / % of the largest sum", ylim=(-0.6, 0.6))
    left.legend(frameon=False)


def draw_tips(result: Result, figure: Figure) -> None:
    """Figure 5.4, and how far the lines lie apart."""
    sums, apart = figure.subplots(1, 2)
    for tip, marker in zip(TIPS_MM[1:], "s^", strict=True):
        grey_sums(FORCES_N, result.sums[tip][0], sums, label=f"{tip:g} mm tip", marker=marker)
    sums.legend(loc="upper left", frameon=False)
    ten, fourteen = (result.line(tip).intercept + result.line(tip).slope_per_n * FORCES_N for tip in TIPS_MM[1:])
    apart.plot(FORCES_N, 100 * (fourteen / ten - 1), color="#0072b2", label="14 mm over 10 mm, lines")
    exact = 100 * (result.expected[14.0] / result.expected[10.0] - 1)
    apart.plot(FORCES_N, exact, ":", color="#009e73", label="without noise and drift")
    both = 100 * PRINTED_DIFFERENCE * np.array([1.0, -1.0])
    apart.plot([COMPARED_N] * 2, both, "o", color="#d55e00", mfc="none", label="printed, without a sign")
    apart.set(xlabel="force / N", ylabel="difference of the tips / %", ylim=(-4.0, 5.5))
    apart.legend(loc="upper right", frameon=False, fontsize=9)


def short(rng: np.random.Generator) -> Result:
    """The same on a coarse mesh, which moves the contact of the small tip by up to 3 %."""
    return run(rng, resolution=COARSE)


SHOWN = (
    Shown(name="figure-5-2", run=run, values=row_values, draw=draw_rows, short=short),
    Shown(name="figure-5-3", run=run, values=line_values, draw=draw_line, short=short),
    Shown(name="figure-5-4", run=run, values=tip_values, draw=draw_tips, short=short),
)


def report(result: Result) -> None:
    """Print the numbers."""
    print(
        f"{'tip mm':>7} {'exponent':>9} {'R2':>9} {'slope / N':>11} {'intercept / N':>14} {'residual':>9} {'loop':>7}"
    )
    for tip in TIPS_MM:
        line = result.line(tip)
        starts = line.intercept / line.slope_per_n
        numbers = f"{line.exponent:9.4f} {line.r_squared:9.6f} {line.slope_per_n:11.4g} {starts:14.4f}"
        print(f"{tip:7g} {numbers} {result.residual(tip):9.2%} {result.hysteresis(tip):7.2%}")
    print(f"printed, 2 mm: slope {PRINTED_SLOPE:.5g}, intercept over slope {PRINTED_INTERCEPT / PRINTED_SLOPE:.3f} N")
    print(f"14 mm over 10 mm at {COMPARED_N:g} N {result.difference():+.3%}; printed {PRINTED_DIFFERENCE:.2%}")
    print(f"the same without noise and drift: {result.expected_difference():+.3%}")
    for shape in (gaussian, half_ellipse):
        print(f"cross-section at 2 N less a {shape.__name__}: {result.misfit(shape):.1%} of its height")
    for tip, radii in result.contact_mm.items():
        power = np.polyfit(np.log(FORCES_N), np.log(radii), 1)[0]
        print(f"contact radius, {tip:g} mm tip: {radii[0]:.2f} to {radii[-1]:.2f} mm, exponent {power:.3f}")


def main() -> None:
    """Print the numbers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=52)
    arguments = parser.parse_args()
    result = run(np.random.default_rng(arguments.seed))
    report(result)
    print("Research use only")


if __name__ == "__main__":
    main()
