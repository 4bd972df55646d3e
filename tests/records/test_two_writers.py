"""Programs that write into one store at the same moment lose nothing of each other, in either database."""

from __future__ import annotations

import subprocess
import sys
from contextlib import ExitStack, contextmanager
from subprocess import PIPE
from typing import TYPE_CHECKING

import pytest

from tsis.records.store import verify_store

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.records.place import Place

pytestmark = pytest.mark.system  # starts programs


@contextmanager
def writers(place: Place, count: int, presses: int) -> Iterator[list[subprocess.Popen[str]]]:
    """So many programs at once; none is left when the block ends."""
    command = [sys.executable, "-m", "tests.records.writer", str(place.folder), place.database or "-"]
    with ExitStack() as running:
        started = []
        for seed in range(count):
            one = subprocess.Popen([*command, str(seed), str(presses)], stdout=PIPE, stderr=PIPE, text=True)
            started.append(running.enter_context(one))
            running.callback(one.kill)
        yield started


def test_four_programs_that_create_and_fill_a_store_at_once(place: Place) -> None:
    said = []
    with writers(place, 4, 50) as running:
        for writer in running:
            out, err = writer.communicate()
            assert err == ""
            said += [line.split(" ", 1) for line in out.splitlines()]
    assert [rest for what, rest in said if what == "refused"] == []
    assert sorted(rest for what, rest in said if what == "number") == ["1", "2", "3", "4"]
    acknowledged = {rest for what, rest in said if what == "press"}
    assert len(acknowledged) == 200
    with place.open(create=False) as store:
        targets = [each.target for each in store.targets()]
        assert {press.id for target in targets for press in store.presses(target)} == acknowledged
        found = verify_store(store)
    assert found.sound
    assert found.unnamed == 0


def test_programs_killed_while_they_save_lose_nothing_that_was_acknowledged(place: Place) -> None:
    place.open().close()
    acknowledged = set()
    with writers(place, 3, 100_000) as running:
        for writer in running:
            assert writer.stdout is not None
            lines = [writer.stdout.readline() for _ in range(20)]
            writer.kill()
            lines += writer.stdout.read().splitlines(keepends=True)
            whole = [line.split() for line in lines if line.endswith("\n")]  # the last may be cut short
            acknowledged |= {rest for what, rest in whole if what == "press"}
    assert len(acknowledged) >= 57
    with place.open(create=False) as store:
        targets = [each.target for each in store.targets()]
        stored = {press.id for target in targets for press in store.presses(target)}
        assert acknowledged <= stored
        assert len(stored - acknowledged) <= 3  # each may have been killed before it could say so
        assert verify_store(store).sound
        store.add_target()
        assert verify_store(store).sound
