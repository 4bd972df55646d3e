"""Everybody is told when the store's folder is gone from under a console, and that it is back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.console.services.instruments import ANN

from tsis.console.services.state import STORE_CHECK_EVERY_S, StoreCheck
from tsis.errors import RecordsError

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.console.services.instrument import Instrument


def test_a_store_that_was_moved_is_trouble_until_it_is_back(
    instrument: Instrument, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tsis.console.services.state.STORE_CHECK_EVERY_S", 0.0)
    instrument.start(by=ANN)
    assert instrument.state().trouble == ()
    away = (tmp_path / "store").rename(tmp_path / "away")
    (message,) = instrument.state().trouble
    assert message == (
        f"The store in '{tmp_path / 'store'}' was moved or replaced since it was opened, and nothing can be kept: "
        "put it back, or start anew."
    )
    with pytest.raises(RecordsError, match="was moved or replaced since it was opened; nothing was stored"):
        instrument.snapshot(by=ANN)
    away.rename(tmp_path / "store")
    assert instrument.state().trouble == ()
    instrument.snapshot(by=ANN)
    assert len(instrument.store.presses(instrument.store.target(1))) == 1


def test_the_disk_is_looked_at_once_a_second(instrument: Instrument, monkeypatch: pytest.MonkeyPatch) -> None:
    checks: list[float] = []
    now = [0.0]

    def moved() -> bool:
        checks.append(now[0])
        return now[0] > 2.0

    monkeypatch.setattr(instrument.store.database, "replaced", moved)
    position = StoreCheck(instrument.store, clock=lambda: now[0])
    reported = []
    for now[0] in (0.1, STORE_CHECK_EVERY_S, 1.5, 2.5, 2.6):
        reported.append(bool(position.trouble()))
    assert checks == [1.0, 2.5]
    assert reported == [False, False, False, True, True]
