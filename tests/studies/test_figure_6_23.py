"""The drawn curve and the numbers of it, from scores that are known."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.simulated_presses import PROTOCOLS
from matplotlib.figure import Figure
from sklearn.metrics import roc_auc_score
from studies.figure_6_23 import REPETITIONS, draw, values
from studies.section_6_4 import PLACES, TRUTH, Result


def scored(protocol: str) -> Result:
    presence = np.clip(np.random.default_rng(4).normal(0.35 + 0.4 * TRUTH, 0.25, (REPETITIONS[protocol], 16)), 0, 1)
    return Result(protocol=PROTOCOLS[protocol], place=PLACES[1], presence=presence)


def test_numbers_count_what_the_studies_gave() -> None:
    results = [scored(protocol) for protocol in REPETITIONS]
    found = values(results)
    for result, way in zip(results, ("one press", "with a reference press"), strict=True):
        hits = int((result.presence[:, :8] >= 0.5).sum())
        blanks = int((result.presence[:, 8:] < 0.5).sum())
        areas = [roc_auc_score(TRUTH, row) for row in result.presence]
        assert found[f"sensitivity, {way}"] == pytest.approx(100 * hits / (8 * len(areas)))
        assert found[f"specificity, {way}"] == pytest.approx(100 * blanks / (8 * len(areas)))
        assert found[f"area of a study, mean, {way}"] == pytest.approx(np.mean(areas))


def test_the_curve_encloses_the_area_of_all_studies_together() -> None:
    result, figure = scored("flat-alone"), Figure()
    draw([result], figure)
    false, hit = np.asarray(figure.axes[0].lines[0].get_xydata()).T
    together = roc_auc_score(np.tile(TRUTH, len(result.presence)), result.presence.ravel())
    assert np.trapezoid(hit, false) == pytest.approx(together, abs=1e-9)
