"""Snapshots as ``tsis acquire`` saves them."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.instrument.camera import Frame
from tsis.instrument.snapshot import Snapshot, save_snapshot

if TYPE_CHECKING:
    from pathlib import Path

WHEN = datetime(2026, 11, 22, 9, 30, 0, 250_000, tzinfo=UTC)


def frame(number: int, *, full_scale: float = 255.0) -> Frame:
    levels = np.random.default_rng(number).integers(0, int(full_scale) + 1, (16, 24))
    kind: Any = np.uint8 if full_scale <= 255 else np.uint16
    return Frame(
        pixels=levels.astype(kind),
        sequence=number,
        time_s=number / 30,
        full_scale=full_scale,
        name="scripted",
        settings={"exposure_ms": 10.0},
    )


def save(
    folder: Path, number: int, *, target: int = 3, force_n: float | None = 0.7, full_scale: float = 255.0, **about: Any
) -> Snapshot:
    return save_snapshot(
        frame(number, full_scale=full_scale),
        folder,
        target=target,
        when=WHEN + timedelta(seconds=number),
        colour=lambda shown: np.zeros((*shown.pixels.shape, 3), np.uint8),
        about={
            "camera": "scripted",
            "calibration": None,
            "force": None if force_n is None else {"force_n": force_n, "error_n": 0.01},
            "flags": [{"name": "moving", "advice": "wait"}],
            **about,
        },
    )
