"""A target as a store would give it, made without one: quick, and the same every time."""

from __future__ import annotations

import hashlib
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.calibration.file import ProbeCalibration, calibration_sha256
from tsis.model.calibration import Calibration
from tsis.model.estimate import Estimate
from tsis.records.values import StoredEstimate, StoredPress, Target, TargetRecord

if TYPE_CHECKING:
    from numpy.typing import NDArray

WHEN = datetime(2026, 11, 22, 9, 30, tzinfo=UTC)
SHAPE = (96, 150)
SECRET = "5a" * 32


def levels(seed: int, *, full_scale: float = 255.0, height: float = 0.5) -> NDArray[Any]:
    """A bright patch on a noisy ground."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    patch = height * np.exp(-(((x - 74.5) / 20) ** 2) - ((y - 47.5) / 20) ** 2)
    grey = full_scale * (0.1 + patch) + rng.normal(0, 0.004 * full_scale, SHAPE)
    found: NDArray[Any] = np.clip(np.rint(grey), 0, full_scale).astype(np.uint8 if full_scale <= 255 else np.uint16)
    return found


def sample_calibration() -> ProbeCalibration:
    """An answer of grey to pressure and nothing else."""
    response = Calibration(gain_grey_per_kpa=2.0, saturation_kpa=100.0, name="bench", probe="tsis-2011")
    return ProbeCalibration(name="bench", probe="tsis-2011", response=response)


def sample_estimate(*, trusted: bool = True) -> Estimate:
    """A posterior of three parameters, one of them not identified."""
    rng = np.random.default_rng(7)
    return Estimate(
        samples={
            "diameter_mm": rng.normal(9.8, 0.4, 400),
            "depth_mm": rng.normal(5.1, 0.5, 400),
            "young_kpa": rng.uniform(45, 115, 400),
        },
        prior_sd={"diameter_mm": 4.04, "depth_mm": 2.31, "young_kpa": 23.1},
        cramer_rao_sd={"diameter_mm": 0.38, "depth_mm": 0.47, "young_kpa": float("inf")},
        presence=0.97,
        identifiability="Diameter and depth are identified, the modulus is not.",
        prior="uniform diameter 1 to 15 mm, depth 4 to 12 mm, modulus 40 to 120 kPa",
        trusted=trusted,
        flags=("young_kpa_not_identified",),
        notes=("The modulus is hardly narrower than the prior.",),
        provenance={"tsis": "0.1.0", "images": [{"name": "target-1N.png", "sha256": "0" * 64}]},
    )


def sample_record(*, full_scale: float = 255.0, kind: str = "phantom", estimated: bool = True) -> TargetRecord:
    """Two presses on a target and two on plain tissue, with a calibration and an estimate."""
    known = sample_calibration()
    frames: dict[str, NDArray[Any]] = {}
    presses = []
    for i, (role, force) in enumerate((("target", 0.7), ("target", 1.0), ("plain", 0.7), ("plain", 1.0))):
        pixels = levels(i, full_scale=full_scale, height=0.5 * force if role == "target" else 0.3 * force)
        name = hashlib.sha256(pixels.tobytes()).hexdigest()
        frames[name] = pixels
        presses.append(
            StoredPress(
                role=role,
                taken=WHEN + timedelta(seconds=20 * i),
                frame=name,
                rows=SHAPE[0],
                columns=SHAPE[1],
                full_scale=full_scale,
                force_n=force,
                mm_per_pixel=(0.12, 0.14),
                axis_px=(74.5, 47.5),
                probe="tsis-2011",
                calibration=calibration_sha256(known),
                flags=("moving",) if i == 1 else (),
                settings={"exposure_ms": 10.0, "gain": 1.0},
                name=f"{role}-{force:g}N.png",
                id=f"press-{i}",
                target="target-a",
            )
        )
    estimate = StoredEstimate(
        kind="inclusion",
        estimate=sample_estimate(),
        made=WHEN + timedelta(minutes=2),
        probe="tsis-2011",
        presses=tuple(press.id for press in presses),
        calibration=calibration_sha256(known),
        options={"prior": {}},
        environment={"tsis": "0.1.0", "numpy": "2.4.6"},
        id="estimate-a",
        target="target-a",
    )
    truth = {"diameter_mm": 10.0, "depth_mm": 5.0, "young_kpa": 80.0} if kind == "phantom" else {}
    return TargetRecord(
        target=Target(number=3, kind=kind, name="size-10", note="bench", truth=truth, made=WHEN, id="target-a"),
        presses=tuple(presses),
        read=frames.__getitem__,
        estimates=(estimate,) if estimated else (),
        calibrations={calibration_sha256(known): known},
        secret=SECRET,
    )
