from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect
from tests.console.browser import PATIENCE_MS, chromium
from tests.console.running import RunningConsole, running_console
from tests.console.tls import PASSWORD, TlsConsole, made_certificate
from tests.waiting import HANGS_S

from tsis.console.auth import Logins

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

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


@pytest.fixture(scope="session")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A certificate and its key."""
    return made_certificate(tmp_path_factory.mktemp("certificate"))


@pytest.fixture(scope="module")
def tls(tmp_path_factory: pytest.TempPathFactory, certificate: tuple[Path, Path]) -> Iterator[TlsConsole]:
    """One running console with TLS and a login for the tests of a file."""
    folder = tmp_path_factory.mktemp("tls")
    logins = Logins(folder / "user")
    logins.add("anna", PASSWORD)
    chain, key = certificate
    with running_console(
        folder, "--certificate", str(chain), "--key", str(key), "--allow-host", "lab.example"
    ) as running:
        yield TlsConsole(console=running, certificate=chain, logins=logins)
