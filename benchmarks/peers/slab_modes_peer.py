"""Guided modes by other programs: ``python slab_modes_peer.py PROGRAM`` with a stack as JSON on standard input.

It needs nothing of tsis, so that it runs in an environment where only the other program is installed.
"""

from __future__ import annotations

import json
import sys
import time
from importlib import import_module, metadata
from typing import Any

LIGHT_UM_HZ = 2.99792458e14


def pymoosh(stack: dict[str, Any]) -> list[float]:
    """Search by PyMoosh: steepest descent from equally spaced points, five for each mode that there is."""
    # By name, as the type checker cannot see what is installed elsewhere.
    structures, modes = import_module("PyMoosh.classes"), import_module("PyMoosh.modes")
    squares = [n**2 for n in (stack["index_below"], *stack["index"], stack["index_above"])]
    thickness = [0.0, *(1000 * part for part in stack["thickness_um"]), 0.0]
    structure = structures.Structure(squares, list(range(len(squares))), thickness, verbose=False)
    low, high = max(stack["index_below"], stack["index_above"]), max(stack["index"])
    polarization = 0 if stack["polarization"] == "TE" else 1
    found = modes.guided_modes(
        structure, 1000 * stack["wavelength_um"], polarization, low + 1e-6, high - 1e-6, 5 * stack["count"]
    )
    return [complex(one).real for one in found if low < complex(one).real < high and abs(complex(one).imag) < 1e-6]


def tidy3d(stack: dict[str, Any]) -> list[float]:
    """The mode solver of tidy3d, run here, on cells of 3 nm between walls 8 µm from the stack."""
    td, plugin = import_module("tidy3d"), import_module("tidy3d.plugins.mode")
    td.config.logging.level = "ERROR"
    total, margin = sum(stack["thickness_um"]), 8.0
    structures, foot = [], -total / 2
    for n, thickness in zip(stack["index"], stack["thickness_um"], strict=True):
        box = td.Box(center=(foot + thickness / 2, 0, 0), size=(thickness, td.inf, td.inf))
        structures.append(td.Structure(geometry=box, medium=td.Medium(permittivity=n**2)))
        foot += thickness
    frequency = LIGHT_UM_HZ / stack["wavelength_um"]
    simulation = td.Simulation(
        size=(total + 2 * margin, 0, 1),
        grid_spec=td.GridSpec.uniform(dl=0.003),
        structures=structures,
        run_time=1e-12,
        boundary_spec=td.BoundarySpec(x=td.Boundary.pec(), y=td.Boundary.periodic(), z=td.Boundary.periodic()),
    )
    count = stack["count"]
    solver = plugin.ModeSolver(
        simulation=simulation,
        plane=td.Box(size=(total + 2 * margin, td.inf, 0)),
        mode_spec=td.ModeSpec(num_modes=2 * count + 4, target_neff=max(stack["index"]), precision="double"),
        freqs=[frequency],
    )
    data = solver.solve()
    share = data.pol_fraction.te.values[0]  # of the field along the first axis of the plane, across the layers
    expected = share < 0.5 if stack["polarization"] == "TE" else share > 0.5
    low = max(stack["index_below"], stack["index_above"])
    found = data.n_eff.values[0][expected].tolist()
    return [n for n in found if low < n < max(stack["index"])]


def main() -> None:
    """Solve once to warm up and once by the clock."""
    stack, program = json.load(sys.stdin), sys.argv[1]
    solve = {"PyMoosh": pymoosh, "tidy3d": tidy3d}[program]
    start = time.perf_counter()
    found = solve(stack)
    seconds = time.perf_counter() - start
    if seconds < 5:  # what was imported on the way is not counted
        start = time.perf_counter()
        found = solve(stack)
        seconds = time.perf_counter() - start
    print(json.dumps({"n_eff": found, "seconds": seconds, "version": metadata.version(program)}))


if __name__ == "__main__":
    main()
