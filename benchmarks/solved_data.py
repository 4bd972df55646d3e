"""A guard: data that judge an estimator are solved, and never come from the tables of the estimator."""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, NoReturn
from unittest.mock import patch

from tsis.mechanics.surrogate.finite_correction import FiniteCorrection
from tsis.mechanics.surrogate.polynomial import Surrogate, TissueSurrogate

if TYPE_CHECKING:
    from collections.abc import Iterator

READERS = (  # every method that evaluates a table
    (Surrogate, "at_tissue"),
    (Surrogate, "baseline_at"),
    (TissueSurrogate, "__call__"),
    (FiniteCorrection, "without_inclusion"),
    (FiniteCorrection, "change"),
)


class TableReadError(AssertionError):
    """Data were to be taken from a table of the estimator."""


@contextmanager
def solved_data() -> Iterator[None]:
    """Within it, the evaluation of any table raises `TableReadError`: presses must be solved."""

    def refuse(*_: object, **__: object) -> NoReturn:
        raise TableReadError("data that judge an estimator must be solved; a table of the estimator was evaluated")

    with ExitStack() as stack:
        for owner, name in READERS:
            stack.enter_context(patch.object(owner, name, refuse))
        yield
