"""Loaders of points, archives of arrays, forces and caches, with small files for each."""

from __future__ import annotations

import io
import os
import zipfile
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.hostile.bytes_changed import damaged
from tests.hostile.loader import Loader
from tests.hostile.picture_loaders import token

from tsis.errors import FileInputError
from tsis.files.archive import read_arrays
from tsis.files.cache import cached_arrays, cached_sha256
from tsis.files.reading import one_line, read_bytes
from tsis.instrument.gauge import RecordedGauge
from tsis.matching.point_files import csv_text, read_points

if TYPE_CHECKING:
    from collections.abc import Hashable
    from pathlib import Path

    from numpy.typing import NDArray

LARGEST_BYTES = 64 * 2**20
CACHE, KEY = "fits", "0123456789abcdef"


def point_loaders() -> tuple[Loader, ...]:
    """Point sets in their three formats, archives of arrays, force readings and cached arrays."""
    rng = np.random.default_rng(6)
    flat, solid = rng.random((7, 2)), rng.random((6, 3))
    force = "time_s,force_n,resolution_n,time_error_s\n" + "".join(
        f"{0.1 * at!r},{0.2 * at!r},0.01,0.0\n" for at in range(8)
    )
    csv = (csv_text(flat).encode(), csv_text(solid).encode(), b"0.5;1\n1;2\n# note\n3;4\n")
    return (
        Loader(name="points, CSV", file="a.csv", originals=csv, load=_points, text=True),
        Loader(
            name="points, NPY", file="a.npy", originals=(_npy(flat), _npy(solid.astype("<f4"))), load=_points, text=True
        ),
        Loader(
            name="points, PLY",
            file="a.ply",
            originals=tuple(_ply(solid, kind) for kind in PLY),
            load=_points,
            text=True,
        ),
        Loader(
            name="array archive",
            file="arrays.npz",
            originals=(_npz(compressed=False), _npz(compressed=True)),
            load=_arrays,
            forge=partial(_member_damaged, name="points.npy"),
        ),
        Loader(name="force readings", file="force.csv", originals=(force.encode(),), load=_forces, text=True),
        Loader(
            name="cached arrays",
            file=f"{CACHE}/{KEY}",
            originals=(_cached(),),
            load=_from_cache,
            integrity=True,
            forge=_forged_cache,
        ),
    )


PLY = ("ascii", "binary_little_endian", "binary_big_endian")


def _points(path: Path) -> Hashable:
    return token(read_points(path))


def _npy(values: NDArray[Any]) -> bytes:
    stream = io.BytesIO()
    np.save(stream, values, allow_pickle=False)
    return stream.getvalue()


def _ply(points: NDArray[np.float64], kind: str) -> bytes:
    head = f"ply\nformat {kind} 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    if kind == "ascii":
        return head.encode() + "".join(" ".join(map(repr, row)) + "\n" for row in points.tolist()).encode()
    return head.encode() + points.astype("<f4" if "little" in kind else ">f4").tobytes()


def _npz(*, compressed: bool) -> bytes:
    rng, stream = np.random.default_rng(7), io.BytesIO()
    arrays = {name: rng.random(shape) for name, shape in (("points", (9, 2)), ("target", (3, 9, 2)))}
    (np.savez_compressed if compressed else np.savez)(stream, allow_pickle=False, **arrays)
    return stream.getvalue()


def _arrays(path: Path) -> Hashable:
    try:
        found = read_arrays(read_bytes(path, most=LARGEST_BYTES), ("points", "target"), most=LARGEST_BYTES)
    except ValueError as error:
        raise FileInputError(f"{path.name} must be an archive of arrays; got: {one_line(error, 160)}") from error
    return tuple((name, *token(values)) for name, values in found.items())


def _member_damaged(original: bytes, rng: np.random.Generator, *, name: str) -> bytes:
    """The archive with one member damaged, its checksum right."""
    changed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(original)) as old, zipfile.ZipFile(changed, "w") as new:
        for entry in old.infolist():
            held = old.read(entry)
            new.writestr(entry, damaged(held, held, rng, text=True) if entry.filename == name else held)
    return changed.getvalue()


def _forces(path: Path) -> Hashable:
    gauge = RecordedGauge(path)
    gauge.open()
    return tuple(gauge.readings())


def _content() -> bytes:
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, plain=np.arange(6.0).reshape(2, 3), change=np.eye(3))
    return stream.getvalue()


def _cached() -> bytes:
    payload = _content()
    return cached_sha256(KEY, payload) + payload


def _forged_cache(original: bytes, rng: np.random.Generator) -> bytes:
    held = original[len(cached_sha256(KEY, b"")) :]
    payload = _member_damaged(held, rng, name="plain.npy") if rng.random() < 0.7 else damaged(held, held, rng)
    return cached_sha256(KEY, payload) + payload


def _from_cache(path: Path) -> Hashable:
    before = os.environ.get("TSIS_CACHE_DIR")
    os.environ["TSIS_CACHE_DIR"] = str(path.parents[1])
    try:
        found = cached_arrays(CACHE, KEY, lambda: {"plain": np.arange(6.0).reshape(2, 3), "change": np.eye(3)})
    finally:
        if before is None:
            del os.environ["TSIS_CACHE_DIR"]
        else:
            os.environ["TSIS_CACHE_DIR"] = before
    return tuple((name, *token(values)) for name, values in found.items())
