"""What a file format must be able to hold for the layout to be written into it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

Attribute = str | float | int | bool
Shape = tuple[int, ...]
GZIP_LEVEL = 4  # in every format


class Tree(Protocol):
    """Groups and arrays by their path, as ``"frames/target/0/grey"``; attributes are text and numbers."""

    def group(self, path: str, attributes: Mapping[str, Attribute]) -> None:
        """A group; ``""`` is the root."""

    def create(self, path: str, shape: Shape, dtype: str, chunks: Shape, attributes: Mapping[str, Attribute]) -> Any:
        """A new array of at least one axis, whose parts are set by their index; each chunk is compressed by itself."""


def write_array(tree: Tree, path: str, values: NDArray[Any], attributes: Mapping[str, Attribute]) -> None:
    """A small array, in one chunk."""
    tree.create(path, values.shape, str(values.dtype), values.shape, attributes)[...] = values


def write_stack(
    tree: Tree, path: str, frames: Iterable[NDArray[Any]], shape: Shape, dtype: str, attributes: Mapping[str, Attribute]
) -> None:
    """Frames of one size, taken one by one, a chunk each; ``shape`` is (n, rows, columns)."""
    stack = tree.create(path, shape, dtype, (1, *shape[1:]), attributes)
    for at, frame in enumerate(frames):
        stack[at] = frame
