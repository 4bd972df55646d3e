"""Answers: points matched, an inclusion estimated, a press stored, a target reported, an area judged."""

from __future__ import annotations

import io
import itertools
import sqlite3
from contextlib import closing
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Contest, Side, timed, version
from benchmarks.matching.__main__ import speed_trial
from benchmarks.matching.methods import BenchmarkMethod
from benchmarks.matching.trials import matching_error
from benchmarks.peers.placement_matrix import area_and_variance
from benchmarks.posterior_speed import DENSE, PROTOCOLS, PosteriorBench, grid_within_reach
from benchmarks.store_speed import BEGUN, frame, kept_plainly, plain_database
from matplotlib.figure import Figure
from sklearn.metrics import roc_auc_score
from tests.records.sample import sample_record

from tsis.inclusion.posterior.exploration import explore_inclusion
from tsis.present.page import PAPER_DPI
from tsis.present.records import page_bytes
from tsis.present.target import target_page
from tsis.records.store import open_store
from tsis.study.roc import auc_covariance

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from benchmarks.harness import Place
    from benchmarks.matching.distort import Trial

    from tsis.model.image import TactileImage

POINTS = (105, 1000)
PROTOCOL = "domed, 2 + 2"
TARGETS = 2000


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
    probe, forces, referred = PROTOCOLS[PROTOCOL]
    bench = PosteriorBench.of(probe, forces, with_reference=referred)
    likelihood = bench.likelihood()
    grid = grid_within_reach(likelihood, explore_inclusion(likelihood, bench.prior))

    def dense() -> None:
        bench.likelihood()
        grid()

    yield Contest(
        task=f"an estimate, {PROTOCOL} frames",
        own=Side(program="tsis", seconds=timed(bench.estimate)),
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


def area(_place: Place) -> Iterator[Contest]:
    """The area under a curve with DeLong's variance."""
    rng = np.random.default_rng(1)
    present = rng.random(TARGETS) < 0.5
    scores = rng.normal(present * 1.5, 1.0).round(2)  # with ties
    found, plain = auc_covariance([scores], present), area_and_variance(scores, present)
    off = max(abs(float(found.auc[0]) - plain[0]), abs(float(found.covariance[0, 0]) - plain[1]))
    scikit = f"scikit-learn {version('scikit-learn')}"

    def scikit_and_pairs() -> None:
        roc_auc_score(present, scores)
        area_and_variance(scores, present)

    yield Contest(
        task=f"area and its variance, {TARGETS:,} targets",
        own=Side(program="tsis", seconds=timed(lambda: auc_covariance([scores], present))),
        peers=(
            Side(
                program=f"{scikit}, variance from all pairs",
                seconds=timed(scikit_and_pairs),
                note=f"at most {off:.0e} apart" if off else "the same to the last digit",
            ),
            Side(
                program=f"{scikit}, area alone",
                seconds=timed(lambda: roc_auc_score(present, scores)),
                note="the other tells no variance",
            ),
        ),
    )
