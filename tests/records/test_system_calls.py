"""What programs really ask of the system holds, SQLite's own files and all: states made of it are opened by SQLite."""

from __future__ import annotations

import shutil
import subprocess

import pytest
from tests.records.system_calls import PLACE, PROGRAM, Call, losses, syncs, traced

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(shutil.which("strace") is None, reason="strace is not installed"),
]


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Call], str]:
    try:
        return traced(tmp_path_factory.mktemp("calls"), PROGRAM)
    except subprocess.CalledProcessError as error:
        pytest.skip(f"no program may be traced here: {error}")


def test_nothing_acknowledged_is_lost(told: tuple[list[Call], str]) -> None:
    opened, found = losses(*told, PLACE, seed=1, states=60)
    assert (opened, found) == (60, [])


@pytest.mark.parametrize("kind", ["log", "draft", "folder"])
def test_syncs_left_out_are_missed(told: tuple[list[Call], str], kind: str) -> None:
    left_out = syncs(*told)[kind]
    assert left_out
    assert losses(*told, PLACE, seed=1, states=25, skipped=left_out)[1]
