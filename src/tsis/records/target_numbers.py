"""Which number a target gets: the next after all, as long as there is one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sqlalchemy import func, select

from tsis.instrument.naming import LARGEST_TARGET
from tsis.model.errors import InputError, RecordsError
from tsis.records.tables import targets

if TYPE_CHECKING:
    from sqlalchemy import Connection

_number = targets.c.number


def is_taken(connection: Connection, number: int) -> bool:
    """Whether a target is called so."""
    return connection.execute(select(_number).where(_number == number)).first() is not None


def next_number(connection: Connection) -> int:
    """The next after all.

    Raises
    ------
    InputError
        When the largest is taken, so that somebody has to choose.
    """
    last = _last(connection)
    if last >= LARGEST_TARGET:
        raise InputError(
            f"number must be given in a store that holds target {LARGEST_TARGET}, after which there is none; got none "
            f"(give one that is free, as {_lowest(connection)})"
        )
    return last + 1


def free_number(connection: Connection, wanted: int) -> int:
    """That number; where another target has it the next after all, else the lowest that is free."""
    if not is_taken(connection, wanted):
        return wanted
    last = _last(connection)
    return last + 1 if last < LARGEST_TARGET else _lowest(connection)


def _last(connection: Connection) -> int:
    return int(connection.execute(select(func.max(_number))).scalar_one() or 0)


def _lowest(connection: Connection) -> int:
    taken = set(connection.execute(select(_number)).scalars())
    for number in range(1, LARGEST_TARGET + 1):
        if number not in taken:
            return number
    raise RecordsError(f"a store must hold at most {LARGEST_TARGET} targets; it has as many (begin another)")
