"""A tray in a store: presses with places, maps of them made up, and a folder of exact presses."""

from __future__ import annotations

import csv
import json
from dataclasses import asdict
from datetime import timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.records.sample import WHEN, levels, sample_calibration

import tsis
from tsis.calibration.file import ProbeCalibration
from tsis.imaging.sensor import Sensor
from tsis.mapping.prior import MapPrior
from tsis.model.calibration import LightMap
from tsis.model.image import TactileImage
from tsis.records.blobs import frame_bytes
from tsis.records.places import place_settings
from tsis.virtual.probe import VirtualProbe, nominal_calibration

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.mapping.lump_map import LumpMap
    from tsis.records.store import Store
    from tsis.records.values import StoredMap, StoredPress, Target

PROBE = "tsis-2011"
PIXELS, PLACES = (0.0336, 0.0392), ((0.0, 0.0), (40.0, 0.0), (-40.0, 0.0), (0.0, 40.0))
OPTIONS = {
    "prior": json.loads(json.dumps(asdict(MapPrior()))),
    "voxel_mm": 5.0,
    "seed": 3,
    "steps": 1000,
    "left_out": ["b.png has no place."],
}


def pressed(store: Store, name: str = "tray") -> tuple[Target, tuple[StoredPress, ...]]:
    """A target with three presses, each with its place."""
    target = store.add_target(name=name)
    presses = []
    for at in range(3):
        frame = TactileImage(
            grey=levels(at),
            force_n=1.0,
            name=f"of {name} {at}.png",
            settings=place_settings({"x_mm": 9.0 * at, "y_mm": 0.0}),
        )
        taken, known = WHEN + timedelta(seconds=at), sample_calibration()
        presses.append(store.add_press(target, frame, taken=taken, probe=PROBE, calibration=known))
    return target, tuple(presses)


def kept(store: Store, found: LumpMap, *, name: str = "tray") -> tuple[Target, StoredMap]:
    """A target with a map of its presses."""
    target, presses = pressed(store, name)
    given: dict[str, Any] = {"options": OPTIONS, "environment": {"tsis": "0.1.0"}, "probe": PROBE}
    return target, store.add_map(target, found, presses=presses, calibration=sample_calibration(), **given)


def require_equal(read: LumpMap, found: LumpMap) -> None:
    """Every number of two maps is the same bit for bit, and every text."""
    for name in ("x_mm", "probability", "area_probability", "modulus_kpa", "modulus_sd_kpa", "blind_diameter_mm"):
        np.testing.assert_array_equal(getattr(read.untrusted, name), getattr(found.untrusted, name), strict=True)
    for lump, other in zip(read.untrusted.lumps, found.untrusted.lumps, strict=True):
        assert (lump.name, lump.probability, lump.contrast_above) == (
            other.name,
            other.probability,
            other.contrast_above,
        )
        for name, samples in other.estimate.untrusted.samples.items():
            np.testing.assert_array_equal(lump.estimate.untrusted.samples[name], samples, strict=True)
    assert (read.trusted, read.flags, read.notes, read.left_out) == (
        found.trusted,
        found.flags,
        found.notes,
        found.left_out,
    )
    assert read == found


def tray_calibration() -> ProbeCalibration:
    """The calibration of the probe that pressed the tray."""
    return ProbeCalibration(name="bench", probe=PROBE, response=nominal_calibration(Sensor(), LightMap.uniform()))


def write_tray(folder: Path) -> Path:
    """Frames of the virtual probe over one lump and at three places beside it, and one without a place."""
    folder.mkdir()
    lump = tsis.Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=50.0)
    tissue = tsis.Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=lump)
    rng, light = np.random.default_rng(5), LightMap.uniform()
    probe = VirtualProbe(tsis.load_probe(PROBE), rng=rng, sensor=Sensor(), light=light, strain="small")
    with (folder / "poses.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(("file", "x_mm", "y_mm", "force_n"))
        rows.writerow(("absent.png", "", "", ""))
        for number, place in enumerate(PLACES):
            frame = probe.press(tissue if number == 0 else tissue.without_inclusion(), force_n=1.0)
            assert frame.mm_per_pixel == PIXELS
            (folder / f"press-{number}.png").write_bytes(frame_bytes(frame))
            rows.writerow((f"press-{number}.png", *place, 1.0))
    return folder
