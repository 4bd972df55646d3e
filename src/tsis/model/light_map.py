"""How unevenly the face is lit, over a coarse grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.model import check
from tsis.model.errors import InputError
from tsis.model.press import ascending

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

DARKEST = 1e-3  # of the brightest place; what is darker cannot be divided by


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LightMap:
    """Light that a camera would see of an evenly pressed face, relative to the level that its gain is stated at.

    Parameters
    ----------
    x_mm, y_mm
        Coordinates from the probe's axis, shapes (n,) and (m,), ascending; y grows with the rows of an image.
    relative
        Relative light, shape (m, n), positive. Smooth: between the grid's points it is read off straight lines.

    Raises
    ------
    InputError
        When a coordinate does not ascend, the shape is not that of the grid, or a place is dark.

    Examples
    --------
    >>> light = LightMap(x_mm=[-1.0, 1.0], y_mm=[-1.0, 1.0], relative=[[0.5, 1.5], [0.5, 1.5]])
    >>> light.at([0.0, 9.0], [0.0]).tolist()
    [[1.0, 1.5]]
    """

    x_mm: NDArray[np.float64]
    y_mm: NDArray[np.float64]
    relative: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("x_mm", "y_mm"):
            object.__setattr__(self, name, ascending(name, getattr(self, name)))
        relative = check.array("relative", self.relative, ndim=2)
        shape = (len(self.y_mm), len(self.x_mm))
        if relative.shape != shape:
            raise InputError(f"relative must have the shape {shape} of y_mm and x_mm; got {relative.shape}")
        if relative.min() <= DARKEST * max(relative.max(), 0.0):
            raise InputError(
                f"relative must be above {DARKEST:g} of its largest value everywhere; got {relative.min():.3g}"
            )
        object.__setattr__(self, "relative", relative)

    def __eq__(self, other: object) -> bool:
        """Equal by content, like every value without arrays."""
        return isinstance(other, LightMap) and self._content() == other._content()

    def __hash__(self) -> int:
        return hash(self._content())

    def _content(self) -> tuple[bytes, bytes, bytes]:
        return self.x_mm.tobytes(), self.y_mm.tobytes(), self.relative.tobytes()

    def at(self, x_mm: ArrayLike, y_mm: ArrayLike) -> NDArray[np.float64]:
        """Relative light over a rectangular grid, shape (len(y_mm), len(x_mm)); outside its own the nearest value."""
        along_x = np.array([np.interp(np.asarray(x_mm, dtype=float), self.x_mm, row) for row in self.relative])
        columns = [np.interp(np.asarray(y_mm, dtype=float), self.y_mm, column) for column in along_x.T]
        return np.column_stack(columns)
