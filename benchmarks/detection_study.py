"""How well are inclusions found? A large virtual study, half of its targets blank, every nuisance drawn.

    python -m benchmarks.detection_study --targets 2000 --solid 60 --seed 1 --workers 2 --out /tmp/study

`benchmarks.searched_presses` says how targets are drawn and pressed: sizes of 2 to 15 mm, depths of 4 to 12 mm, moduli
of 40 to 120 kPa, up to 5 mm beside the axis, in tissue whose lumps differ by up to 10 per cent (`--uneven`). The first
``--solid`` targets are pressed a second time, by a flat probe, in both ways that there are: in three dimensions, and by
changes that are moved; that needs NGSolve and some 20 s a target. Every finished target is kept, so a run that was cut
off goes on where it stopped; targets of other settings or another code are never mixed in. Ends with 1 when the area
under the curve is below 0.95 for inclusions of at least 5 mm at most 8 mm deep.
"""

from __future__ import annotations

import hashlib
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.detection_figure import write_results
from benchmarks.detection_report import report
from benchmarks.harness import Bench, Choice, append_line, read_lines
from benchmarks.searched_presses import COVERING_N, PRIOR, UNEVEN_SD, draw, examine
from benchmarks.simulated_presses import PROTOCOLS
from benchmarks.uneven_tissue import lump_changes

import tsis
from tsis.cli.progress import progress_bar
from tsis.errors import TsisError
from tsis.files.cache import cache_folder, content_key
from tsis.inclusion import estimate
from tsis.study.classifier import target_evidence

if TYPE_CHECKING:
    from collections.abc import Callable


DRAWS = 24  # samples of a posterior that are kept, for classes
DECIDING = ("model", "optics", "mechanics", "imaging", "inclusion", "virtual")  # rooms whose code decides a target
SOLID_PROTOCOL = "flat"
SITE_SD = 0.03  # as calibrations state


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One target by one way of pressing."""

    protocol: str
    seed: int
    index: int
    uneven_most: float
    way: str  # "moved" or "solid"

    @property
    def name(self) -> str:
        """By which its line is known."""
        return f"{self.protocol} {self.way} {self.index}"


def judge(task: Task) -> dict[str, Any]:
    """Draw, press, estimate; a line with the truth beside what was said."""
    protocol = PROTOCOLS[task.protocol]
    target = draw(task.seed, task.index, site_sd=SITE_SD, uneven_most=task.uneven_most)
    phantom, drawn = target.site.phantom, target.drawn
    line: dict[str, Any] = {
        "name": task.name,
        "protocol": task.protocol,
        "way": task.way,
        "index": task.index,
        "present": target.inclusion is not None,
        "truth": [drawn.diameter_mm, drawn.depth_mm, drawn.young_kpa],
        "offset_mm": float(np.hypot(*drawn.offset_mm)),
        "uneven_sd": target.uneven_sd,
        "lumps": len(target.site.lumps),
        "tissue_kpa": phantom.young_kpa,
        "thickness_mm": phantom.thickness_mm,
        "poisson": phantom.poisson,
    }
    began = time.perf_counter()
    try:
        case, probe = examine(target, protocol, seed=task.seed, solid=task.way == "solid")
        pressed = time.perf_counter()
        found = estimate(
            case.frames,
            probe=protocol.probe,
            calibration=case.calibration,
            reference=case.references,
            prior=PRIOR,
            strain=protocol.strain,
        )
    except TsisError as error:
        return line | {"refused": str(error)}
    result = target_evidence(found, draws=DRAWS)
    seconds = {"press_s": round(pressed - began, 2), "estimate_s": round(time.perf_counter() - pressed, 2)}
    return line | probe | seconds | {
        "presence": found.presence,
        "evidence": found.log_bayes_factor,
        "mean": [found.untrusted.mean[name] for name in tsis.inclusion.prior.PARAMETERS],
        "sd": [found.untrusted.sd[name] for name in tsis.inclusion.prior.PARAMETERS],
        "samples": np.round(result.samples, 3).tolist(),
        "trusted": found.trusted,
        "flags": list(found.flags),
    }  # fmt: skip


def run(
    tasks: list[Task],
    *,
    out: Path | None,
    workers: int,
    progress: Callable[[int, int], None] | None = None,
) -> list[dict[str, Any]]:
    """Lines of all tasks, those that ``out`` holds already and the rest."""
    found = read_lines(out, "name")
    missing = [task for task in tasks if task.name not in found]
    for protocol in sorted({task.protocol for task in missing}):  # before workers share what is kept of them
        lump_changes(PROTOCOLS[protocol].probe, COVERING_N)
    if missing:
        found[missing[0].name] = judge(missing[0])
        append_line(out, found[missing[0].name])
    with ProcessPoolExecutor(max_workers=workers) as pool:
        for future in as_completed([pool.submit(judge, task) for task in missing[1:]]):
            line = future.result()
            append_line(out, line)
            found[line["name"]] = line
            if progress is not None:
                progress(len(found), len(tasks))
    return [found[task.name] for task in tasks]


def code() -> str:
    """Hash of the sources that decide what a target's line says."""
    root, here = Path(tsis.__file__).parent, Path(__file__).parent
    sources = [path for room in DECIDING for path in sorted((root / room).rglob("*.py"))]
    sources += [here / name for name in ("searched_presses.py", "uneven_tissue.py", "simulated_presses.py")]
    digest = hashlib.sha256()
    for path in sources:
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def tasks_of(options: Any) -> list[Task]:
    """The study, and the targets that are pressed in both ways."""
    shared = {"seed": options.seed, "uneven_most": options.uneven}
    study = [Task(protocol=options.protocol, way="moved", index=index, **shared) for index in range(options.targets)]
    both = [
        Task(protocol=SOLID_PROTOCOL, way=way, index=index, **shared)
        for index in range(options.solid)
        for way in ("moved", "solid")
    ]
    return both + study


def main() -> int:
    """Run what is missing, print the tables; 1 when the wanted area is missed."""
    bench = Bench(
        __doc__,
        protocol=Choice(("domed", "flat", "flat-alone"), "domed"),
        targets=2000,
        solid=0,
        uneven=UNEVEN_SD,
        seed=1,
        workers=os.cpu_count(),
        bank=cache_folder() / "detection",
    )
    decided_by = {"seed": bench.seed, "uneven": bench.uneven, "tsis": tsis.__version__, "code": code()}
    kept_in = bench.bank / f"{content_key(decided_by)}.jsonl"
    with progress_bar("searching") as progress:
        lines = run(tasks_of(bench.options), out=kept_in, workers=bench.workers, progress=progress)
    answer = report(lines, study=bench.protocol, table=bench.table)
    if bench.options.out is not None:
        document = answer.document | {"seed": bench.seed, "uneven": bench.uneven}
        write_results(bench.options.out, answer, document)
    return bench.end(answer.goals)


if __name__ == "__main__":
    sys.exit(main())
