"""The most memory that a demo, an examination of its frames and a console hold at once, as Linux counts it."""

from __future__ import annotations

import os
import subprocess
import sys
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from tests.console.running import running_console

MOST_MB = {"demo": 600.0, "examine": 600.0, "console": 700.0}
TSIS = str(Path(sys.executable).with_name("tsis"))
FORCES = ("0.5", "1")


def peak_mb(command: list[str], folder: Path) -> float:
    """Of a program that ends by itself."""
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 3):  # 3: an estimate that is not trusted
        raise RuntimeError(f"{' '.join(command)} must end well; it ended with {process.returncode}")
    return usage.ru_maxrss * 1024 / 1e6


def peak_of_console(folder: Path) -> float:
    """Of a server that has shown its first page."""
    with running_console(folder) as console:
        place = urlsplit(console.address)
        for address in ("/api/v1/state", "/"):
            connection = HTTPConnection(place.hostname or "", place.port, timeout=600)
            connection.request("GET", address, headers=console.key)
            connection.getresponse().read()
            connection.close()
        lines = Path(f"/proc/{console.process.pid}/status").read_text().splitlines()
    (line,) = (line for line in lines if line.startswith("VmHWM"))
    return int(line.split()[1]) * 1024 / 1e6


@pytest.mark.slow
@pytest.mark.system
@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured as Linux tells it")
def test_a_demo_an_examination_and_a_console_stay_within_their_memory(tmp_path: Path) -> None:
    frames = [f"demo/target-{force}N.png" for force in FORCES]
    references = [text for force in FORCES for text in ("--reference-press", f"demo/reference-{force}N.png")]
    known = ["--calibration", "demo/calibration.json", "--scale-mm", "0.0336,0.0392"]
    forces = [text for force in FORCES for text in ("--force-n", force)]
    assert peak_mb([TSIS, "demo", "--out", "demo"], tmp_path) < MOST_MB["demo"]
    assert peak_mb([TSIS, "examine", *frames, *references, *known, *forces], tmp_path) < MOST_MB["examine"]
    assert peak_of_console(tmp_path) < MOST_MB["console"]
