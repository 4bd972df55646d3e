"""What a file format must be able to hold for the layout to be written into it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

Attribute = str | float | int | bool


class Tree(Protocol):
    """Groups and arrays by their path, as ``"frames/target/0/grey"``; attributes are text and numbers."""

    def group(self, path: str, attributes: Mapping[str, Attribute]) -> None:
        """A group; ``""`` is the root."""

    def array(self, path: str, values: NDArray[Any], attributes: Mapping[str, Attribute]) -> None:
        """A small array, at least one axis."""

    def stack(
        self,
        path: str,
        frames: Iterable[NDArray[Any]],
        shape: tuple[int, int, int],
        dtype: str,
        attributes: Mapping[str, Attribute],
    ) -> None:
        """Frames of one size, taken one by one and compressed each on its own; ``shape`` is (n, rows, columns)."""
