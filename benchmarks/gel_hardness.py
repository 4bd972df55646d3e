"""How often the modulus from contacts of a gel sensor holds, on objects pressed by finite elements at finite strain.

    python -m benchmarks.gel_hardness [--seed 20] [--cases 60] [--object cylinder] [--gripper] [--each]

Gel, object and radius are drawn anew for each case, and so are the errors of force, radius, dent, scale and gel, which
the estimate knows only by their sizes. The mesh of spheres is finer than that to which the correction was fitted;
cylinders are pressed by NGSolve (extra fem3d). The two fingers of a gripper have gels and scales of their own, of which
the estimate knows the limits. One row has the estimates from forces and radii, the other those from dents and radii.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from benchmarks.harness import Bench, Choice
from benchmarks.soft_cylinder import Solid, cylinder_presses
from rich.progress import track

from tsis.errors import MechanicsError
from tsis.hardness import estimate_from_contacts
from tsis.hardness.contacts import ObjectGeometry
from tsis.hardness.sphere import hertzian_radius_mm, press_fields
from tsis.mechanics.finite_strain.soft_sphere import SphereResolution
from tsis.model.gel_sensor import BoundedValue, GelSensor
from tsis.model.phantom import SoftSphere
from tsis.model.probe import Layer, Probe

if TYPE_CHECKING:
    from collections.abc import Sequence

MESH = SphereResolution(order=3, cells=7, rings=2, face_cells=7)
LOADS = np.array([0.12, 0.35])  # force times compliance over the radius squared
GEL_KPA, GEL_SPREAD, RATIOS = 150.0, 0.1, (0.48, 0.495)
ERROR, DENT = 0.02, 0.03  # relative standard deviations of scale, reading, press and force; of dents
KNOWN = {"force": ("force_n", "radius_mm"), "dent": ("radius_mm", "depth_mm")}  # what the estimates read
APPROACHES, LENGTH_MM = (0.07, 0.2), 10.0  # of a cylinder: equator's travel over the radius, length of contact


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """The truth and what was found."""

    young_kpa: float
    median_kpa: float
    ends_kpa: tuple[float, float]
    flags: tuple[str, ...]
    trusted: bool

    @property
    def inside(self) -> bool:
        """Whether the 90 % interval holds the truth."""
        return self.ends_kpa[0] < self.young_kpa < self.ends_kpa[1]

    @property
    def identified(self) -> bool:
        """Whether the modulus is given, not withheld."""
        return self.trusted and "young_kpa_not_identified" not in self.flags


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What touches, and by how many fingers."""

    shape: Literal["sphere", "cylinder"] = "sphere"
    fingers: int = 1


def one(rng: np.random.Generator, dents: np.random.Generator, options: Options) -> dict[str, Case]:
    """Draw, press, read with errors, and estimate, by the names of `KNOWN`; ``dents`` draws the errors of the dents."""
    thickness, gel = rng.uniform(3.0, 8.0), GEL_KPA * np.exp(rng.uniform(-GEL_SPREAD, GEL_SPREAD))
    ratio, own_ratio, radius = rng.uniform(*RATIOS), rng.uniform(0.45, 0.49), rng.uniform(4.0, 8.0)
    young = float(np.exp(rng.uniform(np.log(20.0), np.log(500.0))))
    gels = [gel, *(GEL_KPA * np.exp(rng.uniform(-GEL_SPREAD, GEL_SPREAD)) for _ in range(options.fingers - 1))]
    press = cylinder_touches if options.shape == "cylinder" else sphere_touches
    own, length = Solid(young_kpa=young, poisson=own_ratio), LENGTH_MM if options.shape == "cylinder" else None
    contacts = []
    for touches in [press(Solid(young_kpa=gel, poisson=ratio), own, radius, thickness) for gel in gels]:
        scale = np.exp(ERROR * rng.standard_normal())
        for force, read, dent in touches:
            contact = {"force_n": force * np.exp(ERROR * rng.standard_normal())}
            contact["radius_mm"] = read * scale * np.exp(ERROR * np.sqrt(2) * rng.standard_normal())
            contact["depth_mm"] = dent * np.exp(DENT * dents.standard_normal())
            contacts.append(contact)
    sensor = GelSensor(
        name="drawn",
        width_mm=28.0,
        height_mm=28.0,
        thickness_mm=BoundedValue(value=thickness),
        young_kpa=BoundedValue(low=GEL_KPA * np.exp(-GEL_SPREAD), high=GEL_KPA * np.exp(GEL_SPREAD)),
        poisson=BoundedValue(low=RATIOS[0], high=RATIOS[1]),
        mm_per_pixel=(0.1, 0.1),
        scale_uncertainty=ERROR,
    )
    stated = ObjectGeometry(
        shape=options.shape, radius_mm=radius * np.exp(0.01 * rng.standard_normal()), length_mm=length
    )
    cases = {}
    for name, columns in KNOWN.items():
        readings = [{key: contact[key] for key in columns if key in contact} for contact in contacts]
        found = estimate_from_contacts(readings, sensor=sensor, geometry=stated)
        samples = found.untrusted.samples["young_kpa"]
        low, high = np.quantile(samples, [0.05, 0.95]).tolist()
        cases[name] = Case(
            young_kpa=young,
            median_kpa=float(np.median(samples)),
            ends_kpa=(low, high),
            flags=found.flags,
            trusted=found.trusted,
        )
    return cases


def sphere_touches(gel: Solid, own: Solid, radius: float, thickness: float) -> list[tuple[float, float, float]]:
    """Force in N, radius and dent in mm of presses of a sphere."""
    layer = Layer(thickness_mm=thickness, young_kpa=gel.young_kpa, poisson=gel.poisson)
    compliance = (1 - gel.poisson**2) / gel.young_kpa + (1 - own.poisson**2) / own.young_kpa
    forces = LOADS * radius**2 / compliance / 1e3
    fields = press_fields(
        Probe(radius_mm=14.0, layers=(layer,)),
        SoftSphere(radius_mm=radius, young_kpa=own.young_kpa, poisson=own.poisson),
        forces_n=forces.tolist(),
        resolution=MESH,
        stop_at_limit=True,
    )
    return [(field.force_n, hertzian_radius_mm(field), float(field.face_displacement_mm[0])) for field in fields]


def cylinder_touches(gel: Solid, own: Solid, radius: float, thickness: float) -> list[tuple[float, float, float]]:
    """Force in N, half the width and dent in mm of presses of a cylinder."""
    approaches = tuple(share * radius for share in APPROACHES)
    presses = cylinder_presses(gel, own, radius_mm=radius, thickness_mm=thickness, approaches_mm=approaches)
    return [(press.force_n_mm * LENGTH_MM, press.half_mm, press.dent_mm) for press in presses]


def row(name: str, cases: Sequence[Case]) -> tuple[str, ...]:
    """A row of the table."""
    result = [case for case in cases if case.identified]
    error = np.array([case.median_kpa / case.young_kpa - 1 for case in result])
    middle = (f"{100 * np.median(np.abs(error)):.1f} %", f"{100 * np.median(error):+.1f} %") if result else ("-", "-")
    held, given = (
        f"{100 * np.mean([case.inside for case in part]):.0f} %" if part else "-" for part in (cases, result)
    )
    trusted = sum(case.trusted for case in cases)
    return name, str(len(cases)), str(trusted), str(len(result)), held, given, *middle


def main() -> int:
    """Run the cases and print the table."""
    bench = Bench(
        __doc__,
        seed=20,
        cases=60,
        object=Choice(("sphere", "cylinder"), "sphere"),
        gripper=False,
        each=False,
    )
    options = Options(shape=bench.object, fingers=2 if bench.gripper else 1)
    rng, dents = np.random.default_rng(bench.seed), np.random.default_rng([bench.seed, 1])
    found: dict[str, list[Case]] = {name: [] for name in KNOWN}
    for _ in track(range(bench.cases), "pressing"):
        try:
            made = one(rng, dents, options)
        except (MechanicsError, RuntimeError) as error:  # the mesh did not converge: no case
            print(f"left out: {error}")
            continue
        for name, case in made.items():
            found[name].append(case)
            if bench.each:
                low, high = case.ends_kpa
                print(f"{name}: {case.young_kpa:.1f} kPa: {case.median_kpa:.1f} [{low:.1f}, {high:.1f}]", *case.flags)
    heads = ("known", "cases", "trusted", "identified", "holds, all", "holds, identified", "median error", "bias")
    bench.table("Modulus from contacts", heads, [row(name, cases) for name, cases in found.items()])
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
