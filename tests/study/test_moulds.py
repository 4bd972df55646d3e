"""Moulds are closed bodies with the volumes of their formulas, also after a round trip through the STL file."""

from __future__ import annotations

import struct
from collections import Counter

import numpy as np
import pytest

from tsis.errors import InputError
from tsis.study import cup, sphere_mould, stl_bytes, volume_mm3


def read_back(content: bytes) -> np.ndarray:
    (count,) = struct.unpack_from("<I", content, 80)
    record = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    assert len(content) == 84 + 50 * count
    return np.frombuffer(content, record, offset=84)["corners"].astype(float)


@pytest.mark.parametrize("diameter", [3.0, 8.0, 14.0])
def test_half_a_mould_of_a_sphere(diameter: float) -> None:
    radius = diameter / 2
    expected = np.pi * (radius + 3) ** 2 * (radius + 3) - 2 / 3 * np.pi * radius**3
    check(sphere_mould(diameter), expected)


@pytest.mark.parametrize(("diameter", "height"), [(20.0, 10.0), (90.0, 30.0)])
def test_a_cup(diameter: float, height: float) -> None:
    radius = diameter / 2
    check(cup(diameter, height), np.pi * ((radius + 3) ** 2 * (height + 3) - radius**2 * height))


def check(triangles: np.ndarray, expected: float) -> None:
    stored = read_back(stl_bytes(triangles, "mould"))
    assert stored == pytest.approx(triangles, abs=1e-5)
    edges: Counter[tuple[bytes, bytes]] = Counter()
    for corners in stored + 0.0:  # no negative zeros
        names = [corner.round(5).tobytes() for corner in corners + 0.0]
        edges.update(zip(names, [*names[1:], names[0]], strict=True))
    assert set(edges.values()) == {1}
    assert all(edges[after, before] == 1 for before, after in edges)  # watertight, one orientation
    assert volume_mm3(stored) == pytest.approx(expected, rel=1e-3)


def test_sizes_that_nobody_prints_are_refused() -> None:
    with pytest.raises(InputError, match="diameter_mm must lie in"):
        sphere_mould(0.1)
