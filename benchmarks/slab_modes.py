"""How fast, how complete and how exact guided modes are found, beside other programs, in one run.

    python -m benchmarks.slab_modes [--peer-python PATH]

One thread. PyMoosh and tidy3d run in an environment of their own, named by its Python: ``python -m venv peers``,
``peers/bin/pip install PyMoosh tidy3d``; what is not there is named and left out. Errors are against 60-digit values
where the folder with them lies beside the repository. Compiling, once on a machine, is timed apart.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.harness import Bench, duration
from benchmarks.mechanics import least
from rich.console import Console

from tsis.optics import guided_modes

if TYPE_CHECKING:
    from collections.abc import Iterator

PEER = Path(__file__).parent / "peers" / "slab_modes_peer.py"
ORACLE = Path(__file__).resolve().parents[2] / "shared" / "data" / "oracle" / "slab_modes.json"
PRINTED, REAL = [1.16, 1.15, 1.14, 1.13], [1.41, 1.405, 1.40, 1.515]
CASES: dict[str, dict[str, Any]] = {
    "10 µm, printed indices": {"index": PRINTED, "thickness_um": [2.0, 3.0, 4.0, 1.0], "oracle": "thin dissertation"},
    "10 µm, PDMS on glass": {"index": REAL, "thickness_um": [2.0, 3.0, 4.0, 1.0], "oracle": "thin PDMS on glass"},
    "coupled wells": {"index": [1.5, 1.0, 1.5], "thickness_um": [2.0, 1.0, 2.0], "oracle": "coupled wells"},
    "1 mm, printed indices": {
        "index": PRINTED,
        "thickness_um": [200.0, 300.0, 400.0, 100.0],
        "oracle": "millimetre guide",
    },
    "11 mm, PDMS on glass": {"index": REAL, "thickness_um": [2200.0, 3300.0, 4400.0, 1100.0], "oracle": None},
}
PEER_LIMIT = 100  # modes: with more the other programs take hours or more memory than there is


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of the table."""

    case: str
    program: str
    found: str
    error: str
    seconds: float
    ratio: str


def rows(peer_python: str) -> Iterator[Row]:
    """Every case in both polarizations by every program."""
    missing: set[str] = set()
    for name, case in CASES.items():
        for polarization in ("TE", "TM"):
            stack = {"index": case["index"], "thickness_um": case["thickness_um"], "polarization": polarization}
            own = guided_modes(**stack, wavelength_um=0.55).n_eff
            seconds = least(lambda stack=stack: guided_modes(**stack, wavelength_um=0.55))  # type: ignore[misc]
            count, exact = expected(case["oracle"], polarization)
            count = count or len(own)
            label = f"{name}, {polarization}"
            yield Row(
                case=label,
                program="tsis",
                found=f"{len(own)} of {count}",
                error=error(own, exact, numbered=True),
                seconds=seconds,
                ratio="1",
            )
            for program in ("PyMoosh", "tidy3d"):
                if count > PEER_LIMIT or program in missing:
                    continue
                other = by_peer(peer_python, program, {**stack, "count": count})
                if other is None:
                    missing.add(program)
                    continue
                values = np.array(other["n_eff"])
                yield Row(
                    case=label,
                    program=f"{program} {other['version']}",
                    found=f"{len(values)} of {count}",
                    error=error(values, exact, numbered=False),
                    seconds=other["seconds"],
                    ratio=f"{other['seconds'] / seconds:,.0f}",
                )


def expected(oracle: str | None, polarization: str) -> tuple[int | None, dict[int, float]]:
    """Count and 60-digit values by number, where they are known."""
    if oracle is None or not ORACLE.is_file():
        return None, {}
    (case,) = (case for case in json.loads(ORACLE.read_text()) if case["name"] == oracle)
    modes = case["modes"][polarization]
    return modes["count"], {int(number): value for number, value in modes["n_eff"].items()}


def error(found: np.ndarray[Any, Any], exact: dict[int, float], *, numbered: bool) -> str:
    """Largest error: of modes by their number, or of each by the nearest exact value where some may be missing."""
    if not exact or not len(found):
        return "-"
    values = np.array(list(exact.values()))
    if numbered:
        return f"{np.abs(found[list(exact)] - values).max():.1e}"
    return f"{np.abs(found[:, np.newaxis] - values).min(axis=1).max():.1e}"


def by_peer(python: str, program: str, stack: dict[str, Any]) -> dict[str, Any] | None:
    """What another program finds; None, and a word about it, where it does not run."""
    given = {**stack, "wavelength_um": 0.55, "index_below": 1.0, "index_above": 1.0}
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [python, str(PEER), program],
        input=json.dumps(given),
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    if done.returncode:
        last = done.stderr.strip().splitlines()[-1:]
        Console(stderr=True).print(f"{program} does not run and is left out: {' '.join(last)}", markup=False)
        return None
    answer: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return answer


def main() -> int:
    """Measure and print."""
    bench = Bench(__doc__, peer_python=sys.executable)
    start = time.perf_counter()
    guided_modes([1.5], [1.0], wavelength_um=0.55)
    first = time.perf_counter() - start
    measured = list(rows(bench.peer_python))
    headings = ("case", "program", "modes found", "largest error", "time", "times ours")
    cells = [(row.case, row.program, row.found, row.error, duration(row.seconds), row.ratio) for row in measured]
    bench.table("Guided modes", headings, cells)
    print(f"first call, compiled or read from disk: {duration(first)}")
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
