"""A thin layered guide and the round dent of a tip in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError
from tsis.model.require import require_integer, require_number, require_one_of
from tsis.optics import _inputs as inputs

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tsis.optics._inputs import Floats


THINNEST_LEFT = 0.05  # remaining fraction of the soft layers under the deepest dent
LARGEST_TIP_UM = 1e4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ThinGuide:
    """Layers a few micrometres thick in a uniform medium, as in the dissertation's section 3.3 (whose "mm" are µm).

    Parameters
    ----------
    index
        Real refractive indices, shape (layers,), the pressed layer first.
    thickness_um
        Thicknesses, µm, shape (layers,).
    rigid_layers
        Number of the last layers that do not yield to a dent; 1 is the glass plate.
    index_outside
        Refractive index of the medium on both sides and in the dent, in [1, 5].

    Raises
    ------
    InputError
        When a value lies outside its range, or no layer yields.
    """

    index: Floats
    thickness_um: Floats
    rigid_layers: int = 1
    index_outside: float = 1.0

    def __post_init__(self) -> None:
        index, thickness = inputs.require_stack(self.index, self.thickness_um)
        object.__setattr__(self, "index", index)
        object.__setattr__(self, "thickness_um", thickness)
        inputs.require_refractive_index("index_outside", self.index_outside)
        rigid = require_integer("rigid_layers", self.rigid_layers, 0, len(index) - 1, hint="for a layer must yield")
        object.__setattr__(self, "rigid_layers", rigid)

    def __eq__(self, other: object) -> bool:
        """Equality by content."""
        return isinstance(other, ThinGuide) and self._content() == other._content()

    def __hash__(self) -> int:
        return hash(self._content())

    def _content(self) -> tuple[bytes | float, ...]:
        return self.index.tobytes(), self.thickness_um.tobytes(), self.rigid_layers, self.index_outside

    @property
    def total_um(self) -> float:
        """Thickness of the whole guide, µm."""
        return float(self.thickness_um.sum())

    @property
    def soft_um(self) -> float:
        """Thickness of the layers that yield, µm."""
        return float(self.thickness_um[: len(self.index) - self.rigid_layers].sum())


THIN_GUIDES = {
    "dissertation": ThinGuide(index=np.array([1.16, 1.15, 1.14, 1.13]), thickness_um=np.array([2.0, 3.0, 4.0, 1.0])),
    "realistic": ThinGuide(index=np.array([1.41, 1.41, 1.41, 1.515]), thickness_um=np.array([2.0, 3.0, 4.0, 1.0])),
}


def thin_guide(name: str) -> ThinGuide:
    """Return a guide in air by its name: ``dissertation`` with the printed indices, ``realistic`` with PDMS on glass.

    Raises
    ------
    UnknownNameError
        When there is no guide of that name.

    Examples
    --------
    >>> thin_guide("dissertation").total_um
    10.0
    """
    return THIN_GUIDES[require_one_of("thin guide", name, THIN_GUIDES)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Dent:
    """The dent of a rigid round tip: a cylinder across the guide, its axis along y.

    Parameters
    ----------
    depth_um
        Depth of the tip's lowest line below the flat face, µm, in [0, 1e4].
    tip_radius_um
        Radius of the tip, µm, in [0.1, 1e4]. The walls above a tip deeper than its radius are vertical.
    """

    depth_um: float = 0.0
    tip_radius_um: float = 10.0

    def __post_init__(self) -> None:
        require_number("depth_um", self.depth_um, 0.0, LARGEST_TIP_UM, hint="micrometres")
        require_number("tip_radius_um", self.tip_radius_um, 0.1, LARGEST_TIP_UM, hint="micrometres")

    @property
    def half_width_um(self) -> float:
        """Half of the dent's width at the face, µm."""
        sunk = min(self.depth_um, self.tip_radius_um)
        return float(np.sqrt(sunk * (2 * self.tip_radius_um - sunk)))

    def at(self, distance_um: ArrayLike) -> Floats:
        """Depth of the pressed face, µm, at signed distances from the dent's middle along the guide, any shape."""
        distance = np.abs(np.asarray(distance_um, dtype=float))
        sagitta = self.tip_radius_um - np.sqrt(np.maximum(self.tip_radius_um**2 - distance**2, 0.0))
        return np.where(distance < self.tip_radius_um, np.maximum(self.depth_um - sagitta, 0.0), 0.0)


def interfaces_um(guide: ThinGuide, dent: Dent, distance_um: ArrayLike) -> Floats:
    """Depths of all interfaces below the flat face, µm, at distances from the dent's middle.

    The rigid layers do not move. The soft layers between them and the tip are compressed in proportion to their
    thickness; their indices do not change, and there is no bulge beside the tip.

    Returns
    -------
    NDArray[np.float64]
        Shape (distances, layers + 1): the pressed face first, the far face last.

    Raises
    ------
    InputError
        When the dent leaves less than 5 % of the soft layers.

    Examples
    --------
    >>> interfaces_um(thin_guide("dissertation"), Dent(depth_um=4.5), [0.0])
    array([[ 4.5,  5.5,  7. ,  9. , 10. ]])
    """
    deepest = (1 - THINNEST_LEFT) * guide.soft_um
    if dent.depth_um > deepest:
        raise InputError(
            f"depth_um must be at most {deepest:g}, because the soft layers are {guide.soft_um:g} um thick;"
            f" got {dent.depth_um:g}"
        )
    flat = np.concatenate(([0.0], np.cumsum(guide.thickness_um)))
    fraction = np.maximum(1 - flat / guide.soft_um, 0.0)  # of the dent's depth, at each interface
    return np.asarray(flat + dent.at(distance_um)[..., np.newaxis] * fraction)
