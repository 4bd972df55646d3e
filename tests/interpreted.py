"""Compiled functions in the interpreter, as a second computation of what the machine code gives."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import fields, is_dataclass
from types import FunctionType
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

Function = TypeVar("Function", bound="Callable[..., Any]")


def interpreted(function: Function) -> Function:
    """A function of `tsis` that runs in the interpreter, as do all compiled functions that it calls.

    Arithmetic wraps, divides by zero and overflows silently, as compiled arithmetic does.
    """
    return cast("Function", np.errstate(all="ignore")(_python(function, {})))


def _python(function: Any, scopes: dict[int, dict[str, Any]]) -> FunctionType:
    """The function in a copy of its module's names; ``scopes`` holds the copies that were made before."""
    python = getattr(function, "py_func", function)
    scope = scopes.get(id(python.__globals__))
    if scope is None:
        scope = scopes[id(python.__globals__)] = dict(python.__globals__)
        for name, value in python.__globals__.items():
            if hasattr(value, "py_func") or (
                isinstance(value, FunctionType) and value.__module__.startswith(("tsis.", "tests."))
            ):
                scope[name] = _python(value, scopes)
    copy = FunctionType(python.__code__, scope, python.__name__, python.__defaults__, python.__closure__)
    copy.__kwdefaults__ = python.__kwdefaults__
    return copy


def assert_interpreted_alike(function: Callable[..., Any], *arguments: Any, rtol: float = 1e-9, **named: Any) -> Any:
    """Compare results and changed arguments of a compiled function and of the interpreter; returns the results."""
    here, there = ([_copied(argument) for argument in arguments] for _ in range(2))
    found, expected = function(*here, **named), interpreted(function)(*there, **named)
    _assert_alike([found, *here], [expected, *there], rtol, function.__name__)
    return found


def _copied(argument: Any) -> Any:
    """A copy, of an array as writable as the array: the code of a read-only array is compiled by itself."""
    copy = deepcopy(argument)
    if isinstance(argument, np.ndarray):
        copy.flags.writeable = argument.flags.writeable
    return copy


def _assert_alike(found: Any, expected: Any, rtol: float, name: str) -> None:
    if is_dataclass(expected):
        found, expected = ([getattr(side, item.name) for item in fields(expected)] for side in (found, expected))
    elif isinstance(expected, dict):
        found, expected = list(found.values()), list(expected.values())
    if isinstance(expected, tuple | list):
        assert len(found) == len(expected), name
        for one, other in zip(found, expected, strict=True):
            _assert_alike(one, other, rtol, name)
    elif expected is not None:
        np.testing.assert_allclose(found, expected, rtol=rtol, atol=1e-3 * rtol, err_msg=name)
