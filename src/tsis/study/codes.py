"""Codes that tell nothing of what they stand for, in an order that chance decides."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

from tsis.model.check import LARGEST_SEED, require_integer

if TYPE_CHECKING:
    from collections.abc import Sequence

LETTERS = "23456789ABCDEFGHJKLMNPQRSTUVWXYZ"  # without those that are taken for each other
LENGTH = 4
CODES, ORDER, TARGETS = 1, 2, 3  # what a seed is used for: each use draws apart from the others

Target = TypeVar("Target")


def coded(targets: Sequence[Target], seed: int) -> dict[str, Target]:
    """Give every target a code, and put them into the order in which they are to be read.

    Codes and order follow from the seed and the number of targets alone, never from what the targets are.

    Parameters
    ----------
    targets
        In any order.
    seed
        Whole, from 0.

    Returns
    -------
    dict
        Targets by code, in the order of reading.

    Raises
    ------
    InputError
        When the seed is no whole number.

    Examples
    --------
    >>> list(coded(["a", "b", "c"], seed=1)) == list(coded(["x", "y", "z"], seed=1))
    True
    """
    require_integer("seed", seed, 0, LARGEST_SEED)
    order = np.random.default_rng([seed, ORDER]).permutation(len(targets))
    return {code: targets[place] for code, place in zip(_codes(len(targets), seed), order.tolist(), strict=True)}


def _codes(count: int, seed: int) -> list[str]:
    rng, found = np.random.default_rng([seed, CODES]), dict[str, None]()
    while len(found) < count:
        found["T-" + "".join(LETTERS[place] for place in rng.integers(len(LETTERS), size=LENGTH))] = None
    return list(found)


__all__ = ["coded"]
