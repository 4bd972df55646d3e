"""HTTP statuses of the classes of `tsis.errors`."""

from __future__ import annotations

import errno
import sqlite3
from contextlib import contextmanager
from http import HTTPStatus
from typing import TYPE_CHECKING

from tsis import errors

if TYPE_CHECKING:
    from collections.abc import Iterator


NO_SPACE = (errno.ENOSPC, errno.EDQUOT)


class AbsentError(errors.UnknownNameError):
    """The address names nothing."""


@contextmanager
def absent_if_unknown() -> Iterator[None]:
    """Raise an `InputError` about a part of an address as `AbsentError`."""
    try:
        yield
    except errors.InputError as error:
        raise AbsentError(str(error)) from error


class NoControlError(errors.ControlError):
    """A command without the caller's header."""


STATUSES: tuple[tuple[type[errors.TsisError], HTTPStatus], ...] = (  # the first that fits
    (AbsentError, HTTPStatus.NOT_FOUND),
    (NoControlError, HTTPStatus.PRECONDITION_REQUIRED),
    (errors.ControlError, HTTPStatus.CONFLICT),
    (errors.StaleRecordError, HTTPStatus.CONFLICT),
    (errors.MissingExtraError, HTTPStatus.NOT_IMPLEMENTED),
    (errors.CameraError, HTTPStatus.SERVICE_UNAVAILABLE),
    (errors.GaugeError, HTTPStatus.SERVICE_UNAVAILABLE),
    (errors.RecordsError, HTTPStatus.SERVICE_UNAVAILABLE),
    (errors.TsisError, HTTPStatus.UNPROCESSABLE_ENTITY),
)


def status_of(error: errors.TsisError) -> HTTPStatus:
    """The status of an error: 507 for a full disk, 503 where files fail for another reason, else as in `STATUSES`."""
    if isinstance(error, (errors.FileInputError, errors.RecordsError)):
        failed = [item for item in _chain(error) if isinstance(item, (OSError, sqlite3.Error))]
        if any(_is_full(item) for item in failed):
            return HTTPStatus.INSUFFICIENT_STORAGE
        if failed and not isinstance(error, errors.StaleRecordError):
            return HTTPStatus.SERVICE_UNAVAILABLE
    return next(status for kind, status in STATUSES if isinstance(error, kind))


def _chain(error: BaseException) -> Iterator[BaseException]:
    waiting: list[BaseException] = [error]
    while waiting:
        one = waiting.pop()
        yield one
        if (cause := one.__cause__ or one.__context__) is not None:
            waiting.append(cause)
        if isinstance(original := getattr(one, "orig", None), BaseException):  # of SQLAlchemy
            waiting.append(original)


def _is_full(error: BaseException) -> bool:
    if isinstance(error, OSError):
        return error.errno in NO_SPACE
    return getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL
