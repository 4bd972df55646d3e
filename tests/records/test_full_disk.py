"""A disk that is full, damaged, read-only or over quota costs one sentence, and nothing that was stored before."""

from __future__ import annotations

import errno
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from tests.records.full_disk import (
    CALLS,
    REASONS,
    FailingDisk,
    begin,
    failing_openings,
    failing_steps,
    full_databases,
    image,
)
from tests.records.sample import WHEN

from tsis.errors import RecordsError
from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.records.store import Store

ROOT = Path(__file__).parents[2]
every_call = pytest.mark.parametrize("call", CALLS, ids=lambda call: call.__name__)


@every_call
def test_a_call_that_fails_at_any_step_leaves_all_as_it_was(tmp_path: Path, call: Callable[[Store], None]) -> None:
    found = failing_steps(tmp_path, call, errno.ENOSPC, lasting=True)
    assert found.wrong == []
    assert found.points >= 4  # the anchor's own steps at least


@pytest.mark.slow
@every_call
@pytest.mark.parametrize("lasting", [True, False])
@pytest.mark.parametrize("reason", REASONS, ids=errno.errorcode.get)
def test_whatever_the_reason(tmp_path: Path, call: Callable[[Store], None], reason: int, lasting: bool) -> None:
    assert failing_steps(tmp_path, call, reason, lasting=lasting).wrong == []


def test_a_store_that_could_not_be_made_is_made_later(tmp_path: Path) -> None:
    found = failing_openings(tmp_path, errno.ENOSPC, lasting=True)
    assert found.wrong == []
    assert found.refused == found.points > 8


def test_a_database_that_is_full_at_any_page(tmp_path: Path) -> None:
    found = full_databases(tmp_path, CALLS[2], pages=4)
    assert found.wrong == []
    assert found.refused == found.points == 4


def test_an_anchor_that_finds_no_room_lags_until_the_next_record(tmp_path: Path) -> None:
    begin(tmp_path)
    disk = FailingDisk(errno.ENOSPC, lasting=True)
    with open_store(tmp_path, disk=disk) as store:
        disk.arm(0)
        target = store.add_target(name="kept")  # rows only: of its files there is but the anchor
        assert disk.failed
        disk.arm(None)
        assert store.target(target.number) == target
        behind = verify_store(store)
        assert behind.sound
        assert behind.unanchored == 1
        store.add_target()
        assert verify_store(store).unanchored == 0


def test_the_sentence_says_what_and_why(tmp_path: Path) -> None:
    begin(tmp_path)
    disk = FailingDisk(errno.EDQUOT, lasting=True)
    with open_store(tmp_path, disk=disk) as store:
        disk.arm(0)
        said = (
            rf"a file of \d+ bytes must be written into .*; got: {os.strerror(errno.EDQUOT)} \(what was stored before"
        )
        with pytest.raises(RecordsError, match=said):
            store.add_press(store.target(1), image(3), taken=WHEN)


@pytest.mark.system
@pytest.mark.skipif(shutil.which("unshare") is None or os.geteuid() != 0, reason="needs unshare, and root to mount")
def test_a_real_disk_that_is_full(tmp_path: Path) -> None:
    mount = f"mount -t tmpfs -o size=900k tmpfs {tmp_path}"
    inside = f"{sys.executable} -m tests.records.full_disk {tmp_path}"
    done = subprocess.run(
        ["unshare", "-m", "sh", "-c", f"{mount} && {inside}"],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )
    if "mount:" in done.stderr:
        pytest.skip(f"no mount is allowed here: {done.stderr.strip()}")
    found = json.loads(done.stdout)
    assert found["wrong"] == []
    assert (found["points"], found["refused"]) == (2, 2)
    first, second = found["acknowledged"]
    assert 0 < first < second
