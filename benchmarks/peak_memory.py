"""The most memory that a demo, an examination of its frames and a console hold at once.

    python -m benchmarks.peak_memory [--markdown]

Each is the program as users start it; the number is the high-water mark of its resident memory that Linux counts, of
the largest of its processes. The console's server is asked for its state and for the first page, then ended. The exit
code is 1 where a goal is missed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

from benchmarks.tables import show
from tests.console.running import running_console

GOALS_MB = {"demo": 600.0, "examine": 600.0, "console": 700.0}
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


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    frames = [f"demo/target-{force}N.png" for force in FORCES]
    references = [text for force in FORCES for text in ("--reference-press", f"demo/reference-{force}N.png")]
    known = ["--calibration", "demo/calibration.json", "--scale-mm", "0.0336,0.0392"]
    forces = [text for force in FORCES for text in ("--force-n", force)]
    commands = {"demo": ["demo", "--out", "demo"], "examine": ["examine", *frames, *references, *known, *forces]}
    found = {}
    with tempfile.TemporaryDirectory(prefix="tsis-memory-") as name:
        folder = Path(name)
        for what in GOALS_MB:
            own = commands.get(what)
            found[what] = peak_of_console(folder) if own is None else peak_mb([TSIS, *own], folder)
            print(f"{what}: {found[what]:.0f} MB", file=sys.stderr, flush=True)
    rows = [(what, f"{value:.0f} MB", f"{GOALS_MB[what]:.0f} MB") for what, value in found.items()]
    show("Peak memory", ("program", "most", "goal"), rows, markdown=options.markdown)
    return int(any(value > GOALS_MB[what] for what, value in found.items()))


if __name__ == "__main__":
    sys.exit(main())
