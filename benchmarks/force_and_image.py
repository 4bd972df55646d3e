"""Hardness from presses whose force has a false zero, lags behind the image, and varies from press to press.

    python -m benchmarks.force_and_image --seed 6101 --cases 40

Each case is one object on one gel, pressed three times by finite elements at finite strain (as `gel_hardness`); the
first press is a path of eight forces, which the other presses repeat with errors of their own. The force's zero is off
by up to 0.05 N and its time by up to 150 ms, both even and one for a case; a press of 0.6 to 1.5 s rises along a smooth
ramp, so that the rate changes. The radii of one press share an error of 8 %. The estimate
knows these errors by their standard deviations alone. Cases lie on the disk (`--bank`): an interrupted run goes on.
"""

from __future__ import annotations

import json
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.gel_hardness import ERROR, GEL_KPA, GEL_SPREAD, MESH, RATIOS, Case, row
from benchmarks.harness import Bench, Goal
from rich.progress import track

from tsis.errors import MechanicsError
from tsis.hardness import estimate_from_contacts
from tsis.hardness.contacts import ObjectGeometry
from tsis.hardness.sphere import hertzian_radius_mm, press_fields
from tsis.model.gel_sensor import BoundedValue, GelSensor
from tsis.model.phantom import SoftSphere
from tsis.model.probe import Layer, Probe

if TYPE_CHECKING:
    from typing import Any

LOADS = np.linspace(0.04, 0.3, 8)  # force times compliance over the radius squared
PRESSES, ZERO_N, LAG_S, PRESS_SD = 3, 0.05, 0.15, 0.08
FORCE_ERROR, RADIUS_ERROR = 0.01, 0.015  # of single readings
FRAME_S = 0.05


def solved(rng: np.random.Generator) -> dict[str, Any]:
    """The truth of a case, and forces in N with Hertz's radii in mm of its path."""
    made = {
        "thickness": rng.uniform(3.0, 8.0),
        "gel": GEL_KPA * np.exp(rng.uniform(-GEL_SPREAD, GEL_SPREAD)),
        "ratio": rng.uniform(*RATIOS),
        "own_ratio": rng.uniform(0.45, 0.49),
        "radius": rng.uniform(4.0, 8.0),
        "young": np.exp(rng.uniform(np.log(20.0), np.log(400.0))),
    }
    compliance = (1 - made["ratio"] ** 2) / made["gel"] + (1 - made["own_ratio"] ** 2) / made["young"]
    layer = Layer(thickness_mm=made["thickness"], young_kpa=made["gel"], poisson=made["ratio"])
    fields = press_fields(
        Probe(radius_mm=14.0, layers=(layer,)),
        SoftSphere(radius_mm=made["radius"], young_kpa=made["young"], poisson=made["own_ratio"]),
        forces_n=(LOADS * made["radius"] ** 2 / compliance / 1e3).tolist(),
        resolution=MESH,
        stop_at_limit=True,
    )
    path = [(field.force_n, hertzian_radius_mm(field)) for field in fields]
    return {name: float(value) for name, value in made.items()} | {"path": path}


def banked(folder: Path, seed: int, case: int) -> dict[str, Any] | None:
    """A solved case from the disk, or solved now; None where the mesh does not converge."""
    path = folder / f"{seed}-{case}.json"
    if not path.is_file():
        try:
            made: dict[str, Any] | None = solved(np.random.default_rng([seed, case]))
        except MechanicsError:
            made = None
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(made))
    loaded: dict[str, Any] | None = json.loads(path.read_text())
    return loaded


def measured(truth: dict[str, Any], rng: np.random.Generator) -> list[dict[str, float]]:
    """The contacts of all presses as camera and gauge give them."""
    force, radius = np.array(truth["path"]).T
    zero, lag = rng.uniform(-ZERO_N, ZERO_N), rng.uniform(-LAG_S, LAG_S)
    scale = np.exp(ERROR * rng.standard_normal())
    contacts = []
    for press in range(PRESSES):
        rise, peak = rng.uniform(0.6, 1.5), force[-1] * rng.uniform(0.85, 1.0)
        own = np.exp(PRESS_SD * rng.standard_normal())

        def of_time(time: Any, rise: float = rise, peak: float = peak) -> Any:
            part = np.clip(time / rise, 0.0, 1.0)
            return peak * part**2 * (3.0 - 2.0 * part)

        for time in np.arange(FRAME_S, 1.25 * rise, FRAME_S):
            true = float(of_time(time))
            seen = float(np.interp(true, force, radius))
            read = float(of_time(time + lag)) + zero
            read += FORCE_ERROR * true * rng.standard_normal() + 0.002 * rng.standard_normal()
            if true < force[0] or read <= 0.01:
                continue
            seen *= scale * np.exp(RADIUS_ERROR * rng.standard_normal()) * own
            contacts.append({"press": press, "time_s": float(time), "force_n": read, "radius_mm": seen})
    return [contact | {"force_sd_n": FORCE_ERROR * contact["force_n"] + 0.002} for contact in contacts]


def main() -> int:
    """Print the table and the goals."""
    bench = Bench(
        __doc__,
        seed=6101,
        cases=40,
        bank=Path("build/force-and-image"),
        each=False,
    )
    told: dict[str, Any] = {
        "press_sd": PRESS_SD,
        "force_zero_sd_n": ZERO_N / np.sqrt(3),
        "lag_sd_s": LAG_S / np.sqrt(3),
    }
    found: dict[str, list[Case]] = {"told": [], "lag not told": []}
    for number in track(range(bench.cases), "pressing", disable=not sys.stderr.isatty()):
        truth = banked(bench.bank, bench.seed, number)
        if truth is None:
            continue
        rng = np.random.default_rng([bench.seed, number, 1])
        contacts = measured(truth, rng)
        sensor = GelSensor(
            name="drawn",
            width_mm=28.0,
            height_mm=28.0,
            thickness_mm=BoundedValue(value=truth["thickness"]),
            young_kpa=BoundedValue(low=GEL_KPA * np.exp(-GEL_SPREAD), high=GEL_KPA * np.exp(GEL_SPREAD)),
            poisson=BoundedValue(low=RATIOS[0], high=RATIOS[1]),
            mm_per_pixel=(0.1, 0.1),
            scale_uncertainty=ERROR,
        )
        stated = ObjectGeometry(radius_mm=truth["radius"] * np.exp(0.01 * rng.standard_normal()))
        estimated = partial(estimate_from_contacts, contacts, sensor=sensor, geometry=stated)
        for name, options in (("told", told), ("lag not told", {**told, "lag_sd_s": 0.0})):
            result = estimated(**options)
            samples = result.untrusted.samples["young_kpa"]
            low, high = np.quantile(samples, [0.05, 0.95]).tolist()
            case = Case(
                young_kpa=truth["young"],
                median_kpa=float(np.median(samples)),
                ends_kpa=(low, high),
                flags=result.flags,
                trusted=result.trusted,
            )
            found[name].append(case)
            if bench.each:
                print(f"{name}: {case.young_kpa:.1f} kPa: {case.median_kpa:.1f} [{low:.1f}, {high:.1f}]", *case.flags)
    heads = (
        "the estimate is",
        "cases",
        "trusted",
        "identified",
        "holds, all",
        "holds, identified",
        "median error",
        "bias",
    )
    bench.table("Force and image in time", heads, [row(*item) for item in found.items()])
    cases = found["told"]
    return bench.end(
        [
            Goal(
                name="90 % interval holds, %",
                value=100 * float(np.mean([case.inside for case in cases])),
                least=85,
                most=95,
            ),
            Goal(name="trusted, %", value=100 * float(np.mean([case.trusted for case in cases])), least=80),
        ]
    )


if __name__ == "__main__":
    sys.exit(main())
