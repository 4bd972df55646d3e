"""The worlds of solved scans, without a solve."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.mapping.solved_scans import BODIES, DOMED, FLAT, inside_body, world


@pytest.mark.parametrize("seed", [1000, 1001, 1002, 1003])
def test_a_body_has_the_volume_and_the_centre_of_its_closed_form(seed: int) -> None:
    truth, step = world(seed), 0.2
    axis = np.arange(-13.0, 13.0, step) + step / 2
    at = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3) + truth.body_mm
    inside = at[inside_body(truth, at)]
    ends = np.pi * 10.0 / 3 * (8.0**2 + 8.0 + 1.0)
    volume = {
        "box": 16.0 * 10.0 * 9.0,
        "cone": ends,
        "torus": 2 * np.pi**2 * 8.0 * 3.5**2,
        "hyperboloid": np.pi * 10.0 * (16.0 + 48.0 / 3),
    }[truth.body]
    assert len(inside) * step**3 == pytest.approx(volume, rel=0.01)
    assert inside[:, :2].mean(axis=0) == pytest.approx(truth.body_mm[:2], abs=0.05)
    assert inside[:, 2].mean() >= truth.body_mm[2] - 0.05  # the cone stands on its wide end


def test_seeds_tell_the_kind_of_world() -> None:
    assert {world(seed).body for seed in range(1000, 1004)} == set(BODIES)
    assert world(401).probe == DOMED
    assert world(301).probe == FLAT
    assert not world(303).lumps
    assert len(world(901).lumps) == 2
