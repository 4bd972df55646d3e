"""Paths through a clear cylinder with Mitsuba, a general renderer: started where a lamp stands, followed to their end.

    python -m benchmarks.peers.mitsuba_cylinder VARIANT PATHS

prints paths a second on all cores, the best of three. A program of its own: on some machines its compiler ends it.
"""

from __future__ import annotations

import importlib
import subprocess
import sys
import time
from typing import Any

VARIANTS = ("scalar_rgb", "llvm_ad_rgb")
SIDE_PX = 256
RADIUS_MM, HEIGHT_MM, INDEX = 12.0, 13.0, 1.41
PATIENCE_S = 120.0


def paths_per_second(variant: str, paths: float) -> float | None:
    """Speed in a process of its own; None where it fails."""
    command = [sys.executable, "-m", "benchmarks.peers.mitsuba_cylinder", variant, str(paths)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=PATIENCE_S, check=False)
        return float(done.stdout.split()[0])
    except (subprocess.TimeoutExpired, ValueError, IndexError):
        return None


def measured(variant: str, paths: float) -> float:
    """Paths a second; a path starts in a camera at a lamp's place, and refracts, reflects or leaves by chance."""
    mi: Any = importlib.import_module("mitsuba")
    mi.set_variant(variant)
    scene = mi.load_dict(_scene(mi))
    samples = max(1, round(paths / SIDE_PX**2))
    fastest = 0.0
    for seed in range(4):  # the first compiles
        start = time.perf_counter()
        mi.render(scene, spp=samples, seed=seed).numpy()  # which waits until the picture is there
        fastest = max(fastest, SIDE_PX**2 * samples / (time.perf_counter() - start))
    return fastest


def _scene(mi: Any) -> dict[str, Any]:
    clear = {"type": "dielectric", "int_ior": INDEX, "ext_ior": 1.0}
    place = mi.ScalarTransform4f()
    lamp = [RADIUS_MM + 0.01, 0, HEIGHT_MM / 2]
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 64},
        "sensor": {
            "type": "perspective",
            "fov": 30,
            "to_world": place.look_at(origin=lamp, target=[0, 0, HEIGHT_MM / 2], up=[0, 0, 1]),
            "film": {"type": "hdrfilm", "width": SIDE_PX, "height": SIDE_PX, "rfilter": {"type": "box"}},
        },
        "wall": {"type": "cylinder", "p0": [0, 0, 0], "p1": [0, 0, HEIGHT_MM], "radius": RADIUS_MM, "bsdf": clear},
        "face": {"type": "disk", "to_world": place.rotate([1, 0, 0], 180).scale(RADIUS_MM), "bsdf": clear},
        "top": {"type": "disk", "to_world": place.translate([0, 0, HEIGHT_MM]).scale(RADIUS_MM), "bsdf": clear},
        "surround": {"type": "constant"},
    }


if __name__ == "__main__":
    sys.stdout.write(f"{measured(sys.argv[1], float(sys.argv[2]))}\n")
    sys.stdout.flush()
