"""The loading that a step's frames show, refused where light and force did not go together."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration.force.curves import run_of
from tsis.calibration.force.loading import UNTOUCHED_N, Loading
from tsis.calibration.force.reading import read_loading_frame
from tsis.model.errors import CalibrationError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.calibration.force.line import ForceLine
    from tsis.calibration.reference.making import CameraReference
    from tsis.calibration.session.shot import CalibrationFrame
    from tsis.calibration.session.steps import CalibrationStep

TOUCHED_N = 0.03  # above the zero: between it and an unloaded gauge's wandering nobody can tell
AT_REST = 0.02  # share of the largest sum of grey levels that a frame without contact may show
LEAST_CORRELATION = 0.97  # of sums and forces; loops of 10 % and curves as F**(2/3) have 0.99


def read_loading(shots: Sequence[CalibrationFrame], step: CalibrationStep, reference: CameraReference) -> Loading:
    """Read a loading; presses so light that the gauge cannot tell them from none are left out.

    Raises
    ------
    CalibrationError
        When a frame has no force or is that before it, when the first is no zero, or the sums do not follow the force.
    """
    assert step.tip_mm is not None
    forces = [shot.force_n for shot in shots]
    if any(force is None for force in forces):
        raise CalibrationError("every frame must have a force; one has none (is the gauge silent?)")
    _require_new_frames(shots)
    zero = float(forces[0] or 0.0)
    readings = []
    for shot in shots:
        load = float(shot.force_n or 0.0) - zero
        if abs(load) <= UNTOUCHED_N or load >= TOUCHED_N:
            reading = read_loading_frame(shot.image, reference, force_n=zero + load, touched=load >= TOUCHED_N)
            readings.append(reading)
    loading = Loading.of(step.tip_mm, readings, run=step.run)
    first = float(loading.total_grey[0] / max(loading.total_grey.max(), 1.0))
    if first > AT_REST:
        raise CalibrationError(
            f"the tip must not touch in the first frame, whose force is the gauge's zero; it shows {first:.0%} of the "
            "largest sum of grey levels (repeat the step, and begin it untouched)"
        )
    _require_rising(loading)
    return loading


def require_measured_slope(line: ForceLine) -> None:
    """Refuse a force line whose slope is not told from zero, from which no force can be read."""
    low, high = line.slope_grey_per_n.interval()
    if low <= 0:
        raise CalibrationError(
            f"the slope of the force line must be told from zero; its 95 % interval is {low:.3g} to {high:.3g} grey "
            "levels a newton, for the loadings disagree (repeat those that stand out, or load three tips or more)"
        )


def _require_new_frames(shots: Sequence[CalibrationFrame]) -> None:
    """Refuse a picture that came twice: the noise of a live camera never repeats."""
    for number, (before, after) in enumerate(pairwise(shots), start=1):
        if np.array_equal(before.image.grey, after.image.grey):
            raise CalibrationError(
                f"every frame must be a new one; frames {number} and {number + 1} are alike to the last pixel (is the "
                "camera frozen? open it again, and repeat the step)"
            )


def _require_rising(loading: Loading) -> None:
    run = run_of(loading)
    with np.errstate(invalid="ignore", divide="ignore"):  # of sums that are all alike it is not defined
        correlation = float(np.corrcoef(run.force_n, run.total_grey)[0, 1])
    if not correlation >= LEAST_CORRELATION:
        raise CalibrationError(
            f"the sum of grey levels must rise with the force, correlated with it by {LEAST_CORRELATION:g} or more; "
            f"got {correlation:.2f} (do frames and forces belong together? repeat the step)"
        )
