"""Which light that enters the side of a stack stays in it, and which of that never reaches the pressed face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.model.check import require_array
from tsis.optics import inputs

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from tsis.model import Probe
    from tsis.model.light import Led


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Acceptance:
    """What each layer of a stack takes in through the side wall, from air; layers from the pressed face up.

    Attributes
    ----------
    index
        Refractive index of each layer, (layers,).
    critical_deg
        Angle from the layers' normal above which a ray in that layer cannot leave the stack.
    acceptance_deg
        Angle from the side wall's normal below which a ray from outside stays in the stack, the source's (3.67). It is
        90 where the layer's index is so high that every ray from outside stays.
    unlimited
        Whether every ray stays.
    blind_deg
        Angle from the side wall's normal below which a ray never reaches the pressed face, because a layer of lower
        index reflects it on the way; 0 where every ray reaches it.
    blind_share
        The same as a share of the angles, within the layer, at which a ray stays in the stack.
    """

    index: NDArray[np.float64]
    critical_deg: NDArray[np.float64]
    acceptance_deg: NDArray[np.float64]
    unlimited: NDArray[np.bool]
    blind_deg: NDArray[np.float64]
    blind_share: NDArray[np.float64]


def acceptance(index: ArrayLike, *, index_outside: float = 1.0) -> Acceptance:
    """Angles of acceptance, ``asin(min(1, sqrt(n_i**2 - n_out**2)))``, of each layer.

    A ray at the angle a to the plane of the layers keeps ``N = n_i cos(a)``, its effective index, in all layers. It
    stays in the stack when N exceeds the index outside, and passes a layer only when N is below that layer's index.

    Parameters
    ----------
    index
        Real refractive indices from the pressed face up, in [1, 5], (layers,).
    index_outside
        Index below and above the stack, in [1, 5]; in front of the side wall there is air.

    Raises
    ------
    InputError
        When a value lies outside its range.

    Examples
    --------
    >>> acceptance([1.16, 1.15, 1.14, 1.13]).acceptance_deg.round(2).tolist()
    [36.01, 34.6, 33.19, 31.75]
    >>> acceptance([1.41, 1.515]).blind_deg.round(1).tolist()
    [0.0, 33.7]
    """
    indices = require_array("index", index, ndim=1)
    for layer, value in enumerate(indices):
        inputs.require_refractive_index(f"index[{layer}]", float(value))
    outside = inputs.require_refractive_index("index_outside", index_outside)
    on_the_way = np.minimum.accumulate(indices)  # the lowest index between a layer and the face
    aperture = _aperture(indices, np.full_like(indices, outside))
    stays, blind = (_grazing_deg(indices, least) for least in (np.full_like(indices, outside), on_the_way))
    return Acceptance(
        index=indices,
        critical_deg=90 - stays,
        acceptance_deg=np.degrees(np.arcsin(np.minimum(1, aperture))),
        unlimited=aperture >= 1,
        blind_deg=np.degrees(np.arcsin(np.minimum(1, _aperture(indices, np.maximum(on_the_way, outside))))),
        blind_share=np.divide(np.minimum(blind, stays), stays, out=np.zeros_like(stays), where=stays > 0),
    )


def layer_facing_lamp(probe: Probe, led: Led) -> int:
    """The layer whose side wall the middle of a lamp lies against, from the pressed face up; the last is the glass."""
    tops = np.cumsum([layer.thickness_mm for layer in probe.layers])
    return int(np.searchsorted(tops, probe.led_height_mm(led), side="right"))


def _aperture(index: NDArray[np.float64], least: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sine of the angle in air, before the side wall, of a ray whose effective index is ``least``."""
    return np.sqrt(np.maximum((index - least) * (index + least), 0))


def _grazing_deg(index: NDArray[np.float64], least: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle to the plane of the layers of such a ray within its layer."""
    return np.degrees(np.arccos(np.minimum(1, least / index)))
