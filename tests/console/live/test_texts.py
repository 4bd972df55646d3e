"""What is said of the frames to those who do not see them."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tsis.console.live.view import analysis_text, histogram_text, notice
from tsis.console.services.frames import ContactView, FrameAnalysis

ANALYSIS = FrameAnalysis(
    number=1, flags=(), force=None, still="", contact=None, histogram=(4, 0), clipped_share=0.0, warnings=()
)


def state(analysis: FrameAnalysis | None, *, running: bool = True, lost: bool = False, busy: str = "") -> Any:
    return SimpleNamespace(busy=busy, frame_analysis=analysis, camera=SimpleNamespace(running=running, lost=lost))


def analysis_of(levels: np.ndarray, contact: ContactView | None = None) -> FrameAnalysis:
    counts = np.histogram(levels, bins=64, range=(0.0, 256.0))[0]
    return FrameAnalysis(
        number=1,
        flags=(),
        force=None,
        still="",
        contact=contact,
        histogram=tuple(counts.tolist()),
        clipped_share=float((levels == 255).mean()),
        warnings=(),
    )


@pytest.mark.parametrize("centre", [3, 60, 128, 250])
def test_half_of_the_pixels_lie_below_the_level_that_is_said(centre: int) -> None:
    levels = np.random.default_rng(1).normal(centre, 20, 5001).round().clip(0, 255)
    message = histogram_text(state(analysis_of(levels)))
    result = re.fullmatch(r"half of the pixels below (\d+)% of full scale, ([\d.]+)% at it", message)
    assert result is not None
    assert float(result[1]) == pytest.approx(100 * np.median(levels) / 256, abs=100 / 64 + 0.5)
    assert float(result[2]) == pytest.approx(100 * (levels == 255).mean(), abs=0.05)


def test_a_contact_is_said_with_its_place() -> None:
    contact = ContactView(centroid_px=(384.4, 245.6), outline_px=())
    assert analysis_text(state(analysis_of(np.zeros(4), contact))) == "contact around column 384, row 246"
    assert analysis_text(state(ANALYSIS)) == "nothing is pressed"


@pytest.mark.parametrize("text", [analysis_text, histogram_text])
def test_without_frames_that_is_said(text: Any) -> None:
    assert text(state(None)) == text(state(ANALYSIS, running=False)) == "no frames"


def test_a_picture_that_may_be_old_says_so() -> None:
    assert notice(state(ANALYSIS)) == ""
    assert notice(state(ANALYSIS, running=False)) == "the camera is stopped"
    assert "last frame" in notice(state(ANALYSIS, lost=True))


def test_a_camera_that_is_being_started_is_not_called_stopped() -> None:
    assert notice(state(None, running=False, busy="starting the camera")) == "starting the camera …"
    assert notice(state(None, running=False)) == "the camera is stopped"
