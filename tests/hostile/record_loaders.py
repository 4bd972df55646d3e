"""Loaders of calibrations, sessions and sweeps, with small files for each."""

from __future__ import annotations

import json
import tempfile
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.hostile.bytes_changed import damaged
from tests.hostile.json_changed import changed_document, text_of
from tests.hostile.loader import Loader
from tests.hostile.picture_loaders import token

from tsis.calibration.camera_reference import CameraReference
from tsis.calibration.file import (
    ProbeCalibration,
    calibration_bytes,
    calibration_sha256,
    document_sha256,
    read_calibration,
    read_handwritten_calibration,
)
from tsis.calibration.measured import MeasuredValue
from tsis.calibration.session import CalibrationFrame, SessionFolder, SessionSetup
from tsis.catalog.probes import load_probe
from tsis.errors import FileInputError
from tsis.files.reading import read_bytes
from tsis.model.calibration import Calibration, LightMap
from tsis.model.image import TactileImage
from tsis.sweep.data_set import MANIFEST_FILE, START, data_set_key, head, manifest_sha256, write_manifest
from tsis.sweep.data_set import read_data_set as read_sweep
from tsis.sweep.plan import EXAMPLE, Plan, Range, load_plan, plan_document
from tsis.sweep.shards import Receipt, Rows, data_set_of, encode_shard, receipt_of, sha256, shard_name

if TYPE_CHECKING:
    from collections.abc import Hashable

MADE, EXPIRES = datetime(2026, 11, 22, 10, 0, tzinfo=UTC), datetime(2027, 5, 22, 10, 0, tzinfo=UTC)


def record_loaders() -> tuple[Loader, ...]:
    """Calibration files, values to seal, sessions, plans, manifests and shards."""
    return (*_calibrations(), *_sessions(), *_sweeps())


@cache
def known_calibration(rows: int = 9, columns: int = 11) -> ProbeCalibration:
    """A calibration with maps, a response and settings."""
    rng = np.random.default_rng(3)
    shape = (rows, columns)
    return ProbeCalibration(
        name="bench",
        probe="tsis-2011",
        camera="camera",
        settings={"exposure_ms": 20.0, "gain": 0.0},
        made=MADE,
        expires=EXPIRES,
        reference=CameraReference(
            dark_grey=rng.normal(8.0, 0.1, shape),
            untouched_grey=rng.normal(2.0, 0.1, shape),
            relative_light=np.ones(shape),
            usable=np.ones(shape, dtype=bool),
            full_scale=255.0,
            mm_per_pixel=(0.0336, 0.0392),
            dark_frames=16,
            untouched_frames=16,
            flat_frames=0,
            read_noise_grey=_grey(0.5),
            shot_noise_grey=_grey(0.017),
            stray_grey=_grey(2.0),
        ),
        response=Calibration(gain_grey_per_kpa=60, saturation_kpa=20.0, light=LightMap.uniform(), probe="tsis-2011"),
    )


def _grey(value: float) -> MeasuredValue:
    return MeasuredValue(value=value, sd=0.01 * value, unit="grey")


def sealed(document: dict[str, Any]) -> dict[str, Any]:
    """The document with the hash of what it holds now."""
    if "calibration" in document:
        document["sha256"] = document_sha256(document["calibration"])
    return document


def _forged_calibration(original: bytes, rng: np.random.Generator) -> bytes:
    return text_of(sealed(changed_document(original, rng)), rng)


def _forged_json(original: bytes, rng: np.random.Generator) -> bytes:
    return text_of(changed_document(original, rng), rng)


def _calibrations() -> tuple[Loader, ...]:
    by_hand = {"name": "bench", "probe": "tsis-2011", "response": json.loads(calibration_bytes(known_calibration()))}
    by_hand["response"] = by_hand["response"]["calibration"]["response"]
    return (
        Loader(
            name="calibration",
            file="bench.json",
            originals=(calibration_bytes(known_calibration()),),
            load=lambda path: calibration_sha256(read_calibration(path)),
            integrity=True,
            text=True,
            forge=_forged_calibration,
        ),
        Loader(
            name="values to seal",
            file="values.json",
            originals=(json.dumps(by_hand, indent=1).encode(),),
            load=lambda path: read_handwritten_calibration(path, 180).response is not None,
            text=True,
            forge=_forged_json,
        ),
    )


def _sessions() -> tuple[Loader, ...]:
    with tempfile.TemporaryDirectory() as place:
        folder = SessionFolder(Path(place))
        folder.begin(SessionSetup(name="bench", probe="tsis-direct", camera="camera", began=MADE, tips_mm=(10.0, 14.0)))
        step = folder.plan()[0]
        grey = np.random.default_rng(1).integers(0, 256, (9, 13)).astype(float)
        folder.save(step, [CalibrationFrame(image=TactileImage(grey=grey), time_s=0.1 * time) for time in range(2)])
        files = {str(path.relative_to(place)): path.read_bytes() for path in Path(place).rglob("*") if path.is_file()}
    index = f"{step.name}/shots.csv"

    def shots(path: Path) -> Hashable:
        found = SessionFolder(path.parents[1]).shots(step)
        return tuple((*token(shot.image.grey), shot.image.full_scale, shot.time_s, shot.force_n) for shot in found)

    return (
        Loader(
            name="session, terms",
            file="session.json",
            originals=(files["session.json"],),
            load=lambda path: repr(SessionFolder(path.parent).setup()),
            text=True,
            forge=_forged_json,
        ),
        Loader(name="session, index", file=index, originals=(files[index],), load=shots, text=True, around=files),
    )


def _sweeps() -> tuple[Loader, ...]:
    plan = Plan(
        probe=load_probe(),
        quantities={
            "tissue_young_kpa": 5.0,
            "thickness_mm": 40.0,
            "diameter_mm": Range(low=4.0, high=12.0),
            "depth_mm": 8.0,
            "young_kpa": Range(low=20.0, high=200.0, logarithmic=True),
        },
        count=4,
        seed=4,
        batch=4,
        radii_mm=(0.0, 3.0),
    )
    start = head(plan)
    key = data_set_key(start)
    shard = encode_shard(_rows(), shard=0, data_set=key)
    with tempfile.TemporaryDirectory() as place:
        write_manifest(Path(place), start, [_receipt(shard, key)])
        manifest = (Path(place) / MANIFEST_FILE).read_bytes()
    name = shard_name(0)

    def forged_manifest(original: bytes, rng: np.random.Generator) -> bytes:
        document = changed_document(original, rng)
        try:
            document["plan_sha256"] = manifest_sha256(document["plan"])
            document["data_set"] = data_set_key({key: document[key] for key in START})
        except (KeyError, ValueError, RecursionError, TypeError):
            pass
        return text_of(document, rng)

    def settled(folder: Path) -> None:
        document = json.loads(manifest)
        document["shards"][0]["sha256"] = sha256((folder / name).read_bytes())
        (folder / MANIFEST_FILE).write_text(json.dumps(document))

    def columns(path: Path) -> Hashable:
        return tuple((column, *token(values)) for column, values in read_sweep(path.parent).items())

    def resumed(path: Path) -> Hashable:
        receipt = receipt_of(read_bytes(path), shard=0, data_set=key)
        if data_set_of(path) is None or receipt is None:
            raise FileInputError("damaged, and so computed again")
        return (receipt.rows, receipt.refused)

    return (
        Loader(
            name="sweep, plan",
            file="plan.toml",
            originals=(EXAMPLE.encode(),),
            load=lambda path: json.dumps(plan_document(load_plan(path))),
            text=True,
        ),
        Loader(
            name="sweep, manifest",
            file=MANIFEST_FILE,
            originals=(manifest,),
            load=columns,
            integrity=True,
            text=True,
            forge=forged_manifest,
            around={name: shard},
        ),
        Loader(
            name="sweep, shard",
            file=name,
            originals=(shard,),
            load=columns,
            integrity=True,
            forge=lambda original, rng: damaged(original, original, rng),
            around={MANIFEST_FILE: manifest},
            settle=settled,
        ),
        Loader(
            name="sweep, shard to resume",
            file=name,
            originals=(shard,),
            load=resumed,
            integrity=True,
        ),
    )


def _rows() -> Rows:
    rng = np.random.default_rng(5)
    names = ("force_n", "tissue_young_kpa", "thickness_mm", "diameter_mm", "depth_mm", "young_kpa", "approach_mm")
    numbers = {name: rng.random(4) for name in names}
    numbers |= {name: rng.random((4, 2)) for name in ("face_displacement_mm", "pressure_kpa")}
    return Rows(sample=np.arange(4), numbers=numbers, error=["", "", "", "refused"])


def _receipt(shard: bytes, key: str) -> Receipt:
    found = receipt_of(shard, shard=0, data_set=key)
    assert found is not None
    return found
