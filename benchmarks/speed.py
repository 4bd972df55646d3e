"""One table of the hot paths, each beside its peers in the same run, in turns.

    python -m benchmarks.speed [--only NAME] [--turns 5] [--peer-python PATH] [--folder FOLDER]

Linear algebra and OpenCV on one thread; rays on all cores. A ratio is the peer's time over ours: median of the turns,
and its range. Below 1 the peer is faster. A peer that is not installed is a row that says so: ``pip install pycpd
probreg mitsuba PyMoosh`` brings most of them, the extra fem3d NGSolve. The live view is measured by
`benchmarks.console`.
"""

from __future__ import annotations

import io
import itertools
import json
import os
import sqlite3
import subprocess
import sys
import tempfile
from contextlib import closing
from functools import partial
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING, Any, Literal

import cv2
import numpy as np
from benchmarks.harness import Bench, Contest, Place, Several, Side, duration, in_turns, missing, timed, version
from benchmarks.matching.__main__ import speed_trial
from benchmarks.matching.methods import BenchmarkMethod
from benchmarks.matching.trials import matching_error
from benchmarks.mechanics import LUMP, MESHES, PROBE, RADIUS, SPHERE, apart, change_of_press, slab_kernel, solved
from benchmarks.peers.mitsuba_cylinder import VARIANTS, paths_per_second
from benchmarks.rays import CLEAR
from benchmarks.store_speed import BEGUN, frame, kept_plainly, plain_database
from matplotlib.figure import Figure
from PIL import Image
from rich.console import Console
from rich.progress import Progress
from tests.records.sample import sample_record
from threadpoolctl import threadpool_limits

import tsis
from tsis.imaging.rendering import render, render_reference
from tsis.imaging.sensor import Sensor, expose
from tsis.inclusion import InclusionPrior
from tsis.inclusion import estimate as estimate_inclusion
from tsis.inclusion.posterior.exploration import explore_inclusion
from tsis.inclusion.reading import press_tables, read_frames
from tsis.instrument.image_files import read_image
from tsis.mechanics import press
from tsis.model.calibration import LightMap
from tsis.optics import guided_modes
from tsis.optics.propagation import Dent, propagate, thin_guide
from tsis.optics.rays.tracing import trace_rays
from tsis.present.page import PAPER_DPI
from tsis.present.records import page_bytes
from tsis.present.target import target_page
from tsis.records.store import open_store
from tsis.virtual.probe import VirtualProbe, nominal_calibration

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from benchmarks.harness import Row
    from benchmarks.matching.distort import Trial
    from numpy.typing import NDArray

    from tsis.inclusion.posterior.likelihood import InclusionLikelihood
    from tsis.model.image import TactileImage

PRINTED, REAL = [1.16, 1.15, 1.14, 1.13], [1.41, 1.405, 1.40, 1.515]
GUIDES: dict[str, dict[str, Any]] = {
    "10 µm, printed indices": {"index": PRINTED, "thickness_um": [2.0, 3.0, 4.0, 1.0]},
    "10 µm, PDMS on glass": {"index": REAL, "thickness_um": [2.0, 3.0, 4.0, 1.0]},
    "coupled wells": {"index": [1.5, 1.0, 1.5], "thickness_um": [2.0, 1.0, 2.0]},
}
PYMOOSH = Path(__file__).parent / "peers" / "slab_modes_peer.py"
RAYS, WAVES = 1e6, 12
POINTS = (105, 1000)
DENSE = (60, 60, 12)  # points of the plain grid along diameter, depth and modulus
AT_ONCE = 2160  # of them, so that their derivatives fit into memory
READ = ("png", "tif")
SENSOR = Sensor(field_angle_deg=15.0)
HEADS = ("path", "tsis", "peer", "its time", "peer over tsis", "answers")


def modes(place: Place) -> Iterator[Contest]:
    """All guided modes of thin guides, TE, beside PyMoosh."""
    for name, guide in GUIDES.items():
        count = len(guided_modes(**guide, wavelength_um=0.55).n_eff)
        task = {**guide, "count": count, "wavelength_um": 0.55, "index_below": 1.0, "index_above": 1.0}
        found = _by_pymoosh(place, task)
        peer = Side(
            program=f"PyMoosh {found.get('version')}",
            seconds=partial(_pymoosh_seconds, place, task),
            note=f"the other found {len(found.get('n_eff', ()))}",
        )
        yield Contest(
            task=f"guided modes of {name}, TE",
            own=Side(
                program="tsis",
                seconds=timed(partial(guided_modes, **guide, wavelength_um=0.55)),
                note=f"{count} modes",
            ),
            peers=(peer,) if found else (),
            absent=() if found else (("PyMoosh", "not installed, or does not run on this machine"),),
        )


def _by_pymoosh(place: Place, task: dict[str, Any]) -> dict[str, Any]:
    """What PyMoosh finds, in an environment of its own; nothing where it does not run."""
    command, one = [place.peer_python, str(PYMOOSH)], {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        command, input=json.dumps(task), capture_output=True, text=True, check=False, env={**os.environ, **one}
    )
    answer: dict[str, Any] = {} if done.returncode else json.loads(done.stdout.strip().splitlines()[-1])
    return answer


def _pymoosh_seconds(place: Place, task: dict[str, Any]) -> float:
    return float(_by_pymoosh(place, task)["seconds"])


def waves(_place: Place) -> Iterator[Contest]:
    """Beam propagation beside the frequency domain, whose march knows the modes of the flat guide already."""
    guide, dent = thin_guide("dissertation"), Dent(depth_um=4.0)

    def guided(method: Literal["bpm", "fdfd"]) -> float:
        return float(abs(propagate(guide, dent, method=method, modes=WAVES).powers.guided.mean()))

    off = abs(guided("bpm") - guided("fdfd"))
    yield Contest(
        task=f"waves under a dent of 4 µm, {WAVES} modes",
        own=Side(
            program="tsis",
            seconds=timed(lambda: propagate(guide, dent, modes=WAVES)),
            note=f"guided power {off:.4f} apart",
        ),
        peers=(
            Side(
                program=f"frequency domain, SciPy {version('scipy')}", seconds=timed(lambda: guided("fdfd"), once=True)
            ),
        ),
    )


def rays(place: Place) -> Iterator[Contest]:
    """A clear cylinder, all cores."""
    peers, absent = [], []
    for variant in VARIANTS:
        if version("mitsuba") is None or paths_per_second(variant, 1e5) is None:
            absent.append((f"Mitsuba, {variant}", "mitsuba is not installed, or does not run on this machine"))
            continue
        program, note = f"Mitsuba {version('mitsuba')}, {variant}", "the other in single precision, without a tally"
        peers.append(Side(program=program, seconds=_paths(variant), note=note))
    yield Contest(
        task=f"{RAYS / 1e6:g} million rays through a clear cylinder, {place.cores} cores",
        own=Side(program="tsis", seconds=timed(lambda: trace_rays(CLEAR, None, rays=RAYS, threads=place.cores))),
        peers=tuple(peers),
        absent=tuple(absent),
    )


def _paths(variant: str) -> Callable[[], float]:
    def seconds() -> float:
        speed = paths_per_second(variant, RAYS)
        if speed is None:
            raise RuntimeError(f"mitsuba's {variant} ran once and then no more")
        return RAYS / speed

    return seconds


def presses(_place: Place) -> Iterator[Contest]:
    """A slab whose probe is known, with an inclusion that is new."""
    reason = missing("ngsolve")
    for label, resolution in MESHES.items():
        peers: tuple[Side, ...] = ()
        note = ""
        if not reason:
            from benchmarks.peers.ngsolve_press import change_of_face

            call = timed(lambda: change_of_face(PROBE, LUMP, RADIUS))
            program, other = f"NGSolve {version('ngsolve')}", change_of_face(PROBE, LUMP, RADIUS).face_displacement_mm
            peers = (Side(program=program, seconds=call, note="the other meshes and solves from nothing"),)
            note = f"changes {apart(change_of_press(resolution), other):.2%} apart"
        kernel = slab_kernel(resolution)
        yield Contest(
            task=f"press with a new inclusion, {label}",
            own=Side(
                program="tsis",
                seconds=timed(partial(solved, kernel, SPHERE.diameter_mm, SPHERE.depth_mm, SPHERE.young_kpa)),
                note=note,
            ),
            peers=peers,
            absent=(("NGSolve", reason),) if reason else (),
        )


def uneven_light() -> LightMap:
    """A map of 97 x 97 nodes without symmetry, as tracing gives, that answers to the dent's depth and slope."""
    knots = np.linspace(-12.0, 12.0, 97)
    x, y = knots[None, :], knots[:, None]
    return LightMap(
        x_mm=knots,
        y_mm=knots,
        relative=1 + 0.2 * np.cos(0.3 * x + 0.1) * np.sin(0.25 * y),
        flux_x=0.3 * np.sin(0.2 * x) + 0 * y,
        flux_y=0.3 * np.sin(0.2 * y) + 0 * x,
        growth_per_mm=0.1 + 0.01 * np.cos(0.2 * x + 0 * y),
        error=0.0,
    )


def frames(_place: Place) -> Iterator[Contest]:
    """A whole frame of 768 x 492 pixels, beside NumPy's and SciPy's own passes."""
    field = press(PROBE, tsis.load_phantom("size-8"), force_n=1.0)
    answer, light, rng = nominal_calibration(SENSOR), uneven_light(), np.random.default_rng(1)

    def plainly() -> NDArray[np.float64]:
        shone = render_reference(field, SENSOR, answer, light=light)
        deviation = np.sqrt(SENSOR.read_noise_grey**2 + SENSOR.shot_noise_grey * np.maximum(shone, 0.0))
        noisy = shone + SENSOR.background_grey + deviation * rng.standard_normal(shone.shape)
        return np.clip(np.rint(noisy), 0.0, SENSOR.full_scale)

    yield Contest(
        task="a camera frame of 768 x 492",
        own=Side(
            program="tsis",
            seconds=timed(lambda: expose(render(field, SENSOR, answer, light=light), SENSOR, rng)),
        ),
        peers=(Side(program=f"NumPy {np.__version__}, SciPy {version('scipy')}", seconds=timed(plainly)),),
    )


def reading(place: Place) -> Iterator[Contest]:
    """Image files of 768 x 492, with every check that a file from anywhere needs."""
    picture = frame(np.random.default_rng(0)).grey.astype(np.uint8)
    for suffix in READ:
        path = place.folder / f"frame.{suffix}"
        if not cv2.imwrite(str(path), picture):
            raise OSError(f"OpenCV did not write {path.name}")
        others: dict[str, Callable[[], object]] = {
            f"OpenCV {cv2.__version__}": partial(cv2.imread, str(path), cv2.IMREAD_UNCHANGED),
            f"Pillow {version('pillow')}": lambda path=path: np.asarray(Image.open(path)),  # type: ignore[misc]
        }
        yield Contest(
            task=f"reading a {suffix.upper()} file of 768 x 492",
            own=Side(program="tsis", seconds=timed(partial(read_image, path))),
            peers=tuple(
                Side(program=name, seconds=timed(call), note="the other checks less") for name, call in others.items()
            ),
        )


def matching(_place: Place) -> Iterator[Contest]:
    """Strokes that were bent and turned by 30 degrees."""
    for size in POINTS:
        trial = speed_trial(size, 0)
        sides, absent = [], []
        for name in ("tprl", "pycpd", "probreg"):
            method = BenchmarkMethod(name=name)
            if reason := method.absent():
                absent.append((name, reason))
                continue
            moved = method(trial.source, trial.target, rng=np.random.default_rng(0)).transformed
            program = f"{name} {version(name)}" if version(name) else "tsis"
            error = f"RMS {'ours' if name == 'tprl' else 'the other'} {matching_error(trial, moved):.4f}"
            sides.append(Side(program=program, seconds=timed(_matched(method, trial), once=size > 500), note=error))
        own, *peers = sides
        yield Contest(task=f"{size:,} points matched with {size:,}", own=own, peers=tuple(peers), absent=tuple(absent))


def _matched(method: BenchmarkMethod, trial: Trial) -> Callable[[], object]:
    return lambda: method(trial.source, trial.target, rng=np.random.default_rng(0))


def estimate(_place: Place) -> Iterator[Contest]:
    """Frames to posterior, beside the same frames and a dense grid over the reach of the samples."""
    probe, prior = tsis.load_probe("tsis-domed"), InclusionPrior()
    hidden = tsis.Phantom(
        young_kpa=5.0, thickness_mm=30.0, inclusion=tsis.Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=60.0)
    )
    virtual = VirtualProbe(probe, rng=np.random.default_rng(1), strain="small")
    targets, references = (
        [virtual.press(site, force_n=force) for force in (0.5, 1.0)] for site in (hidden, hidden.without_inclusion())
    )

    def read() -> InclusionLikelihood:
        tables = press_tables(probe, prior, "small")
        return read_frames(
            targets, references, tables, probe=probe, calibration=virtual.calibration, prior=prior
        ).likelihood

    def estimated() -> object:
        return estimate_inclusion(
            targets, probe=probe, calibration=virtual.calibration, reference=references, prior=prior, strain="small"
        )

    found = explore_inclusion(read(), prior)
    nuisance = read().within(found.fit.nuisance[0])
    low, high = found.samples.min(axis=0), found.samples.max(axis=0)
    axes = [a + (b - a) * (np.arange(n) + 0.5) / n for a, b, n in zip(low, high, DENSE, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    def dense() -> None:
        likelihood = read()
        for part in np.array_split(points, -(-len(points) // AT_ONCE)):
            likelihood(part, nuisance)

    yield Contest(
        task="an estimate, domed, 2 + 2 frames",
        own=Side(program="tsis", seconds=timed(estimated)),
        peers=(
            Side(
                program=f"dense grid of {' x '.join(map(str, DENSE))}, NumPy {np.__version__}",
                seconds=timed(dense, once=True),
                note="the grid is told where to look",
            ),
        ),
    )


def storing(place: Place) -> Iterator[Contest]:
    """A frame and its record on the disk, safe from a loss of power."""
    rng = np.random.default_rng(1)
    with (
        open_store(place.folder / "store") as store,
        closing(plain_database(place.folder / "plain.sqlite3")) as plain,
    ):
        target, number = store.add_target(), itertools.count()
        yield Contest(
            task="a press stored: frame, row, audit, anchor",
            own=Side(program="tsis", seconds=_each_new(rng, lambda image: store.add_press(target, image, taken=BEGUN))),
            peers=(
                Side(
                    program=f"write, fsync, SQLite {sqlite3.sqlite_version}",
                    seconds=_each_new(
                        rng, lambda image: kept_plainly(plain, place.folder / f"{next(number)}.png", image)
                    ),
                    note="the other keeps no audit and no anchor",
                ),
            ),
        )


def _each_new(rng: np.random.Generator, keep: Callable[[TactileImage], object], times: int = 8) -> Callable[[], float]:
    """Median seconds to keep a frame that was never kept before; making it is not counted."""

    def seconds() -> float:
        taken = []
        for _ in range(times):
            image = frame(rng)
            began = perf_counter()
            keep(image)
            taken.append(perf_counter() - began)
        return float(np.median(taken))

    return seconds


def report(_place: Place) -> Iterator[Contest]:
    """The report of a target on paper: pictures, tables, provenance."""
    record = sample_record()
    pictures = target_page(record).pictures

    def pictures_alone() -> None:
        for picture in pictures:
            figure = Figure(figsize=picture.size, layout="constrained")
            picture.draw(figure)
            figure.savefig(io.BytesIO(), dpi=PAPER_DPI)

    yield Contest(
        task="report of a target as PDF",
        own=Side(program="tsis", seconds=timed(lambda: page_bytes("pdf", record))),
        peers=(
            Side(
                program=f"Matplotlib {version('matplotlib')}",
                seconds=timed(pictures_alone),
                note=f"the other saves the {len(pictures)} pictures alone",
            ),
        ),
    )


PATHS: dict[str, Callable[[Place], Iterator[Contest]]] = {
    "modes": modes,
    "waves": waves,
    "rays": rays,
    "press": presses,
    "frame": frames,
    "reading": reading,
    "matching": matching,
    "estimate": estimate,
    "storing": storing,
    "report": report,
}


def measured(
    paths: Mapping[str, Callable[[Place], Iterator[Contest]]],
    place: Place,
    *,
    turns: int,
    progress: Callable[[int, str], None],
) -> Iterator[Row]:
    """Every path's rows; ``progress`` hears how many paths are done, and what is next."""
    for done, (name, build) in enumerate(paths.items()):
        progress(done, name)
        for contest in build(place):
            progress(done, contest.task)
            yield from in_turns(contest, turns)


def cells(row: Row) -> tuple[str, ...]:
    """A row as text."""
    own, note = duration(median(row.own_s)), row.note
    if row.ratio is None:
        return row.task, own, row.peer, "-", "-", note
    shown = f"{_short(row.ratio)} ({_short(min(row.ratios))} to {_short(max(row.ratios))})"
    faster = ", **the peer is faster**" if row.ratio < 1 else ""
    return row.task, own, row.peer, duration(median(row.peer_s)), shown + faster, note


def _short(ratio: float) -> str:
    return f"{ratio:,.0f}" if ratio >= 100 else f"{ratio:.3g}"


def main() -> int:
    """Measure and print."""
    bench = Bench(__doc__, only=Several(PATHS), turns=5, peer_python=sys.executable, folder=Path)
    chosen = {name: PATHS[name] for name in bench.only or PATHS}
    cv2.setNumThreads(1)
    with (
        tempfile.TemporaryDirectory(prefix="tsis-speed-", dir=bench.folder) as folder,
        threadpool_limits(limits=1, user_api="blas"),
        Progress(console=Console(stderr=True), transient=True) as shown,
    ):
        place, bar = Place(folder=Path(folder), peer_python=bench.peer_python), shown.add_task("", total=len(chosen))

        def progress(done: int, what: str) -> None:
            shown.update(bar, completed=done, description=what)

        rows = list(measured(chosen, place, turns=bench.turns, progress=progress))
    bench.table(f"Medians of {bench.turns} turns, with the range of the ratio in brackets", HEADS, map(cells, rows))
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
