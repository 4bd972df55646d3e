"""What OpenCV's captures of files and of devices have in common."""

from __future__ import annotations

from typing import Any

import cv2

from tsis.instrument.camera import Mode


def present_mode(capture: Any) -> Mode:
    """Size and rate that an opened capture declares; no rate where it tells none."""
    rate = float(capture.get(cv2.CAP_PROP_FPS))
    return Mode(
        width_px=int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)),
        height_px=int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)),
        frames_per_s=rate if rate > 0 else None,
    )
