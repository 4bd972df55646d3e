"""A target with its presses, estimates and calibrations as one value, the input of reports and exports."""

from __future__ import annotations

import secrets
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import RecordsError
from tsis.model import TactileImage, freeze_mappings
from tsis.records._values import ESTIMATES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from typing import Any

    from numpy.typing import NDArray

    from tsis.calibration.file import ProbeCalibration
    from tsis.records._values import StoredEstimate, StoredPress, Target


def active_estimates(estimates: Iterable[StoredEstimate]) -> tuple[StoredEstimate, ...]:
    """The active estimates of a target: the last of each kind. ``estimates`` are in the order of time."""
    last = {stored.kind: stored for stored in estimates}
    return tuple(last[kind] for kind in ESTIMATES if kind in last)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetRecord:
    """A target with its presses, estimates and calibrations.

    Parameters
    ----------
    target
        The target.
    presses
        Its presses in the order of time.
    estimates
        Its estimates in the order of time; the last of each kind is active.
    calibrations
        Calibrations that presses and estimates cite, by SHA-256.
    read
        Reads and checks the grey levels of a stored frame: its SHA-256 -> shape (rows, columns), uint8 or uint16.
    damaged
        A message for each estimate and calibration that is omitted because its file is damaged.
    secret
        64 hexadecimal digits from which the pseudonym of the target follows (`tsis.records._deidentify`); no export
        contains them. A store derives them from its own secret, so they never change. A record without a store, e.g.
        from a bundle, has random ones: its pseudonym changes with each reading.
    """

    target: Target
    presses: tuple[StoredPress, ...]
    read: Callable[[str], NDArray[Any]]
    estimates: tuple[StoredEstimate, ...] = ()
    calibrations: Mapping[str, ProbeCalibration] = field(default_factory=dict)
    damaged: tuple[str, ...] = ()
    secret: str = field(default_factory=lambda: secrets.token_hex(32), repr=False)

    def __post_init__(self) -> None:
        freeze_mappings(self, "calibrations")

    @property
    def estimate(self) -> StoredEstimate | None:
        """The last of all estimates."""
        return self.estimates[-1] if self.estimates else None

    @property
    def active_estimates(self) -> tuple[StoredEstimate, ...]:
        """The active estimates: the last of each kind, in the order of `tsis.records.ESTIMATES`."""
        return active_estimates(self.estimates)

    def require_whole(self) -> None:
        """Raise `RecordsError` when a part is damaged."""
        if self.damaged:
            raise RecordsError(self.damaged[0])

    def press(self, identity: str) -> StoredPress:
        """The press of that identity, or KeyError."""
        return {press.id: press for press in self.presses}[identity]

    def levels(self, press: StoredPress) -> NDArray[Any]:
        """Grey levels as the camera gave them, shape (rows, columns), uint8 or uint16.

        `RecordsError` when size or type of the stored frame do not match the press.
        """
        result = self.read(press.frame)
        if result.shape != (press.rows, press.columns) or result.dtype not in (np.uint8, np.uint16):
            raise RecordsError(
                f"frame {press.frame:.12} must hold {press.rows} x {press.columns} grey levels of 8 or 16 bits, as its "
                f"press says; got shape {result.shape} of {result.dtype}"
            )
        return result

    def image(self, press: StoredPress) -> TactileImage:
        """The frame as an image for estimates."""
        return TactileImage(
            grey=self.levels(press).astype(np.float64),
            mm_per_pixel=press.mm_per_pixel,
            full_scale=press.full_scale,
            force_n=press.force_n,
            axis_px=press.axis_px,
            name=press.name,
            settings=press.settings,
        )
