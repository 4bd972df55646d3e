"""Moulds are closed bodies with the volumes of their formulas, also after a round trip through the STL file."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from tsis.errors import InputError
from tsis.study.kit import cup, sphere_mould, stl_bytes, volume_mm3


def read_back(content: bytes) -> np.ndarray:
    (count,) = struct.unpack_from("<I", content, 80)
    record = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    assert len(content) == 84 + 50 * count
    return np.frombuffer(content, record, offset=84)["corners"].astype(float)


@pytest.mark.parametrize("diameter", [3.0, 13.0])
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
    np.testing.assert_allclose(stored, triangles, atol=1e-5, rtol=0)
    places = np.rint(stored * 1e4).astype(np.int64) + 2**20  # tenths of a micrometre, 21 bits each
    corner = np.unique(places @ (1 << np.array([42, 21, 0])), return_inverse=True)[1].reshape(-1, 3)
    there, back = corner, np.roll(corner, -1, axis=1)
    one_way, count = np.unique(there * len(stored) * 3 + back, return_counts=True)
    assert (count == 1).all()
    assert np.array_equal(one_way, np.unique(back * len(stored) * 3 + there))  # watertight, one orientation
    assert volume_mm3(stored) == pytest.approx(expected, rel=1e-3)


def test_sizes_that_nobody_prints_are_refused() -> None:
    with pytest.raises(InputError, match="diameter_mm must lie in"):
        sphere_mould(0.1)
