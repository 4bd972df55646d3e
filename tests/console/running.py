"""A console that runs as users start it, in a process of its own, with a folder of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import parse_qs, urlsplit

from tests.waiting import HANGS_S

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningConsole:
    """Where it listens, the key to it, and where it keeps things."""

    address: str
    token: str
    folder: Path
    process: subprocess.Popen[str]

    @property
    def key(self) -> dict[str, str]:
        """The header that lets a script in."""
        return {"Authorization": f"Bearer {self.token}"}

    @property
    def entrance(self) -> str:
        """The address that people open."""
        return f"{self.address}/?token={self.token}"

    @property
    def store(self) -> Path:
        return self.folder / "records"

    @property
    def workspace(self) -> Path:
        return self.folder / "workspace"


@contextmanager
def running_console(folder: Path, *options: str, under: Sequence[str] = ()) -> Iterator[RunningConsole]:
    """Start ``tsis console`` on a free port of this machine, and end it by its process; ``under`` is what runs it."""
    command = [*under, str(Path(sys.executable).with_name("tsis")), "console", "--json", "--no-browser", "--port", "0"]
    places = ["--out", str(folder / "workspace"), "--store", str(folder / "records")]
    environment = {
        **os.environ,
        "OMP_NUM_THREADS": "1",
        "MPLCONFIGDIR": str(folder / "matplotlib"),
        "TSIS_CONSOLE_DIR": str(folder / "user"),
    }
    with (folder / "console.log").open("w") as log:
        process = subprocess.Popen(
            [*command, *places, *options], stdout=subprocess.PIPE, stderr=log, text=True, env=environment, cwd=folder
        )
    try:
        yield _reached(process, folder)
    finally:
        process.terminate()
        try:
            process.wait(HANGS_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stdout is not None:
            process.stdout.close()


def _reached(process: subprocess.Popen[str], folder: Path) -> RunningConsole:
    assert process.stdout is not None
    text = ""
    while not text.endswith("}\n"):
        line = process.stdout.readline()
        assert line, (folder / "console.log").read_text()
        text += line
    parts = urlsplit(json.loads(text)["address"])
    return RunningConsole(
        address=f"{parts.scheme}://{parts.netloc}",
        token=parse_qs(parts.query)["token"][0],
        folder=folder,
        process=process,
    )
