"""Force and pressure from depth maps of a gel against finite elements at finite strain: steel balls on bonded gels.

``python -m benchmarks.gel_force --seed 2028`` prints one row a press. Gels and balls are drawn from the seed; the
correction for large strain was chosen on others (4 mm, 150 kPa, Poisson 0.46 and 0.485, balls of 2.5 and 6 mm).
Then flat discs and bars with sharp edges, by the bricks of `benchmarks.gel_shear` at small strain: without friction the
face slides along them, and their pressure has no peak that a mesh could tell, so that the force alone is compared.
"""

from __future__ import annotations

import sys

import numpy as np
from benchmarks.gel_shear import WIDE_MM, Layer
from benchmarks.harness import Bench
from scipy.interpolate import RegularGridInterpolator

import tsis
from tsis.errors import MechanicsError
from tsis.mechanics.finite_strain.soft_sphere import squeeze_path
from tsis.mechanics.gel.force import gel_force
from tsis.model.gel_sensor import BoundedValue, GelSensor

PIXEL_MM, COLUMNS, ROWS = 0.0632, 320, 240
DEPTH_NOISE_MM = 0.005
CELL_MM = 0.6  # of the bricks under punches


def punches(rng: np.random.Generator, count: int) -> None:
    """Flat discs and bars of 8 mm length pressed into bonded gels."""
    print("gel kPa  nu     t mm  punch             depth/t  force N  force ratio")
    off = []
    for number in range(count):
        young, poisson = float(np.exp(rng.uniform(*np.log([60, 300])))), float(rng.uniform(0.45, 0.48))
        thickness, half = float(rng.uniform(3, 5)), float(rng.uniform(1.2, 3.0))
        layer = Layer(thickness, young, poisson, cell_mm=CELL_MM)
        x, y = np.meshgrid(layer.side, layer.side, indexing="ij")
        disc = number % 2 == 0
        inside = np.hypot(x, y) <= half if disc else (np.abs(x) <= half) & (np.abs(y) <= 4.0)
        nodes, depth = np.argwhere(inside), float(rng.uniform(0.03, 0.1)) * thickness
        columns = []
        for i, j in nodes:
            unit = np.zeros((3, *x.shape))
            unit[2, i, j] = -1.0
            columns.append(-layer.displaced(unit)[2])
        response = np.array(columns)
        pressure = np.linalg.solve(response[:, inside], np.full(len(nodes), depth))
        face = np.tensordot(pressure, response, axes=1)
        force = float(pressure.sum()) * CELL_MM**2 / 1000
        places = (np.mgrid[:ROWS, :COLUMNS] - np.array([(ROWS - 1) / 2, (COLUMNS - 1) / 2])[:, None, None]) * PIXEL_MM
        seen = RegularGridInterpolator((layer.side, layer.side), face)(np.stack([places[1], places[0]], axis=-1))
        seen += rng.normal(0, DEPTH_NOISE_MM, seen.shape)
        result = gel_force(seen, sensor=_sensor(thickness, young, poisson), draws=20)
        ratio = result.force_n / result.strain_correction / force  # the bricks are linear
        off.append(abs(ratio - 1))
        name = f"disc {half:.2f} mm" if disc else f"bar {2 * half:.2f} x 8 mm"
        print(
            f"{young:7.0f}  {poisson:.3f}  {thickness:.2f}  {name:16}  {depth / thickness:7.3f}  {force:7.3f}  "
            f"{ratio:11.3f}"
        )
    print(
        f"punches and bars in a block of {WIDE_MM:g} mm: largest error {max(off):.3f}, median {np.median(off):.3f}; "
        "goal 0.10"
    )


def _sensor(thickness: float, young: float, poisson: float) -> GelSensor:
    return GelSensor(
        name="drawn",
        width_mm=COLUMNS * PIXEL_MM,
        height_mm=ROWS * PIXEL_MM,
        thickness_mm=BoundedValue(value=thickness),
        young_kpa=BoundedValue(value=young),
        poisson=BoundedValue(value=poisson),
        image_px=(COLUMNS, ROWS),
        mm_per_pixel=(PIXEL_MM, PIXEL_MM),
    )


def main() -> int:
    bench = Bench(__doc__, seed=2028, gels=3, punches=6)
    rng = np.random.default_rng(bench.seed)
    print("gel kPa  nu     t mm  ball mm  force N  depth/t  a/t    force ratio  pressure RMS/peak  in 90 %")
    ratios, rms, held = [], [], []
    y, x = (np.mgrid[:ROWS, :COLUMNS] - np.array([(ROWS - 1) / 2, (COLUMNS - 1) / 2])[:, None, None]) * PIXEL_MM
    radius = np.hypot(x, y)
    for _ in range(bench.gels):
        young, poisson = float(np.exp(rng.uniform(*np.log([60, 300])))), float(rng.uniform(0.46, 0.49))
        thickness, ball = float(rng.uniform(3, 5)), float(rng.uniform(2.5, 6))
        gel = tsis.Layer(thickness_mm=thickness, young_kpa=young, poisson=poisson)
        sensor = _sensor(thickness, young, poisson)
        unit = young * thickness**2 / 1000  # newtons
        forces = [unit * share for share in (0.03, 0.12, 0.3)]
        try:
            presses = squeeze_path(
                tsis.Probe(radius_mm=11.0, layers=(gel,), name="gel"),
                sphere_radius_mm=ball,
                young_kpa=200 * young,
                poisson=0.3,
                forces_n=forces,
            )
        except MechanicsError as error:
            print(f"{young:7.0f}  {poisson:.3f}  {thickness:.2f}  {ball:7.2f}  refused: {error}")
            continue
        for force, press in zip(forces, presses, strict=True):
            field = press.field
            depth = np.interp(radius, field.radius_mm, field.face_displacement_mm)
            truth = np.interp(radius, field.radius_mm, field.pressure_kpa)
            result = gel_force(depth + rng.normal(0, DEPTH_NOISE_MM, depth.shape), sensor=sensor, draws=100)
            low, high = result.interval_n()
            inside = (truth > 0) | (result.pressure_kpa > 0)
            off_rms = float(np.sqrt(np.mean((result.pressure_kpa - truth)[inside] ** 2)) / truth.max())
            ratios.append(result.force_n / force)
            rms.append(off_rms)
            held.append(low <= force <= high)
            print(
                f"{young:7.0f}  {poisson:.3f}  {thickness:.2f}  {ball:7.2f}  {force:7.3f}  "
                f"{result.deepest_mm / thickness:7.3f}  {press.contact_radius_mm / thickness:.3f}  "
                f"{ratios[-1]:11.3f}  {off_rms:17.3f}  {'yes' if held[-1] else 'no'}"
            )
    off = np.abs(np.array(ratios) - 1)
    print(f"force: largest error {off.max():.3f}, median {np.median(off):.3f}; goal 0.10")
    print(f"pressure: largest RMS {max(rms):.3f}, median {np.median(rms):.3f}; goal 0.15")
    print(f"interval (gel known): holds {sum(held)} of {len(held)}")
    punches(np.random.default_rng([bench.seed, 1]), bench.punches)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
