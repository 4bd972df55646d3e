from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import pytest

from tsis.catalog.probes import load_probe
from tsis.sweep.plan import Plan, Range

if TYPE_CHECKING:
    from pathlib import Path

QUANTITIES = {
    "tissue_young_kpa": 5.0,
    "thickness_mm": 40.0,
    "diameter_mm": Range(low=4.0, high=12.0),
    "depth_mm": Range(low=6.0, high=16.0),
    "young_kpa": Range(low=20.0, high=200.0, logarithmic=True),
}


class MakePlan(Protocol):
    def __call__(self, **changes: Any) -> Plan: ...


def small_plan(**changes: Any) -> Plan:
    """60 phantoms in 6 files."""
    given: dict[str, Any] = {
        "probe": load_probe(),
        "quantities": QUANTITIES,
        "count": 60,
        "seed": 4,
        "batch": 10,
        "radii_mm": (0.0, 3.0, 12.0),
    }
    return Plan(**(given | changes))


@pytest.fixture
def make_plan() -> MakePlan:
    return small_plan


def content(folder: Path) -> dict[str, bytes]:
    """Every file of a folder."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}
