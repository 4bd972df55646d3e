"""All loaders of files, and the files of each that are judged."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from tests.hostile.detection_loaders import detection_loaders
from tests.hostile.picture_loaders import picture_loaders
from tests.hostile.point_loaders import point_loaders
from tests.hostile.record_loaders import record_loaders
from tests.hostile.store_loaders import store_loaders
from tests.hostile.study_loaders import study_loaders
from tests.hostile.verdict import Tally, Verdict, judged

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from tests.hostile.loader import Loader

BAD = (Verdict.SILENT, Verdict.UNTYPED)


def every_loader() -> tuple[Loader, ...]:
    """All of them."""
    return (
        *picture_loaders(),
        *record_loaders(),
        *point_loaders(),
        *store_loaders(),
        *detection_loaders(),
        *study_loaders(),
    )


def shared_out(files: int, loaders: Sequence[Loader]) -> list[int]:
    """How many files each loader gets, so many in all."""
    whole = sum(loader.share for loader in loaders)
    counts = [int(files * loader.share / whole) for loader in loaders]
    counts[0] += files - sum(counts)
    return counts


def count(loader: Loader, place: int, numbers: Iterable[int], *, seed: int) -> Tally:
    """Judge the files of these numbers; file number n of a loader depends on seed, loader and n alone."""
    tally = Tally()
    with tempfile.TemporaryDirectory(prefix="hostile-") as name:
        folder = Path(name)
        path = loader.laid(folder)
        originals = []
        for original in loader.originals:
            path.write_bytes(original)
            originals.append(loader.load(path))
        for number in numbers:
            which, content, forged = loader.mutated(np.random.default_rng([seed, place, number]))
            path.write_bytes(content)
            if loader.settle is not None and forged:
                loader.settle(folder)
            outcome = judged(loader, path, originals[which], forged=forged)
            tally.add(outcome, f"#{number}")
            if loader.settle is not None and forged:
                loader.laid(folder)
    return tally
