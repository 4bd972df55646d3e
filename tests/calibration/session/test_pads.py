"""Forces on soft pads by the line of the tips, over those of the gauge."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.calibration.file.bench import bench_line, bench_reference

from tsis.calibration import session
from tsis.calibration.session import CalibrationFrame
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from tsis.calibration.camera_reference import CameraReference


def test_presses_on_a_pad_state_the_line_over_the_gauge_less_its_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    """The gauge shows 0 N where 0.1 N are missing, and frames without a force or with hardly any count for nothing."""
    pixels = 30 * 40

    def summed(frame: TactileImage, _: CameraReference, **__: object) -> float:
        return float(frame.grey.sum())

    monkeypatch.setattr(session, "total_grey", summed)
    shots = [
        CalibrationFrame(
            image=TactileImage(grey=np.full((30, 40), grey / pixels), mm_per_pixel=(1.0, 1.0)), force_n=force
        )
        for force, grey in ((-0.1, 5e4), (0.0, 5e4), (None, 5e4), (0.4, 900 + 4e4), (0.9, 900 + 9e4), (0.5, 0.0))
    ]
    ratios = session._line_over_gauge(shots, bench_line(), bench_reference())
    assert ratios == pytest.approx([0.8, 0.9])
