"""Programs killed at any moment lose nothing that they had acknowledged, and harm nobody else's."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import pytest
from tests.endurance import scaled
from tests.records.killed_writers import Careless, killed_cycles

from tsis.files.atomic import DISK

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork"),
    # In the child only this thread lives on; it takes no lock that another may have held.
    pytest.mark.filterwarnings("ignore:This process:DeprecationWarning"),
]


def test_nothing_acknowledged_is_lost(tmp_path: Path) -> None:
    found = killed_cycles(tmp_path, 100, seed=200, every=20, disk=DISK)
    assert (found.lost, found.torn, found.faults) == ([], [], [])
    assert found.acknowledged > 100


@pytest.mark.slow
def test_nothing_acknowledged_is_lost_in_many_lives(tmp_path: Path) -> None:
    found = killed_cycles(tmp_path, scaled(300), seed=1, every=100, disk=DISK)
    assert (found.lost, found.torn, found.faults) == ([], [], [])


@pytest.mark.slow
def test_a_store_that_writes_carelessly_is_found_out(tmp_path: Path) -> None:
    found = killed_cycles(tmp_path, 150, seed=3, every=10, disk=Careless())
    assert found.torn
