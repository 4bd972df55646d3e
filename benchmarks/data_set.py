"""A benchmark data set for any program: presses, frames and truths of several worlds, with a scorer.

    python -m benchmarks.data_set make FOLDER [--world NAME ...] [--cases 60] [--blanks 30] [--seed 30]
    python -m benchmarks.data_set answer FOLDER ANSWERS.csv [--dummy]
    python -m benchmarks.data_set score FOLDER ANSWERS.csv

``make`` writes the frames, what a laboratory would know, the truths in a file of their own, a data sheet, metadata and
hashes; the same seed gives the same bytes, and an interrupted run goes on where it was. ``answer`` writes the answers
of this project's estimate, or of a dummy that knows the prior alone. ``score`` checks the hashes first. Worlds are
those of `benchmarks.worlds` whose light the calibration knows.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import io
import json
import math
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.data_set_score import COLUMNS, HEADS, NUMBERS, read_rows, scores
from benchmarks.data_set_sheet import codemeta, datacite, sheet
from benchmarks.harness import show
from benchmarks.press_bank import believed
from benchmarks.simulated_presses import DEFAULT, PROTOCOLS, Protocol
from benchmarks.worlds import WORLDS, simulate_world

import tsis
from tsis.calibration import load_calibration
from tsis.calibration.file import ProbeCalibration, calibration_bytes
from tsis.cli.progress import progress_bar
from tsis.errors import FileInputError, MechanicsError, TsisError
from tsis.files.atomic import remove_unfinished, write_durably
from tsis.inclusion import InclusionPrior, estimate
from tsis.inclusion.prior import PARAMETERS
from tsis.instrument.image_files import png_bytes, read_image

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from benchmarks.simulated_presses import SimulatedCase

    from tsis.model.image import TactileImage

OFFERED = tuple(name for name, world in WORLDS.items() if not world.lamps)
USUAL = ("as-model", "prior", "finite")
SITES = ("target", "reference")
PRESSES = ("case", "site", "force_n", "file", "mm_per_pixel_x", "mm_per_pixel_y", "strain")
TRUTH = ("case", "world", *PARAMETERS, "tissue_young_kpa", "thickness_mm")
SUMS = "SHA256SUMS"


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """All that decides the bytes of a data set, but for the program."""

    worlds: tuple[str, ...]
    cases: int  # with an inclusion, in each world
    blanks: int  # without, in each world
    seed: int
    protocol: str = DEFAULT

    @property
    def command(self) -> str:
        """What makes it."""
        worlds = " ".join(f"--world {name}" for name in self.worlds)
        numbers = f"--cases {self.cases} --blanks {self.blanks} --seed {self.seed} --protocol {self.protocol}"
        return f"python -m benchmarks.data_set make FOLDER {worlds} {numbers}"

    @property
    def pressed(self) -> Protocol:
        """What is pressed how."""
        return PROTOCOLS[self.protocol]

    def drawn(self) -> list[tuple[str, bool, int]]:
        """World, whether blank, and index of each case, shuffled so that numbers tell nothing."""
        every = [
            (world, blank, index)
            for world in self.worlds
            for blank, count in ((False, self.cases), (True, self.blanks))
            for index in range(count)
        ]
        order = np.random.default_rng(self.seed).permutation(len(every))
        return [every[k] for k in order]


def simulated(recipe: Recipe, world: str, blank: bool, index: int) -> SimulatedCase:
    """One case; where the drawn tissue has no solution, that of the next seed in its place."""
    for seed in range(recipe.seed, recipe.seed + 1000, 100):
        try:
            return simulate_world(
                WORLDS[world], recipe.pressed, InclusionPrior(), seed=seed, index=2 * index + blank, blank=blank
            )
        except MechanicsError:
            continue
    raise MechanicsError(f"no press of case {index} in {world} could be solved")


def strain_of(recipe: Recipe, world: str) -> str:
    """Mechanics of a world's presses."""
    return "finite" if "finite" in (WORLDS[world].strain, recipe.pressed.strain) else "small"


def write_case(folder: Path, recipe: Recipe, number: int) -> tuple[list[tuple[object, ...]], tuple[object, ...]]:
    """Write the frames of one case, or read what is there; rows of ``presses.csv`` and of ``truth.csv``."""
    world, blank, index = recipe.drawn()[number]
    name = f"{number:04d}"
    note = folder / "cases" / f"{name}.json"
    if not note.exists():
        case = simulated(recipe, world, blank, index)
        presses = []
        for site, frames in zip(SITES, (case.frames, case.references), strict=True):
            for frame in frames:
                assert frame.mm_per_pixel is not None  # a virtual probe knows its scale
                file = f"frames/{name}-{site}-{frame.force_n:g}N.png"
                write_durably(folder / file, png_bytes(frame))
                scale = (f"{mm:.6g}" for mm in frame.mm_per_pixel)
                presses.append((name, site, f"{frame.force_n:g}", file, *scale, strain_of(recipe, world)))
        hidden = case.phantom.inclusion
        sizes = ["" if hidden is None else f"{getattr(hidden, each):.6g}" for each in PARAMETERS]
        tissue = (f"{case.phantom.young_kpa:.6g}", f"{case.phantom.thickness_mm:.6g}")
        truth = (name, world, *sizes, *tissue)
        write_durably(note, json.dumps({"presses": presses, "truth": truth}).encode())
    found = json.loads(note.read_text())
    return [tuple(press) for press in found["presses"]], tuple(found["truth"])


def make(folder: Path, recipe: Recipe, *, workers: int = 1, progress: Callable[[int, int], None] | None = None) -> str:
    """Write the data set, and return the hash of its list of hashes.

    `FileInputError` when the folder holds another one.
    """
    decided = (json.dumps(asdict(recipe) | {"tsis": tsis.__version__}) + "\n").encode()
    for inside in ("frames", "cases"):
        (folder / inside).mkdir(parents=True, exist_ok=True)
    begun = folder / "cases" / "recipe.json"
    if begun.exists() and begun.read_bytes() != decided:
        raise FileInputError(f"{folder} holds a data set of another recipe; give another folder")
    write_durably(begun, decided)
    total = len(recipe.drawn())
    rows = []
    for done, row in enumerate(_each(folder, recipe, total, workers), start=1):
        rows.append(row)
        if progress is not None:
            progress(done, total)
    about = {
        "command": recipe.command,
        "cases": total,
        "blanks": len(recipe.worlds) * recipe.blanks,
        "frames": len(rows[0][0]),
        "probe": recipe.pressed.probe_name,
        "worlds": ", ".join(recipe.worlds),
        "columns": ",".join(COLUMNS),
    }
    known = believed(recipe.pressed)
    files = {
        "presses.csv": _table(PRESSES, [press for presses, _ in rows for press in presses]),
        "truth.csv": _table(TRUTH, [truth for _, truth in rows]),
        "calibration.json": calibration_bytes(
            ProbeCalibration(name=known.name, probe=recipe.pressed.probe_name, response=known)
        ),
        "prior.json": (json.dumps(asdict(InclusionPrior()), indent=2) + "\n").encode(),
        "README.md": sheet(about).encode(),
        "datacite.json": datacite(about),
        "codemeta.json": codemeta(about),
    }
    for file, content in files.items():
        write_durably(folder / file, content)
    remove_unfinished(folder)
    sums = "".join(
        f"{hashlib.sha256((folder / file).read_bytes()).hexdigest()}  {file}\n" for file in _published(folder)
    )
    write_durably(folder / SUMS, sums.encode())
    return hashlib.sha256(sums.encode()).hexdigest()


def _each(folder: Path, recipe: Recipe, total: int, workers: int) -> Iterable[Any]:
    if workers == 1:
        yield from (write_case(folder, recipe, number) for number in range(total))
        return
    with ProcessPoolExecutor(max_workers=workers) as pool:
        yield from pool.map(write_case, [folder] * total, [recipe] * total, range(total))


def _published(folder: Path) -> list[str]:
    every = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return sorted(file for file in every if file != SUMS and not file.startswith("cases/"))


def _table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([heads, *rows])
    return text.getvalue().encode()


def require_unchanged(folder: Path) -> None:
    """`FileInputError` where a file is missing or is not what its hash says."""
    for line in (folder / SUMS).read_text().splitlines():
        sha256, _, file = line.partition("  ")
        path = folder / file
        if not path.is_file() or hashlib.sha256(path.read_bytes()).hexdigest() != sha256:
            raise FileInputError(f"{file} must be as it was published; it is missing or was changed")


@dataclass(frozen=True, slots=True, kw_only=True)
class Examined:
    """What a program may see of one case."""

    strain: str
    frames: dict[str, list[TactileImage]]  # by site


def presses_of(folder: Path) -> dict[str, Examined]:
    """Cases as any program would read them."""
    found: dict[str, Examined] = {}
    with (folder / "presses.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            scale = (float(row["mm_per_pixel_x"]), float(row["mm_per_pixel_y"]))
            frame = read_image(folder / row["file"], mm_per_pixel=scale, force_n=float(row["force_n"]))
            case = found.setdefault(row["case"], Examined(strain=row["strain"], frames={site: [] for site in SITES}))
            case.frames[row["site"]].append(frame)
    return found


def own_answer(folder: Path, case: Examined) -> dict[str, float]:
    """What this project's estimate says: no number that it withholds."""
    known = load_calibration(folder / "calibration.json")
    try:
        result = estimate(
            case.frames["target"],
            probe=tsis.load_probe(known.calibration.probe),
            calibration=known.response,
            reference=case.frames["reference"],
            strain=case.strain,
        )
    except TsisError:
        return {}
    answer = {} if result.presence is None else {"presence": result.presence}
    if result.trusted:
        for name in PARAMETERS:
            answer[f"{name}_low"], answer[f"{name}_high"] = result.interval(0.9)[name]
            if f"{name}_not_identified" not in result.flags:
                answer[name] = result.mean[name]
    return answer


def dummy_answer() -> dict[str, float]:
    """The middle and the central 90 % of the prior, and even odds."""
    prior = InclusionPrior()
    answer = {"presence": prior.presence}
    for name, low, high in zip(PARAMETERS, prior.low, prior.high, strict=True):
        margin = 0.05 * (high - low)
        answer |= {name: (low + high) / 2, f"{name}_low": low + margin, f"{name}_high": high - margin}
    return answer


def answer_bytes(answers: dict[str, dict[str, float]]) -> bytes:
    """The file of answers."""
    rows = [(case, *(_cell(answer.get(name)) for name in NUMBERS)) for case, answer in answers.items()]
    return _table(COLUMNS, rows)


def _cell(value: float | None) -> str:
    return "" if value is None or math.isnan(value) else f"{value:.6g}"


def main() -> int:
    """Make, answer or score."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(dest="verb", required=True)
    maker = verbs.add_parser("make")
    maker.add_argument("folder", type=Path)
    maker.add_argument("--world", choices=OFFERED, action="append", help=f"by default {', '.join(USUAL)}")
    maker.add_argument("--cases", type=int, default=60, help="with an inclusion, in each world")
    maker.add_argument("--blanks", type=int, default=30, help="without one, in each world")
    maker.add_argument("--seed", type=int, default=30)
    maker.add_argument("--protocol", choices=PROTOCOLS, default=DEFAULT)
    maker.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    for verb in ("answer", "score"):
        other = verbs.add_parser(verb)
        other.add_argument("folder", type=Path)
        other.add_argument("answers", type=Path)
        if verb == "answer":
            other.add_argument("--dummy", action="store_true", help="the prior alone")
        else:
            other.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    try:
        return {"make": _make, "answer": _answer, "score": _score}[options.verb](options)
    except (FileInputError, OSError) as error:
        print(f"Error: {error}", file=sys.stderr)
        return 2


def _make(options: argparse.Namespace) -> int:
    recipe = Recipe(
        worlds=tuple(options.world or USUAL),
        cases=options.cases,
        blanks=options.blanks,
        seed=options.seed,
        protocol=options.protocol,
    )
    with progress_bar("pressing") as advance:
        sha256 = make(options.folder, recipe, workers=options.workers, progress=advance)
    size = sum((options.folder / file).stat().st_size for file in _published(options.folder))
    print(f"{len(recipe.drawn())} cases, {size / 1e6:.0f} MB; SHA-256 of {SUMS}: {sha256}")
    return 0


def _answer(options: argparse.Namespace) -> int:
    require_unchanged(options.folder)
    every = presses_of(options.folder)
    with progress_bar("estimating") as advance:
        answers = {}
        for done, (case, examined) in enumerate(every.items(), start=1):
            answers[case] = dummy_answer() if options.dummy else own_answer(options.folder, examined)
            advance(done, len(every))
    write_durably(options.answers, answer_bytes(answers))
    return 0


def _score(options: argparse.Namespace) -> int:
    require_unchanged(options.folder)
    rows = scores(read_rows(options.folder / "truth.csv", PARAMETERS), read_rows(options.answers, NUMBERS))
    show(f"{options.answers.name} on {options.folder.name}", HEADS, rows, markdown=options.markdown)
    return 0


if __name__ == "__main__":
    sys.exit(main())
