"""Map stiff bodies that are no spheres: a box, a cone, a torus and a hyperboloid, the shapes of tactile elastography.

    python -m benchmarks.mapping.bodies --folder FOLDER --lines FILE --seeds 1000 1001 1002 1003

Scans of `benchmarks.mapping.solved_scans`, in three dimensions, each body in slightly uneven tissue. The picture of
the modulus is compared voxel by voxel with the truth under the presses: root mean square error over the contrast's
range, and similarity of structure (SSIM of scikit-image). "Of tissue" is a picture that knows no body: both figures
depend on how much of the volume the body fills. "Mean" is the mean modulus inside the body and "volume" the expected
volume of lumps, both over the truth; the intervals are those of the voxels inside. The published figures are of other
sizes and moduli.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.harness import Bench, Goal, Several, append_line, read_lines
from benchmarks.mapping.reading import read_solved, truth_of
from benchmarks.mapping.solved_scans import inside_body

import tsis
from tsis.mapping import estimate_map

VOXEL_MM = 1.0
HALF_MM, DEEPEST_MM = 20.0, 20.0  # of the volume that is compared
PUBLISHED = {"box": (0.089, 0.89), "cone": (0.0074, 0.94), "torus": (0.70, 0.58), "hyperboloid": (0.016, 0.99)}
PROBABLE = 1.645  # standard deviations of a 90 % interval


def mapped(path: Path) -> dict[str, Any]:
    """One body: the errors of its picture."""
    from skimage.metrics import structural_similarity

    truth = truth_of(path)
    scan = read_solved(path, seed=truth.seed)
    began = time.process_time()
    result = estimate_map(scan, probe=tsis.load_probe(truth.probe), seed=truth.seed, voxel_mm=VOXEL_MM)
    numbers, seconds = result.untrusted, time.process_time() - began
    axes = [numbers.depth_mm, numbers.y_mm, numbers.x_mm]
    near = [axes[0] <= DEEPEST_MM, *(np.abs(axis) <= HALF_MM for axis in axes[1:])]
    z, y, x = np.meshgrid(*(axis[part] for axis, part in zip(axes, near, strict=True)), indexing="ij")
    inside = inside_body(truth, np.column_stack([x.ravel(), y.ravel(), z.ravel()])).reshape(z.shape)
    true = truth.young_kpa * np.where(inside, truth.body_contrast, 1.0)
    box = np.ix_(*near)
    mean, sd = numbers.modulus_kpa[box], numbers.modulus_sd_kpa[box]
    span, tissue = float(np.ptp(true)), np.full(true.shape, truth.young_kpa)

    def error(picture: Any) -> float:
        return float(np.sqrt(((picture - true) ** 2).mean()))

    def similar(picture: Any) -> float:
        return float(structural_similarity(true, picture, data_range=span))  # type: ignore[no-untyped-call]

    return {
        "key": f"{truth.body}-{truth.seed}",
        "body": truth.body,
        "contrast": truth.body_contrast,
        "lumps": len(numbers.lumps),
        "rms_kpa": error(mean),
        "rms": error(mean) / span,
        "rms_tissue": error(tissue) / span,
        "similar": similar(mean),
        "similar_tissue": similar(tissue),
        "mean_inside": float(mean[inside].mean() / true[inside].mean()),
        "volume": float(numbers.probability[box].sum() / inside.sum()),
        "held": float((np.abs(mean - true) <= PROBABLE * sd)[inside].mean()),
        "flags": list(result.flags),
        "processor_s": seconds,
    }


if __name__ == "__main__":
    bench = Bench(__doc__, folder=Path("scans"), lines=Path("bodies.jsonl"), seeds=Several(kind=int))
    done = read_lines(bench.lines, "key")
    for seed in bench.seeds:
        file = bench.folder / f"scan-{seed:04d}.npz"
        if file.exists() and f"{truth_of(file).body}-{seed}" not in done:
            append_line(bench.lines, mapped(file))
    every = list(read_lines(bench.lines, "key").values())
    heads = ("body", "contrast", "lumps", "rms, kPa", "rms / range", "of tissue", "SSIM", "of tissue", "mean", "volume")
    first = ("contrast", "lumps", "rms_kpa", "rms", "rms_tissue")
    second = ("similar", "similar_tissue", "mean_inside", "volume", "held")
    bench.table(
        "Bodies",
        (*heads, "90 % intervals hold"),
        [
            (
                line["body"],
                *(f"{line[name]:.3g}" for name in first),
                *(f"{line[name]:.2f}" for name in second),
            )
            for line in every
        ],
    )
    raise SystemExit(
        bench.end(
            Goal(
                name=f"{line['key']}: SSIM",
                value=line["similar"],
                least=PUBLISHED[line["body"]][1],
                form="{:.2f}",
                peer=f"{PUBLISHED[line['body']][1]}",
            )
            for line in every
        )
    )
