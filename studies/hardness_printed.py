"""Figures 5.22 and 5.23: the printed pipeline of hardness on spheres of 103 and 62 kPa, contact mechanics beside it.

The source presses spheres of 3 mm radius of CL2000X (103 kPa) and CL2003X (62 kPa) with 0.7 and 1.2 N, takes pixel
values for depths, matches 200 control points, divides force over area by the mean strain of the map, and prints errors
of 4.23 % and 5.38 %. It prints no depth of a grey level, nor which of the two presses the stress is that of.

Here virtual rigs press the same spheres on the catalog's stiff probe, with all errors that a rig has: gain, drift,
missed forces, probe moduli, patterns, stray light, noise, a radius written down wrongly, a place beside the axis.
Presses are solved at large strains on a mesh finer than that of any estimate, and kept in the cache.

Found: the mean strain is about 0.3 for both spheres, for it tells how much brighter the second contact is. Hertz's
contact brightens with the cube root of the force whatever it consists of, by 1.20, which would be a strain of 0.22; at
large strain on a probe of finite thickness these brighten by 1.25 and 1.27. What is divided by the strain is a
contact's mean pressure, which grows with less than the modulus. So the readings lie far off whichever press the stress
is that of, and those of the two spheres differ by less than their moduli do. The depth of a grey level cannot be
calibrated: from some hundredths of a millimetre upwards it changes next to nothing, and below that the surfaces are so
flat that the strain across them is mostly the scatter of the matching. A factor that makes one sphere right leaves the
other some tens of per cent off. Contact mechanics needs no such factor.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.hardness import FORCES_N, NEIGHBOURS, PRINTED
from benchmarks.hardness_bank import SolvedSphere
from benchmarks.hertzian_presses import by_table
from studies.shown import Shown

import tsis
from tsis.catalog.phantoms import load_sphere
from tsis.hardness import estimate
from tsis.hardness.strain_map import STRESSES, PrintedHardness, printed_estimate
from tsis.imaging.patch import segment
from tsis.virtual.direct_contact import DirectContactRig

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage
    from tsis.model.phantom import SoftSphere
    from tsis.model.press import PressField

    Solve = Callable[..., Sequence[PressField]]

PROBE = tsis.load_probe("tsis-direct")
SPHERES = {name: load_sphere(name) for name in PRINTED}
STIFF = next(iter(SPHERES))
LABELS = ("CL2000X", "CL2003X")
RIGS = 12
RADIUS_SD_MM = 0.03
DEPTHS_MM = np.geomspace(0.002, 0.5, 9)  # of a grey level; a pixel is 0.034 mm wide, the sphere 6 mm
VARIANTS: dict[str, dict[str, Any]] = {
    "printed formula": {"formula": "printed"},
    "spline through matches": {"spline": "matches"},
    "points matched by drift": {"method": "cpd"},
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """Readings of both spheres by both ways, one a rig.

    Attributes
    ----------
    example
        The printed pipeline on the first rig's frames of the stiffer sphere, as figure 5.22 shows it.
    strain
        Mean strain by sphere, shape (rigs,).
    light_strain
        What `strain` would be if the second surface were the first one, as much higher as its light is brighter: by
        sphere, shape (rigs,). No match enters it.
    printed
        Moduli in kPa of the printed pipeline, by sphere and then by the press that the stress is that of, or by what
        else was taken literally; shape (rigs,).
    over_depth
        The printed pipeline at each of `DEPTHS_MM` on the first rig's frames, by sphere.
    contact
        Estimates by contact mechanics, by sphere.
    """

    example: PrintedHardness
    strain: Mapping[str, NDArray[np.float64]]
    light_strain: Mapping[str, NDArray[np.float64]]
    printed: Mapping[str, Mapping[str, NDArray[np.float64]]]
    over_depth: Mapping[str, list[PrintedHardness]]
    contact: Mapping[str, list[Estimate]]

    def printed_error(self, name: str, choice: str) -> float:
        """Mean relative error of the printed pipeline."""
        return _mean_error(self.printed[name][choice], SPHERES[name])

    def contact_kpa(self, name: str) -> NDArray[np.float64]:
        """Means of the estimates by contact mechanics."""
        return np.array([one.untrusted.mean["young_kpa"] for one in self.contact[name]])

    def contact_error(self, name: str) -> float:
        """Mean relative error of contact mechanics."""
        return _mean_error(self.contact_kpa(name), SPHERES[name])

    def held(self, name: str) -> int:
        """How many 90 % intervals of contact mechanics hold the modulus."""
        ends = [one.untrusted.interval(0.9)["young_kpa"] for one in self.contact[name]]
        return sum(low <= SPHERES[name].young_kpa <= high for low, high in ends)

    def calibrated(self, known: str, name: str, choice: str) -> NDArray[np.float64]:
        """Moduli of a sphere, multiplied by what makes the same rig's reading of the known one right."""
        return SPHERES[known].young_kpa / self.printed[known][choice] * self.printed[name][choice]

    def calibrated_error(self, known: str, name: str, choice: str) -> float:
        """Mean relative error after that."""
        return _mean_error(self.calibrated(known, name, choice), SPHERES[name])

    def nearest_depth(self, known: str) -> int:
        """Which of `DEPTHS_MM` brings a sphere's modulus nearest to the true one."""
        found = np.array([one.young_kpa for one in self.over_depth[known]])
        return int(np.argmin(np.abs(np.log(found / SPHERES[known].young_kpa))))


def _mean_error(young_kpa: NDArray[np.float64], sphere: SoftSphere) -> float:
    return float(np.mean(np.abs(young_kpa / sphere.young_kpa - 1)))


def run(
    rng: np.random.Generator | None = None,
    *,
    rigs: int = RIGS,
    solve_of: Callable[[SoftSphere], Solve] | None = None,
    method: str = "tprl",
) -> Result:
    """Press both spheres with each of ``rigs`` rigs and read them both ways.

    ``solve_of`` gives what solves a sphere's presses, by default the fine model near the sphere's modulus; ``method``
    matches the control points.
    """
    rng = rng or np.random.default_rng(54)
    banks = {name: (solve_of or solved)(sphere) for name, sphere in SPHERES.items()}
    frames: dict[str, list[tuple[TactileImage, ...]]] = {name: [] for name in SPHERES}
    contact: dict[str, list[Estimate]] = {name: [] for name in SPHERES}
    for _ in range(rigs):
        rig = DirectContactRig(PROBE, rng=rng)
        for name, sphere in SPHERES.items():
            pressing = rig.solved_by(banks[name], radius_sd_mm=RADIUS_SD_MM)
            frames[name].append(pressing.press_path(sphere, forces_n=FORCES_N))
            contact[name].append(estimate(frames[name][-1], probe=PROBE, calibration=rig.calibration))
    plain = {name: [printed_estimate(pair, method=method) for pair in pairs] for name, pairs in frames.items()}
    return Result(
        example=plain[next(iter(SPHERES))][0],
        strain={name: np.array([one.mean_strain for one in answers]) for name, answers in plain.items()},
        light_strain={name: np.array([light_strain(pair) for pair in pairs]) for name, pairs in frames.items()},
        printed={name: moduli(pairs, plain[name], method) for name, pairs in frames.items()},
        over_depth={
            name: [printed_estimate(pairs[0], method=method, depth_mm_per_grey=float(depth)) for depth in DEPTHS_MM]
            for name, pairs in frames.items()
        },
        contact=contact,
    )


def run_short(rng: np.random.Generator) -> Result:
    """Two rigs whose contact radii are the estimator's own, and the faster of two methods of matching."""
    return run(rng, rigs=2, solve_of=lambda _: by_table, method="cpd")


def light_strain(pair: Sequence[TactileImage]) -> float:
    """Axial strain of a stretch by the ratio of the second contact's peak above the dark side to the first one's."""
    first, second = (found.peak_grey - found.background_grey for found in map(segment, pair))
    return float(((second / first) ** 2 - 1) / 2)


def moduli(
    pairs: Sequence[tuple[TactileImage, ...]], plain: Sequence[PrintedHardness], method: str
) -> dict[str, NDArray[np.float64]]:
    """Moduli in kPa by choice, one a pair of frames."""
    found: dict[str, list[float]] = {choice: [] for choice in (*STRESSES, *VARIANTS)}
    for pair, answer in zip(pairs, plain, strict=True):
        first, second = (1000.0 * force / area for force, area in zip(answer.force_n, answer.area_mm2, strict=True))
        for stress, choice in zip((first, second, second - first), STRESSES, strict=True):
            found[choice].append(stress / abs(answer.mean_strain))
        for choice, options in VARIANTS.items():
            found[choice].append(printed_estimate(pair, **{"method": method} | options).young_kpa)
    return {choice: np.array(values) for choice, values in found.items()}


def solved(sphere: SoftSphere) -> SolvedSphere:
    """A sphere's presses by the fine model, at moduli near its own: a rig's probe may be stiffer or softer."""
    return SolvedSphere(
        probe=PROBE,
        radius_mm=sphere.radius_mm,
        poisson=sphere.poisson,
        young_kpa=tuple(factor * sphere.young_kpa for factor in NEIGHBOURS),
        forces_n=FORCES_N,
    )


def draw_matching(result: Result, figure: Figure) -> None:
    """Figure 5.22: control points before and after matching."""
    from tsis.present.figures import point_sets

    example = result.example
    for place, (source, title) in enumerate(
        ((example.before, "before"), (example.registration.untrusted.moved, "after")), 1
    ):
        ax = figure.add_subplot(1, 2, place, projection="3d")
        point_sets(source, example.after, ax, source_label="0.7 N", target_label="1.2 N")
        sides = np.ptp([ax.get_xlim3d(), ax.get_ylim3d(), ax.get_zlim3d()], axis=1)
        ax.set_box_aspect(tuple(sides), zoom=0.85)
        ax.set(xlabel="x / mm", ylabel="y / mm", zlabel="")  # depth is light: its unit is a choice
        ax.locator_params(axis="z", nbins=3)
        ax.set_title(f"{title} matching", fontsize=10)


def draw_moduli(result: Result, figure: Figure) -> None:
    """Figure 5.23: readings of both ways, one a rig."""
    from studies.panels import modulus_readings

    columns = {
        "as printed": {name: result.printed[name]["second"] for name in SPHERES},
        "as printed, one factor\nfrom the other sphere": {
            name: result.calibrated(_other(name), name, "second") for name in SPHERES
        },
        "contact mechanics": {name: result.contact_kpa(name) for name in SPHERES},
    }
    for ax, (title, readings) in zip(figure.subplots(1, 3), columns.items(), strict=True):
        for series, (name, sphere) in enumerate(SPHERES.items()):
            modulus_readings(readings[name], ax, truth_kpa=sphere.young_kpa, label=name, series=series)
        ax.set_title(title, fontsize=10)


def matching_values(result: Result) -> dict[str, float]:
    """Numbers of figure 5.22."""
    example = result.example
    found = {"control points of either image": float(min(len(example.before), len(example.after)))}
    if len(result.contact[STIFF]) == RIGS:
        for name, label in zip(SPHERES, LABELS, strict=True):
            found[f"mean strain, {label}"] = float(result.strain[name].mean())
            found[f"strain by the peak of the light alone, {label}"] = float(result.light_strain[name].mean())
    return found


def modulus_values(result: Result) -> dict[str, float]:
    """Numbers of figure 5.23, errors in per cent; of few rigs, only what does not depend on how many there are."""
    held = sum(result.held(name) for name in SPHERES) / sum(len(result.contact[name]) for name in SPHERES)
    found = {"90 % intervals of contact mechanics that hold the modulus": 100 * held}
    if len(result.contact[STIFF]) == RIGS:
        for name, label in zip(SPHERES, LABELS, strict=True):
            found[f"mean error as printed, {label}"] = 100 * result.printed_error(name, "second")
            factor = result.calibrated_error(_other(name), name, "second")
            found[f"mean error as printed, one factor from the other sphere, {label}"] = 100 * factor
            found[f"mean error of contact mechanics, {label}"] = 100 * result.contact_error(name)
    return found


def _other(name: str) -> str:
    return next(other for other in SPHERES if other != name)


def report(result: Result) -> None:
    """Print the numbers."""
    for name, sphere in SPHERES.items():
        rigs, strain = len(result.strain[name]), result.strain[name]
        print(
            f"{name}, {sphere.young_kpa:g} kPa, {rigs} rigs: mean strain {strain.mean():.3f} +- {strain.std():.3f}",
            end="",
        )
        print(f", by the peak of the light alone {result.light_strain[name].mean():.3f}")
        for choice, young in result.printed[name].items():
            error = result.printed_error(name, choice)
            print(f"  as printed, {choice:<23} {young.mean():7.1f} +- {young.std():5.1f} kPa, mean error {error:7.1%}")
        for choice in STRESSES:
            error = result.calibrated_error(_other(name), name, choice)
            young = result.calibrated(_other(name), name, choice).mean()
            print(f"  {choice} stress, one factor from {_other(name)}: {young:.1f} kPa, mean error {error:.1%}")
        found = result.over_depth[name]
        least, most = min(one.young_kpa for one in found), max(one.young_kpa for one in found)
        print(f"  a grey level {DEPTHS_MM[0]:g} to {DEPTHS_MM[-1]:g} mm deep: {least:.1f} to {most:.1f} kPa")
        place = result.nearest_depth(_other(name))
        output = found[place].young_kpa
        print(
            f"  {DEPTHS_MM[place]:.3g} mm, nearest for {_other(name)}: {output:.1f} kPa, "
            f"error {output / sphere.young_kpa - 1:+.1%}"
        )
        mean, held = result.contact_kpa(name).mean(), result.held(name)
        print(f"  contact mechanics {mean:.1f} kPa, mean error {result.contact_error(name):.2%}", end="")
        print(f", {held} of {rigs} intervals of 90 % hold it")
        print(f"  printed error {PRINTED[name]:.2%}")


SHOWN = tuple(
    Shown(name=name, run=run, values=values, draw=draw, short=run_short)
    for name, values, draw in (
        ("figure-5-22", matching_values, draw_matching),
        ("figure-5-23", modulus_values, draw_moduli),
    )
)


def main() -> None:
    """Print the numbers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", type=int, default=RIGS)
    parser.add_argument("--seed", type=int, default=54)
    arguments = parser.parse_args()
    result = run(np.random.default_rng(arguments.seed), rigs=arguments.rigs)
    report(result)
    print("Research use only")


if __name__ == "__main__":
    main()
