"""Folders as ``tsis demo`` and ``tsis acquire`` write them, with small frames that no estimate needs."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from tsis.calibration.file import ProbeCalibration, calibration_bytes
from tsis.inclusion import InclusionPrior
from tsis.instrument.camera import Frame
from tsis.instrument.snapshot import Snapshot, save_snapshot
from tsis.model.calibration import Calibration

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray


NAMES = {"images": ("target-0.5N.png", "target-1N.png"), "reference": ("reference-1N.png",)}
SIZE_8 = {"diameter_mm": 8.0, "depth_mm": 5.0, "young_kpa": 80.0}


def demo_levels(seed: int) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (16, 24)).astype(np.uint8)


def entry(folder: Path, name: str, seed: int) -> dict[str, Any]:
    cv2.imwrite(str(folder / name), demo_levels(seed))
    seen = hashlib.sha256(demo_levels(seed).astype(np.float32).data).hexdigest()
    return {"name": name, "sha256": seen, "mm_per_pixel": [0.1, 0.1], "force_n": 1.0, "settings": {"source": "virtual"}}


def write(folder: Path, document: dict[str, Any]) -> None:
    (folder / "result.json").write_text(json.dumps(document))


def make_demo(
    folder: Path, *, phantom: str = "size-8", truth: Mapping[str, float] | None = None, pressed: int = 0
) -> Path:
    """Presses on a phantom; those on plain tissue and of the untouched probe are the same whatever was pressed."""
    folder.mkdir()
    response = Calibration(gain_grey_per_kpa=2.0, saturation_kpa=100.0, name="virtual", probe="tsis-domed")
    known = ProbeCalibration(name="virtual", probe="tsis-domed", response=response)
    (folder / "calibration.json").write_bytes(calibration_bytes(known))
    result: dict[str, Any] = {"probe": {"name": "tsis-domed"}, "prior": asdict(InclusionPrior()), "strain": "small"}
    for seed, (kind, names) in zip((pressed, 10), NAMES.items(), strict=True):
        result[kind] = [entry(folder, name, seed + at) for at, name in enumerate(names)]
    cv2.imwrite(str(folder / "untouched.png"), demo_levels(99))
    simulated = {"phantom": {"name": phantom, "inclusion": dict(truth or SIZE_8)}}
    schema = {"name": "tsis-demo", "version": 1}
    write(folder, {"schema": schema, "command": "demo", "simulated": simulated, "estimate": {"provenance": result}})
    return folder


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
