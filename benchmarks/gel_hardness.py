"""How often the modulus from contacts of a gel sensor holds, on spheres pressed by finite elements at finite strain.

    python -m benchmarks.gel_hardness [--seed 20] [--cases 60]

Gel, object and radius are drawn anew for each case, and so are the errors of force, radius, scale and gel, which the
estimate knows only by their sizes. The mesh is finer than that to which the correction was fitted.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from rich.progress import track

from tsis.errors import MechanicsError
from tsis.hardness import ObjectGeometry, estimate_from_contacts, hertzian_radius_mm, press_fields
from tsis.mechanics.finite_strain import SphereResolution
from tsis.model import BoundedValue, GelSensor, Layer, Probe, SoftSphere

MESH = SphereResolution(order=3, cells=7, rings=2, face_cells=7)
LOADS = np.array([0.12, 0.35])  # force times compliance over the radius squared
GEL_KPA, GEL_SPREAD, RATIOS = 150.0, 0.1, (0.48, 0.495)
ERROR = 0.02  # relative standard deviation of scale, reading, press and force


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """The truth and what was found."""

    young_kpa: float
    median_kpa: float
    inside: bool
    identified: bool
    trusted: bool


def one(rng: np.random.Generator) -> Case:
    """Draw, press, read with errors, and estimate."""
    thickness, gel = rng.uniform(3.0, 8.0), GEL_KPA * np.exp(rng.uniform(-GEL_SPREAD, GEL_SPREAD))
    ratio, own_ratio, radius = rng.uniform(*RATIOS), rng.uniform(0.45, 0.49), rng.uniform(4.0, 8.0)
    young = float(np.exp(rng.uniform(np.log(20.0), np.log(500.0))))
    probe = Probe(radius_mm=14.0, layers=(Layer(thickness_mm=thickness, young_kpa=gel, poisson=ratio),))
    compliance = (1 - ratio**2) / gel + (1 - own_ratio**2) / young
    forces = LOADS * radius**2 / compliance / 1e3
    sphere = SoftSphere(radius_mm=radius, young_kpa=young, poisson=own_ratio)
    fields = press_fields(probe, sphere, forces_n=forces.tolist(), resolution=MESH, stop_at_limit=True)
    scale = np.exp(ERROR * rng.standard_normal())
    contacts = [
        {
            "force_n": field.force_n * np.exp(ERROR * rng.standard_normal()),
            "radius_mm": hertzian_radius_mm(field) * scale * np.exp(ERROR * np.sqrt(2) * rng.standard_normal()),
        }
        for field in fields
    ]
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
    stated = ObjectGeometry(radius_mm=radius * np.exp(0.01 * rng.standard_normal()))
    found = estimate_from_contacts(contacts, sensor=sensor, geometry=stated)
    samples = found.untrusted.samples["young_kpa"]
    low, high = np.quantile(samples, [0.05, 0.95])
    return Case(
        young_kpa=young,
        median_kpa=float(np.median(samples)),
        inside=bool(low < young < high),
        identified="young_kpa_not_identified" not in found.flags,
        trusted=found.trusted,
    )


def main() -> None:
    """Run the cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=20)
    parser.add_argument("--cases", type=int, default=60)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    cases: list[Case] = []
    for _ in track(range(arguments.cases), "pressing"):
        try:
            cases.append(one(rng))
        except MechanicsError as error:  # the mesh did not converge: no case
            print(f"left out: {error}")
    print("| cases | trusted | identified | 90 % interval holds | median error of the identified |")
    print("| --- | --- | --- | --- | --- |")
    result = [case for case in cases if case.identified]
    median = np.median([abs(case.median_kpa / case.young_kpa - 1) for case in result])
    held = np.mean([case.inside for case in cases])
    trusted = sum(case.trusted for case in cases)
    print(f"| {len(cases)} | {trusted} | {len(result)} | {100 * held:.0f} % | {100 * median:.1f} % |")


if __name__ == "__main__":
    main()
