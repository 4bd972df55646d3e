"""Solved scans as the input of the map, with noise and errors of places of their own, and their truth."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.mapping.solved_scans import FORCE_N, World

import tsis
from tsis.inclusion.frames import OUTER_FRACTION
from tsis.mapping.scan import Scan, ScanPress

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

RINGS, SECTORS = 10, 16


def truth_of(path: Path) -> World:
    with np.load(path) as stored:
        values: dict[str, Any] = json.loads(str(stored["truth"]))
    return World(**{name: _tuples(value) for name, value in values.items()})


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value


def read_solved(path: Path, *, place_sd_mm: float = 0.1, seed: int = 0, noise_kpa: float = 0.005) -> Scan:
    """A stored scan: sector means with noise, a stated force that errs by 1 %, places that err by ``place_sd_mm``."""
    truth, rng = truth_of(path), np.random.default_rng([51, seed])
    with np.load(path) as stored:
        radius, bare, change = stored["radius_mm"], stored["bare_pressure_kpa"], stored["pressure_kpa"]
    edges = np.linspace(0.0, OUTER_FRACTION * tsis.load_probe(truth.probe).radius_mm, RINGS + 1)
    fine = edges[:-1, None] + np.diff(edges)[:, None] * (np.arange(20) + 0.5) / 20  # (rings, 20)
    weight = fine / fine.sum(axis=1, keepdims=True)
    angle = (np.arange(SECTORS) + 0.5) * 2 * np.pi / SECTORS
    presses = []
    for number, place in enumerate(truth.places_mm):
        means = np.zeros((RINGS, SECTORS))
        for order, profile in enumerate(change[number]):
            ring: NDArray[np.complex128] = (np.interp(fine, radius, profile.real) * weight).sum(axis=1) + 1j * (
                np.interp(fine, radius, profile.imag) * weight
            ).sum(axis=1)
            turned = ring[:, None] * np.exp(-1j * order * angle) * np.sinc(order / SECTORS)
            means += turned.real
        means += (np.interp(fine, radius, bare) * weight).sum(axis=1)[:, None]
        stated_n = float(FORCE_N * np.exp(rng.normal(0.0, 0.01)))
        presses.append(
            ScanPress(
                place_mm=tuple((np.array(place) + rng.normal(0.0, place_sd_mm, 2)).tolist()),
                place_sd_mm=place_sd_mm,
                force_n=stated_n,
                pressure_kpa=means + rng.normal(0.0, noise_kpa, means.shape),
                noise_kpa=noise_kpa,
                name=f"press {number + 1}",
            )
        )
    return Scan(presses=tuple(presses), name=path.stem)
