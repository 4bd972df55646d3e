"""All trials of a benchmark: the public ones, or generated ones where these are not at hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.matching.distort import PUBLIC_LEVELS
from tsis.matching.shapes import SHAPES
from tsis.matching.trials import (
    FAMILIES,
    HIDDEN_FRACTIONS,
    PUBLIC_SHAPES,
    SEPARATIONS,
    generated_trials,
    hotel_trials,
    public_trials,
)
from tsis.model.check import require_integer, require_one_of
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from tsis.matching.distort import Family, Trial

GENERATED_SHAPES = ("curve", "strokes")
MOST_TRIALS = 10_000


def distorted_set(
    folder: Path | None,
    *,
    families: Sequence[Family] = FAMILIES,
    shapes: Sequence[str] | None = None,
    levels: Sequence[int] | None = None,
    count: int = 10,
    seed: int = 0,
) -> list[Trial]:
    """Trials of both shapes at every level of every kind of distortion.

    Parameters
    ----------
    folder
        Where the public trials lie; None generates trials of the same kinds.
    families
        Kinds of distortion.
    shapes
        Names of the shapes; None for both public ones, or two generated ones.
    levels
        From 1; None for all. A kind that has no such level leaves it out.
    count
        Trials a shape and level, at least 1; there are 70 public ones.
    seed
        Of the shuffling, and of generated shapes and distortions.

    Raises
    ------
    InputError
        When there is no such kind, shape or level, or the file is missing or broken.

    Examples
    --------
    >>> len(distorted_set(None, families=["noise"], levels=[1, 6], count=3))
    12
    """
    require_integer("count", count, 1, MOST_TRIALS)
    for family in families:
        require_one_of("family of trials", family, FAMILIES)
    if not families:
        raise InputError("families must name at least one kind of trials; got none")
    deepest = max(len(PUBLIC_LEVELS[family]) for family in families)
    for level in levels or ():
        require_integer("level", level, 1, deepest)
    chosen = shapes or (GENERATED_SHAPES if folder is None else PUBLIC_SHAPES)
    for shape in chosen:
        require_one_of("shape", shape, SHAPES if folder is None else PUBLIC_SHAPES)
    trials: list[Trial] = []
    for shape in dict.fromkeys(chosen):
        for family in dict.fromkeys(families):
            for level in range(1, len(PUBLIC_LEVELS[family]) + 1):
                if levels is not None and level not in levels:
                    continue
                if folder is None:
                    trials += generated_trials(shape=shape, family=family, level=level, count=count, seed=seed)
                else:
                    trials += public_trials(folder, shape=shape, family=family, level=level, count=count, seed=seed)
    return trials


def hotel_set(
    folder: Path,
    *,
    separations: Sequence[int] = SEPARATIONS,
    hidden: Sequence[float] = HIDDEN_FRACTIONS,
    count: int | None = None,
    seed: int = 0,
) -> list[Trial]:
    """Pairs of frames of the hotel sequence at every separation and share of hidden landmarks.

    Parameters
    ----------
    folder
        Where the sequence lies.
    separations
        Frames between two of a pair.
    hidden
        Shares of the landmarks that the second frame lacks.
    count
        At most so many pairs a separation and share; None for all.
    seed
        Of the shuffling and of which landmarks are hidden.

    Raises
    ------
    InputError
        When a value is out of range, or the file is missing or broken.
    """
    if count is not None and count < 1:
        raise InputError(f"count must be at least 1; got {count}")
    return [
        trial
        for share in hidden
        for separation in separations
        for trial in hotel_trials(folder, separation=separation, hidden=share, count=count, seed=seed)
    ]


__all__ = ["GENERATED_SHAPES", "distorted_set", "hotel_set"]
