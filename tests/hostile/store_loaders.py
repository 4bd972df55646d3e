"""Loaders of stored records: bundles, samples, what other commands wrote, and a store's own files."""

from __future__ import annotations

import hashlib
import io
import json
import tempfile
import zipfile
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.hostile.bytes_changed import damaged
from tests.hostile.json_changed import changed_document, text_of
from tests.hostile.loader import Loader
from tests.hostile.picture_loaders import token
from tests.records.sample import sample_estimate, sample_record
from tests.records.variants import plain, sealed

from tsis.files.reading import read_bytes
from tsis.instrument.camera import Frame
from tsis.instrument.image_files import png_bytes
from tsis.instrument.recording import (
    RECORDING_COLUMNS,
    RECORDING_FORMAT,
    RECORDING_INDEX,
    RECORDING_SUMMARY,
    RECORDING_VERSION,
)
from tsis.instrument.snapshot import save_snapshot
from tsis.model.image import TactileImage
from tsis.records.blobs import samples_bytes, samples_of
from tsis.records.sources import ImportOptions, find_import_batches
from tsis.records.store import open_store
from tsis.records.target import read_bundle, write_bundle

if TYPE_CHECKING:
    from collections.abc import Hashable

    from tsis.records.sources import ImportBatch

MADE = datetime(2026, 11, 22, 10, 0, tzinfo=UTC)
HEAD = 80  # bytes of a samples file before what its hash covers
LEVELS = np.random.default_rng(9).integers(0, 256, (12, 17)).astype(np.uint8)


def store_loaders() -> tuple[Loader, ...]:
    """Bundles, samples, recordings, snapshots, and the files of a store."""
    return (*_exchanged(), *_recorded(), *_snapshots(), *_stored())


def _exchanged() -> tuple[Loader, ...]:
    with tempfile.TemporaryDirectory() as place:
        write_bundle(sample_record(), Path(place) / "bundle.zip")
        bundle = (Path(place) / "bundle.zip").read_bytes()
    return (
        Loader(
            name="bundle",
            file="bundle.zip",
            originals=(bundle,),
            load=lambda path: _hashed(plain(read_bundle(path))),
            integrity=True,
            forge=_forged_bundle,
            share=0.2,
        ),
        Loader(
            name="posterior samples",
            file="a.samples",
            originals=(samples_bytes(sample_estimate()),),
            load=lambda path: tuple((name, *token(values)) for name, values in samples_of(read_bytes(path)).items()),
            integrity=True,
            forge=_forged_samples,
        ),
    )


def _hashed(values: Any) -> str:
    return hashlib.sha256(json.dumps(values, default=str).encode()).hexdigest()


def _forged_bundle(original: bytes, rng: np.random.Generator) -> bytes:
    """One file of the bundle changed, and the manifest made to agree."""
    with zipfile.ZipFile(io.BytesIO(original)) as file:
        files = {name: file.read(name) for name in file.namelist()}
    name = sorted(files)[int(rng.integers(len(files)))]
    held = files[name]
    if name.endswith(".json") and isinstance(json.loads(held), dict) and rng.random() < 0.7:
        files[name] = text_of(changed_document(held, rng), rng)
    else:
        files[name] = damaged(held, held, rng, text=name.endswith(".json"))
    changed = io.BytesIO()
    with zipfile.ZipFile(changed, "w") as file:
        for each, content in (files if name == "manifest.json" else sealed(files)).items():
            file.writestr(each, content)
    return changed.getvalue()


def _forged_samples(original: bytes, rng: np.random.Generator) -> bytes:
    changed = damaged(original[HEAD:], b"\0", rng)
    return original[: HEAD - 65] + hashlib.sha256(changed).hexdigest().encode() + b"\n" + changed


def _found(found: tuple[ImportBatch, ...]) -> Hashable:
    presses = [press for batch in found for press in batch.presses]
    return tuple((*token(press.image().grey), press.role, press.force_n, press.mm_per_pixel) for press in presses)


def _recorded() -> tuple[Loader, ...]:
    frame = png_bytes(TactileImage(grey=LEVELS.astype(float)))
    index = ",".join((*RECORDING_COLUMNS, "force_n")) + "\n"
    index += "".join(
        f"{at},frame-{at}.png,1,{at},{0.1 * at:.3f},{5 + 0.1 * at:.3f},{0.5 * at:.2f}\n" for at in range(3)
    )
    summary = {
        "format": RECORDING_FORMAT,
        "version": RECORDING_VERSION,
        "camera": "camera",
        "begun": MADE.isoformat(),
        "begun_s": 5.0,
        "report": {"kept": 3},
    }
    around = {f"frame-{at}.png": frame for at in range(3)}
    around |= {RECORDING_INDEX: index.encode(), RECORDING_SUMMARY: json.dumps(summary).encode()}

    def load(path: Path) -> Hashable:
        return _found(find_import_batches([path.parent], ImportOptions()))

    return (
        Loader(
            name="recording, index",
            file=RECORDING_INDEX,
            originals=(index.encode(),),
            load=load,
            text=True,
            around=around,
            share=0.3,
        ),
        Loader(
            name="recording, report",
            file=RECORDING_SUMMARY,
            originals=(around[RECORDING_SUMMARY],),
            load=load,
            text=True,
            around=around,
            share=0.3,
            forge=lambda original, rng: text_of(changed_document(original, rng), rng),
        ),
    )


def _snapshots() -> tuple[Loader, ...]:
    with tempfile.TemporaryDirectory() as place:
        frame = Frame(pixels=LEVELS, sequence=3, time_s=0.5, full_scale=255.0, name="camera")
        kept = save_snapshot(frame, place, target=1, when=MADE, colour=lambda each: np.dstack([each.pixels] * 3))
        folder = kept.sidecar.parent
        files = {path.name: path.read_bytes() for path in folder.iterdir()}
        sidecar, raw = kept.sidecar.name, kept.raw.name
    return (
        Loader(
            name="snapshot, sidecar",
            file=sidecar,
            originals=(files[sidecar],),
            load=lambda path: _found(find_import_batches([path], ImportOptions())),
            text=True,
            around=files,
            share=0.3,
            forge=lambda original, rng: text_of(changed_document(original, rng), rng),
        ),
        Loader(
            name="snapshot, frame",
            file=raw,
            originals=(files[raw],),
            load=lambda path: _found(find_import_batches([path.parent / sidecar], ImportOptions())),
            integrity=True,
            around=files,
            share=0.3,
        ),
    )


def _stored() -> tuple[Loader, ...]:
    with tempfile.TemporaryDirectory() as place:
        with open_store(Path(place), kind="phantom") as store:
            target = store.add_target(number=1, name="size-10")
            for seed in range(2):
                image = TactileImage(grey=np.roll(LEVELS, seed).astype(float), force_n=0.5)
                store.add_press(target, image, role="target", taken=MADE + timedelta(seconds=seed))
        files = {str(path.relative_to(place)): path.read_bytes() for path in Path(place).rglob("*") if path.is_file()}
    database = next(name for name in files if name.endswith(".sqlite3"))
    frame = next(name for name in files if name.endswith(".png"))

    def load(path: Path) -> Hashable:
        place = next(folder for folder in path.parents if (folder / Path(database).name).exists())
        with open_store(place, kind="phantom", create=False) as store:
            found = []
            for summary in store.targets():
                target = store.target(summary.target.number)
                presses = store.presses(target)
                found.append((target.name, *((press.id, token(store.levels(press.frame))) for press in presses)))
            return tuple(found)

    def fresh(path: Path) -> Hashable:
        for name in ("-wal", "-shm", "-journal"):
            path.with_name(path.name + name).unlink(missing_ok=True)
        return load(path)

    return (
        Loader(
            name="store, database", file=database, originals=(files[database],), load=fresh, around=files, share=0.03
        ),
        Loader(
            name="store, frame",
            file=frame,
            originals=(files[frame],),
            load=load,
            integrity=True,
            around=files,
            share=0.1,
        ),
    )
