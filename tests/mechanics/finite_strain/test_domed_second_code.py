"""Domed contact at finite strain against another code; see benchmarks/domed_second_code.py."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from benchmarks.domed_second_code import CASES, FINITE_STRAIN, PROBE, deviation, own, solved

STATES: dict[str, list[dict[str, Any]]] = json.loads(FINITE_STRAIN.read_text(encoding="utf-8"))["usual"]
MISSED = ("large", "wide", "deep", "far", "stiff", "faint")  # beyond 9 mm; see docs/reference/benchmarks.md
FIELDS = ("pressure_kpa", "displacement_mm")


def test_stored_states_have_the_protocols_forces() -> None:
    assert {name: tuple(one["force_n"] for one in STATES[name]) for name in CASES} == {
        name: case.forces_n for name, case in CASES.items()
    }


def test_stored_pressures_sum_up_to_the_force() -> None:
    shares = [
        one[which]["force_mn"] / one["force_n"] / 1000
        for name in CASES
        for one in STATES[name]
        for which in ("plain", "full")
    ]
    assert np.abs(np.array(shares) - 1).max() < 2e-3


def test_a_deviation_is_a_share_of_the_other_codes_signal() -> None:
    other = {"plain": {"field": [1.0, 1.0]}, "full": {"field": [3.0, 0.0]}}
    one = {"plain": {"field": [1.1, 1.0]}, "full": {"field": [3.2, -0.5]}}
    apart = deviation(one, other, "field")
    assert (apart.peak, apart.largest, apart.inner, apart.whole) == pytest.approx((2.0, 0.25, 0.25, 0.25))
    assert apart.rms == pytest.approx(np.sqrt((0.05**2 + 0.25**2) / 2))


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_signals_agree_with_the_stored_ones(name: str) -> None:
    for one, other in zip(own(name), STATES[name], strict=True):
        for field in FIELDS:
            apart = deviation(one, other, field)
            assert apart.inner < 0.01
            assert apart.largest < 0.01 or name in MISSED


@pytest.mark.slow
def test_a_state_solved_anew() -> None:
    pytest.importorskip("ngsolve", reason="the extra fem3d is not installed")
    for one, other in zip(solved("medium", "coarse", lambda text: None), STATES["medium"], strict=True):
        for field in FIELDS:
            assert deviation(one, other, field).largest < 0.01


@pytest.mark.slow
def test_forces_are_the_derivative_of_the_energy() -> None:
    pytest.importorskip("ngsolve", reason="the extra fem3d is not installed")
    from benchmarks.domed_second_code import MESHES
    from benchmarks.peers.ngsolve_dome import DomedPress

    model, generator = DomedPress(PROBE, CASES["medium"].phantom, MESHES["coarse"]), np.random.default_rng(0)
    at = model.untouched + 1e-4 * generator.normal(size=model.size)
    way = 1e-2 * generator.normal(size=model.size)
    gradient, tangent = model.linearised(at)
    ahead, behind = (model.linearised(at + sign * 1e-6 * way)[0] for sign in (1, -1))
    energies = [model.energy(at + sign * 1e-5 * way, 0.0) for sign in (1, -1)]
    assert (energies[0] - energies[1]) / 2e-5 == pytest.approx(gradient @ way, rel=1e-6)
    change = (ahead - behind) / 2e-6
    assert np.abs(change - tangent @ way).max() < 1e-6 * np.abs(change).max()
