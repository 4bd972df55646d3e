"""Light on the face of a whole unpressed probe with Mitsuba's compiled variant: a program of its own.

    python -m benchmarks.peers.mitsuba_probe SCENE.json RAYS SEEDS

The scene, written by `benchmarks.whole_probe`, is a cylinder with flat interfaces and lamps beside its wall. Mitsuba
intersects; Fresnel's law, the choice between reflection and refraction, roulette and the map are the same rules as
`tsis.optics.rays` has. Prints JSON: processor seconds of each seed's run after one that compiles, and each seed's map
of arriving power.
"""

from __future__ import annotations

import importlib
import json
import sys
import time
from pathlib import Path
from typing import Any

VARIANT = "llvm_ad_rgb"
LOOPS = 200  # beyond which almost no power is left


class Tracer:
    """Mitsuba's scene, and the loop over its rays."""

    def __init__(self, told: dict[str, Any]) -> None:
        self.mi: Any = importlib.import_module("mitsuba")
        self.mi.set_variant(VARIANT)
        self.dr: Any = importlib.import_module("drjit")
        self.told = told
        mi, radius = self.mi, told["radius"]
        place = mi.ScalarTransform4f()
        parts: dict[str, Any] = {"type": "scene"}
        parts["wall"] = {"type": "cylinder", "p0": [0, 0, 0], "p1": [0, 0, told["level"][-1]], "radius": radius}
        for number, level in enumerate(told["level"]):
            parts[f"level{number}"] = {"type": "disk", "to_world": place.translate([0, 0, level]).scale(radius)}
        self.scene = mi.load_dict(parts)
        self.level, self.indices = mi.Float(told["level"]), mi.Float(told["indices"])

    def started(self, rays: int, seed: int, lamp: int) -> tuple[Any, Any, Any]:
        """The random generator, positions and directions of the rays of a lamp: a cosine law about its axis."""
        mi, dr, one = self.mi, self.dr, self.told["lamps"][lamp]
        rng = mi.PCG32(size=rays, initstate=1 + seed, initseq=mi.UInt64(1 + lamp))
        u, v, s, t = (rng.next_float32() for _ in range(4))
        out, polar = one["radius"] * dr.sqrt(u), 2 * dr.pi * v
        (px, py, pz), (ax, ay, az) = one["position"], one["axis"]
        around, along, up = (px**2 + py**2) ** 0.5, out * dr.cos(polar), out * dr.sin(polar)
        position = mi.Point3f(px - along * py / around, py + along * px / around, pz + up)
        cosine = dr.power(1 - s, 1 / (one["exponent"] + 1))
        sine, turn = dr.sqrt(dr.maximum(0, 1 - cosine**2)), 2 * dr.pi * t
        flat = (ax**2 + ay**2) ** 0.5
        hx, hy = -ay / flat, ax / flat
        vx, vy, vz = -az * hy, az * hx, ax * hy - ay * hx
        c, q = sine * dr.cos(turn), sine * dr.sin(turn)
        return (
            rng,
            position,
            mi.Vector3f(cosine * ax + c * hx + q * vx, cosine * ay + c * hy + q * vy, cosine * az + q * vz),
        )

    def reflectance(self, cosine: Any, here: Any, there: Any) -> tuple[Any, Any]:
        """Reflected fraction of unpolarised light, and the cosine of the refracted ray."""
        dr = self.dr
        ratio = here / there
        flat2 = ratio**2 * (1 - cosine**2)
        through = dr.sqrt(dr.maximum(0, 1 - flat2))
        s = (ratio * cosine - through) / (ratio * cosine + through)
        p = (cosine - ratio * through) / (cosine + ratio * through)
        return dr.select(flat2 >= 1, 1, 0.5 * (s**2 + p**2)), through

    def traced(self, rays: int, seed: int) -> list[float]:
        """The map of power that arrives at the face, row by row."""
        mi, dr, bins = self.mi, self.dr, self.told["bins"]
        face = dr.zeros(mi.Float, bins * bins)
        for lamp, one in enumerate(self.told["lamps"]):
            rng, position, direction = self.started(rays, seed, lamp)
            self._followed(face, rng, position, direction, one["power"] / rays)
        return [float(value) for value in face.numpy()]

    def _followed(self, face: Any, rng: Any, position: Any, direction: Any, share: float) -> None:
        mi, dr, result, scene = self.mi, self.dr, self.told, self.scene
        bins, radius, top = result["bins"], result["radius"], len(result["indices"])
        first = scene.ray_intersect(mi.Ray3f(position, direction))
        at = first.p
        across = dr.sqrt(at.x**2 + at.y**2)
        active = first.is_valid() & (dr.abs(across - radius) < 1e-3) & (at.z > 0) & (at.z < result["level"][-1])
        medium = dr.zeros(mi.UInt32, dr.width(at.x))
        for level in result["level"][1:-1]:
            medium += dr.select(at.z > level, mi.UInt32(1), mi.UInt32(0))
        normal = mi.Vector3f(at.x / radius, at.y / radius, 0)
        cosine = -dr.dot(direction, normal)
        active &= cosine > 0
        index = dr.gather(mi.Float, self.indices, medium)
        back, through = self.reflectance(cosine, mi.Float(result["outside"]), index)
        ratio = result["outside"] / index
        direction = ratio * direction + (ratio * cosine - through) * normal
        weight = dr.select(active, share * (1 - back), 0)
        ray = mi.Ray3f(at, direction)
        ray.o = at + 1e-4 * direction
        weak, count = share * result["weak"], mi.UInt32(0)

        def goes_on(*state: Any) -> Any:
            return state[5] & (state[6] < LOOPS)

        def meets(face: Any, rng: Any, ray: Any, weight: Any, medium: Any, active: Any, count: Any) -> tuple[Any, ...]:
            hit = scene.ray_intersect_preliminary(ray, coherent=False, active=active)
            active &= hit.is_valid()
            p = ray(hit.t)
            down = ray.d.z < 0
            met = dr.select(down, medium, medium + 1)
            level = dr.gather(mi.Float, self.level, met, active)
            wall = dr.abs(p.z - level) > 1e-3
            normal = dr.select(
                wall,
                mi.Vector3f(-p.x / radius, -p.y / radius, 0),
                mi.Vector3f(0, 0, dr.select(down, mi.Float(1), mi.Float(-1))),
            )
            cosine = dr.maximum(-dr.dot(ray.d, normal), 0)
            here = dr.gather(mi.Float, self.indices, medium, active)
            edge = wall | (met == 0) | (met == top)
            next_medium = dr.select(down, dr.maximum(medium, 1) - 1, medium + 1)
            there = dr.select(
                edge, result["outside"], dr.gather(mi.Float, self.indices, dr.minimum(next_medium, top - 1), active)
            )
            back, through = self.reflectance(cosine, here, there)
            touched = active & ~wall & (met == 0)
            column = mi.UInt32(dr.clip((p.x + radius) * (0.5 * bins / radius), 0, bins - 1))
            row = mi.UInt32(dr.clip((p.y + radius) * (0.5 * bins / radius), 0, bins - 1))
            dr.scatter_add(face, weight, row * bins + column, touched)
            goes = ~edge & (rng.next_float32() >= back)
            weight = dr.select(edge, weight * back, weight)
            feeble = ~goes & (weight < weak)
            active &= ~(feeble & (rng.next_float32() * weak >= weight))
            weight = dr.select(feeble, weak, weight)
            ratio = here / there
            direction = dr.select(
                goes, ratio * ray.d + (ratio * cosine - through) * normal, ray.d + 2 * cosine * normal
            )
            medium = dr.select(goes, next_medium, medium)
            ray.o = p + 1e-4 * direction
            ray.d = dr.normalize(direction)
            count += 1
            return face, rng, ray, weight, medium, active, count

        dr.while_loop((face, rng, ray, weight, medium, active, count), goes_on, meets)
        dr.eval(face)


def main() -> None:
    """Trace and print."""
    result = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    rays, seeds = int(float(sys.argv[2])), int(sys.argv[3])
    tracer = Tracer(result)
    a_lamp = rays // len(result["lamps"])
    tracer.traced(a_lamp, 0)
    seconds, maps = [], []
    for seed in range(1, seeds + 1):
        began = time.process_time()
        maps.append(tracer.traced(a_lamp, seed))
        seconds.append(time.process_time() - began)
    version = importlib.import_module("mitsuba").__version__
    sys.stdout.write(json.dumps({"version": version, "seconds": seconds, "maps": maps}))


if __name__ == "__main__":
    main()
