"""Values that are compared, copied and pickled by their content."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable


class ContentValue:
    """Base of immutable values with arrays or mappings.

    Two values are equal when they have the same class and equal fields. A copy, a deep copy and a pickled value are
    built by the constructor, which checks the fields again and makes arrays and mappings read-only.

    Examples
    --------
    >>> import copy
    >>> from tsis import TactileImage
    >>> image = TactileImage(grey=[[1.0, 2.0]], settings={"gain": 2.0})
    >>> again = copy.deepcopy(image)
    >>> again == image, again is image, again.grey.flags.writeable
    (True, False, False)
    """

    __slots__ = ()

    def _arguments(self) -> dict[str, Any]:
        """The arguments of the constructor that builds an equal value, without read-only mappings."""
        return {item.name: _thawed(getattr(self, item.name)) for item in fields(self) if item.init}  # type: ignore[arg-type]

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if type(self) is not type(other) or not isinstance(other, ContentValue):
            return NotImplemented
        return _equal(self._arguments(), other._arguments())

    def __hash__(self) -> int:
        return hash((type(self), *(_hashable(value) for value in self._arguments().values())))

    def __reduce__(self) -> tuple[Callable[..., ContentValue], tuple[type[ContentValue], dict[str, Any]]]:
        return _rebuilt, (type(self), self._arguments())


def _rebuilt(kind: type[ContentValue], content: dict[str, Any]) -> ContentValue:
    return kind(**content)


def _thawed(value: Any) -> Any:
    """The value with dictionaries for read-only mappings, which Python does not pickle."""
    if isinstance(value, Mapping):
        return {name: _thawed(item) for name, item in value.items()}
    if type(value) in (list, tuple):
        return type(value)(_thawed(item) for item in value)
    return value


def _equal(first: Any, second: Any) -> bool:
    """Equality of fields; arrays are equal with equal type, shape and elements."""
    if isinstance(first, np.ndarray) or isinstance(second, np.ndarray):
        arrays = isinstance(first, np.ndarray) and isinstance(second, np.ndarray) and first.dtype == second.dtype
        return arrays and np.array_equal(first, second, equal_nan=first.dtype.kind in "fc")
    if isinstance(first, dict) and isinstance(second, dict):
        return first.keys() == second.keys() and all(_equal(first[name], second[name]) for name in first)
    if type(first) in (list, tuple) and type(first) is type(second):
        return len(first) == len(second) and all(_equal(*pair) for pair in zip(first, second, strict=True))
    return bool(first == second)


def _hashable(value: Any) -> Any:
    """A part of the hash; equal values have equal parts. Mappings count by their names alone."""
    if isinstance(value, np.ndarray):
        return value.shape, float(value.sum())
    if isinstance(value, dict):
        return frozenset(value)
    return len(value) if type(value) in (list, tuple) else value
