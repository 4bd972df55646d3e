"""Draw the picture of point matching: python docs/images/point_matching.py."""

from pathlib import Path

import numpy as np
from benchmarks.matching.distort import Distortion, distort, strokes
from benchmarks.matching.trials import matching_error
from matplotlib.figure import Figure

from tsis.matching import register
from tsis.present.figures import point_sets


def main() -> None:
    """Distort a written shape, match it by two methods, draw."""
    rng = np.random.default_rng(3)
    what = Distortion(bending=0.05, affine=0.15, rotation_deg=120.0, outlier_ratio=0.3)
    trial = distort(strokes(100, rng=rng), what, rng=rng)
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    panels = figure.subplots(1, 3)
    point_sets(trial.source, trial.target, panels[0]).set_title("a shape, and what became of it")
    for method, ax in zip(("tprl", "cpd"), panels[1:], strict=True):
        found = register(trial.source, trial.target, method=method)
        error = matching_error(trial, found.untrusted.moved)
        point_sets(found.untrusted.moved, trial.target, ax, source_label="moved source")
        ax.set_title(f"{method}: RMS error {error:.3f}")
    figure.savefig(Path(__file__).with_name("point-matching.png"), dpi=110)


if __name__ == "__main__":
    main()
