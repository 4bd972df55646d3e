"""Loaders of points, trials, forces and caches, with small files for each."""

from __future__ import annotations

import io
import os
import zipfile
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.hostile.bytes_changed import damaged
from benchmarks.hostile.loader import Loader
from benchmarks.hostile.picture_loaders import token
from benchmarks.matching.runs import TRIAL_ROW_HEAD, read_trial_rows
from benchmarks.matching.trials import PUBLIC_FILE, public_trials

from tsis.files import cached_arrays, cached_sha256
from tsis.instrument.gauge import RecordedGauge
from tsis.matching import csv_text, read_points

if TYPE_CHECKING:
    from collections.abc import Hashable
    from pathlib import Path

    from benchmarks.matching.distort import Trial
    from numpy.typing import NDArray

CACHE, KEY = "fits", "0123456789abcdef"


def point_loaders() -> tuple[Loader, ...]:
    """Point sets in their three formats, public trials, rows of a benchmark, force readings and cached arrays."""
    rng = np.random.default_rng(6)
    flat, solid = rng.random((7, 2)), rng.random((6, 3))
    force = "time_s,force_n,resolution_n,time_error_s\n" + "".join(
        f"{0.1 * at!r},{0.2 * at!r},0.01,0.0\n" for at in range(8)
    )
    rows = ",".join(TRIAL_ROW_HEAD) + "\nfish/noise/1/0,tprl,1,0.25,1.5,yes,\nfish/noise/1/1,cpd,1,0.5,0.5,,too few\n"
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
            name="public trials",
            file=PUBLIC_FILE,
            originals=(_npz(compressed=False), _npz(compressed=True)),
            load=lambda path: _trials(public_trials(path.parent, shape="fish", family="noise", level=1)),
            forge=partial(_member_damaged, name="fish_noise_1_x1.npy"),
        ),
        Loader(
            name="rows of a benchmark",
            file="rows.csv",
            originals=(rows.encode(),),
            load=lambda path: tuple(read_trial_rows(path)),
            text=True,
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
    names = {"x1": (9, 2), "target": (3, 9, 2), "target_clean": (3, 9, 2)}
    arrays = {f"fish_noise_1_{name}": rng.random(shape) for name, shape in names.items()}
    (np.savez_compressed if compressed else np.savez)(stream, allow_pickle=False, **arrays)
    return stream.getvalue()


def _member_damaged(original: bytes, rng: np.random.Generator, *, name: str) -> bytes:
    """The archive with one member damaged, its checksum right."""
    changed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(original)) as old, zipfile.ZipFile(changed, "w") as new:
        for entry in old.infolist():
            held = old.read(entry)
            new.writestr(entry, damaged(held, held, rng, text=True) if entry.filename == name else held)
    return changed.getvalue()


def _trials(trials: Any) -> Hashable:
    found: list[Trial] = list(trials)
    return tuple((trial.name, *token(trial.source), *token(trial.target)) for trial in found)


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
