"""All that a store holds of one target, as one value: what reports and exports are made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from tsis.model import TactileImage

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    from numpy.typing import NDArray

    from tsis.calibration import ProbeCalibration
    from tsis.records.values import Press, StoredEstimate, Target


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Dossier:
    """A target with its presses, estimates and calibrations.

    Parameters
    ----------
    target
        Whose it is.
    presses
        In the order in which they were taken.
    estimates
        In the order in which they were made; the last is the one in force.
    calibrations
        Those that presses and estimates cite, by their SHA-256.
    read
        Reads and checks the grey levels of a stored frame: its SHA-256 -> shape (rows, columns), uint8 or uint16.
    """

    target: Target
    presses: tuple[Press, ...]
    read: Callable[[str], NDArray[Any]]
    estimates: tuple[StoredEstimate, ...] = ()
    calibrations: Mapping[str, ProbeCalibration] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "calibrations", MappingProxyType(dict(self.calibrations)))

    @property
    def estimate(self) -> StoredEstimate | None:
        """The estimate in force: the last one."""
        return self.estimates[-1] if self.estimates else None

    def press(self, identity: str) -> Press:
        """The press of that identity; KeyError where there is none."""
        return {each.id: each for each in self.presses}[identity]

    def levels(self, press: Press) -> NDArray[Any]:
        """Grey levels as the camera gave them, shape (rows, columns), uint8 or uint16."""
        return self.read(press.frame)

    def image(self, press: Press) -> TactileImage:
        """The frame as an image that estimates take."""
        return TactileImage(
            grey=self.levels(press).astype(np.float64),
            mm_per_pixel=press.mm_per_pixel,
            full_scale=press.full_scale,
            force_n=press.force_n,
            axis_px=press.axis_px,
            name=press.name,
            settings=press.settings,
        )
