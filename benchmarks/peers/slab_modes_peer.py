"""Guided modes, TE, by PyMoosh: ``python slab_modes_peer.py`` with a stack as JSON on standard input.

It needs nothing of tsis, so that it runs in an environment where only PyMoosh is installed.
"""

from __future__ import annotations

import json
import sys
import time
from importlib import import_module, metadata
from typing import Any


def pymoosh(stack: dict[str, Any]) -> list[float]:
    """Search by PyMoosh: steepest descent from equally spaced points, five for each mode that there is."""
    # By name, as the type checker cannot see what is installed elsewhere.
    structures, modes = import_module("PyMoosh.classes"), import_module("PyMoosh.modes")
    squares = [n**2 for n in (stack["index_below"], *stack["index"], stack["index_above"])]
    thickness = [0.0, *(1000 * part for part in stack["thickness_um"]), 0.0]
    structure = structures.Structure(squares, list(range(len(squares))), thickness, verbose=False)
    low, high = max(stack["index_below"], stack["index_above"]), max(stack["index"])
    found = modes.guided_modes(structure, 1000 * stack["wavelength_um"], 0, low + 1e-6, high - 1e-6, 5 * stack["count"])
    return [complex(one).real for one in found if low < complex(one).real < high and abs(complex(one).imag) < 1e-6]


def main() -> None:
    """Solve once to warm up and once by the clock."""
    stack = json.load(sys.stdin)
    start = time.perf_counter()
    found = pymoosh(stack)
    seconds = time.perf_counter() - start
    if seconds < 5:  # what was imported on the way is not counted
        start = time.perf_counter()
        found = pymoosh(stack)
        seconds = time.perf_counter() - start
    print(json.dumps({"n_eff": found, "seconds": seconds, "version": metadata.version("PyMoosh")}))


if __name__ == "__main__":
    main()
