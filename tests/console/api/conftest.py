from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.console.api.script import Script
from tests.console.running import RunningConsole, running_console

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(scope="module")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningConsole]:
    """One running console for the tests of a file."""
    with running_console(tmp_path_factory.mktemp("console")) as running:
        yield running


@pytest.fixture
def script(console: RunningConsole) -> Iterator[Script]:
    """A script that holds no camera yet."""
    script = Script(console)
    yield script
    script.close()


@pytest.fixture
def holder(console: RunningConsole) -> Iterator[Script]:
    """A script that holds the camera, which runs."""
    script = Script(console)
    script.ready()
    yield script
    script.client.delete("/control")
    script.close()
