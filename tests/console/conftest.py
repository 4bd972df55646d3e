from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect
from tests.console.browser import PATIENCE_MS, chromium
from tests.console.running import RunningConsole, running_console
from tests.waiting import HANGS_S

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser

expect.set_options(timeout=PATIENCE_MS)


@pytest.fixture(scope="session", autouse=True)
def _busy_machine() -> Iterator[None]:
    """Wait for a camera of a test as long as a busy machine needs; tests unplug it to lose it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tsis.instrument.acquisition.LOST_AFTER_S", HANGS_S)
        patch.setattr("tsis.console.services.camera.FRESH_S", HANGS_S)
        patch.setattr("tsis.calibration.session.TIMEOUT_S", HANGS_S)
        yield


@pytest.fixture(scope="module")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningConsole]:
    """One running console for the tests of a file."""
    with running_console(tmp_path_factory.mktemp("console")) as running:
        yield running


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """One browser for the tests of a file; each opens a context of its own."""
    with chromium() as running:
        yield running
