"""Draw seven shapes that the search for poses once turned or squeezed, as they are matched now.

    python -m benchmarks.matching.failures matching-failures.png

The shapes are trials of `benchmarks.matching.trust_shapes` (calibration generator, seed 60001) that the search without
pieces of the outline (version 1d4112c3) put in a wrong pose with posterior log odds of 2 to 40.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.matching.trials import matching_error
from benchmarks.matching.trust_shapes import trust_trial
from matplotlib.figure import Figure

from tsis.matching import register
from tsis.present.figures import point_sets

SEED = 60001
# family, degradation, number, and the error then
FORMER = (
    ("oval", "occlusion", 3, 0.822),
    ("oval", "occlusion", 4, 0.101),
    ("oval", "occlusion", 5, 0.119),
    ("oval", "occlusion", 7, 0.558),
    ("oval", "occlusion", 8, 0.872),
    ("lobes", "occlusion", 1, 0.123),
    ("lobes", "occlusion", 3, 0.480),
)


def main() -> None:
    """Match and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", type=Path, help="image file")
    chosen = parser.parse_args()
    figure = Figure(figsize=(13, 7), layout="constrained")
    panels = figure.subplots(2, 4).ravel()
    panels[-1].axis("off")
    for (family, degradation, number, before), ax in zip(FORMER, panels, strict=False):
        trial = trust_trial("calibration", family, degradation, number, seed=SEED)
        found = register(trial.source, trial.target)
        error = matching_error(trial, found.untrusted.moved)
        point_sets(found.untrusted.moved, trial.target, ax, source_label="moved source")
        legend = ax.get_legend()
        if legend is not None:
            legend.remove()  # it hides points
        ax.set_title(f"{family} {number}: RMS {error:.4f}, was {before:.3f}\nconfidence {found.confidence:.4f}")
        print(f"{family}/{degradation}/{number}: RMS {error:.4f}, was {before:.3f}; confidence {found.confidence:.4f}")
    handles, _ = panels[0].get_legend_handles_labels()
    panels[-1].legend(handles, ["moved source", "target"], loc="center")
    figure.savefig(chosen.picture, dpi=70)


if __name__ == "__main__":
    main()
