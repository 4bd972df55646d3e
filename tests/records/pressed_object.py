"""A store with a target whose hardness was estimated: real frames and the real estimate, without the mechanics."""

from __future__ import annotations

from datetime import timedelta
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.hardness.stand_ins import by_table
from tests.records.sample import WHEN

from tsis.calibration.file import ProbeCalibration
from tsis.catalog.phantoms import load_sphere
from tsis.catalog.probes import load_probe
from tsis.hardness import estimate
from tsis.records.provenance import environment
from tsis.virtual.direct_contact import DirectContactRig

if TYPE_CHECKING:
    from datetime import datetime

    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage
    from tsis.records.store import Store
    from tsis.records.values import Target

PROBE, SPHERE = "tsis-direct", "cl2000x"
OPTIONS = {"radius_mm": 3.0, "radius_sd_mm": 0.02}


@cache
def pressed() -> tuple[tuple[TactileImage, ...], ProbeCalibration, Estimate]:
    """Two presses, the calibration, and the estimate from them."""
    probe = load_probe(PROBE)
    solve: Any = by_table
    rig = DirectContactRig(probe, rng=np.random.default_rng(3), solve=solve)
    frames = tuple(rig.press_path(load_sphere(SPHERE), forces_n=(0.7, 1.2)))
    known = ProbeCalibration(name="bench", probe=PROBE, response=rig.calibration)
    options: Any = OPTIONS
    return frames, known, estimate(frames, probe=probe, calibration=rig.calibration, **options)


def stored_object(
    store: Store, *, made: datetime | None = None, expires: datetime | None = None, **options: Any
) -> Target:
    """Enter it as ``tsis hardness --save`` would."""
    from dataclasses import replace

    frames, known, found = pressed()
    known = replace(known, made=made, expires=expires)
    target = store.add_target(name=SPHERE, truth={"young_kpa": 103.0})
    presses = [
        store.add_press(target, frame, taken=WHEN + timedelta(seconds=at), probe=PROBE, calibration=known)
        for at, frame in enumerate(frames)
    ]
    store.add_estimate(
        target,
        found,
        kind="hardness",
        presses=presses,
        probe=PROBE,
        calibration=known,
        options=OPTIONS | options,
        environment=environment(),
    )
    return target
