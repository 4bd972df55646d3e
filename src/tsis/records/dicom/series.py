"""Presses put together into the instances that hold them."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.model.errors import RecordsError
from tsis.records.values import ROLES

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from datetime import datetime

    from numpy.typing import NDArray

    from tsis.records import StoredPress, TargetRecord

MOST_BYTES = 2**28  # of pixels in an instance: what archives take at one time, and far below DICOM's 4 GiB
OTHER_PROBE = 10  # between the numbers of series of one role and different probes: 1, 11, 21, ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stack:
    """Presses of one role, probe, size, depth and scale, in the order of their times.

    Parameters
    ----------
    role
        Of all of them.
    probe
        Name of the probe of all of them; empty where nobody wrote it down.
    series
        Number of the series, which is that of a role and a probe.
    started
        Time of the first press of the series.
    number
        Of the instance in its series, from 1.
    presses
        One a frame.
    levels
        Grey levels, shape (frames, rows, columns), uint8 or uint16.
    """

    role: str
    probe: str
    series: int
    started: datetime
    number: int
    presses: tuple[StoredPress, ...]
    levels: NDArray[Any]

    def holds(self, presses: Collection[str]) -> bool:
        """Whether a frame is that of one of these presses, given by their identities."""
        return any(press.id in presses for press in self.presses)


def stacks(dossier: TargetRecord) -> Iterator[Stack]:
    """The instances that a dossier's frames become, by role and probe; frames of one kind are together.

    Raises
    ------
    RecordsError
        When a frame is not of the size that its press states, or of a depth that the store does not keep.
    """
    for place, role in enumerate(ROLES, start=1):
        pressed = sorted((each for each in dossier.presses if each.role == role), key=lambda each: each.taken)
        for other, probe in enumerate(dict.fromkeys(press.probe for press in pressed)):
            presses = [press for press in pressed if press.probe == probe]
            yield from _series(dossier, presses, place + other * OTHER_PROBE)


def _series(dossier: TargetRecord, presses: list[StoredPress], number: int) -> Iterator[Stack]:
    """The instances of one series, whose presses are in the order of their times."""
    kinds: dict[tuple[Any, ...], list[tuple[StoredPress, NDArray[Any]]]] = {}
    for press in presses:
        levels = dossier.levels(press)
        kinds.setdefault((levels.shape, levels.dtype, press.mm_per_pixel, press.full_scale), []).append((press, levels))
    instances = itertools.count(1)
    for frames in kinds.values():
        most = max(1, MOST_BYTES // frames[0][1].nbytes)
        for first in range(0, len(frames), most):
            some = frames[first : first + most]
            yield Stack(
                role=presses[0].role,
                probe=presses[0].probe,
                series=number,
                started=presses[0].taken,
                number=next(instances),
                presses=tuple(press for press, _ in some),
                levels=np.stack([levels for _, levels in some]),
            )


def increments_ms(presses: tuple[StoredPress, ...]) -> list[str]:
    """Times from frame to frame in milliseconds as decimal strings, the first 0."""
    times = [press.taken for press in presses]
    gaps = [0.0, *((late - early).total_seconds() * 1e3 for early, late in itertools.pairwise(times))]
    return [decimal(gap) for gap in gaps]


def decimal(value: float) -> str:
    """A number as DICOM's decimal string of at most 16 characters, with the most digits that fit."""
    if not math.isfinite(value):
        raise RecordsError(f"a number of a DICOM file must be finite; got {value}")
    for digits in range(17, 0, -1):
        text = f"{value:.{digits}g}"
        if len(text) <= 16:
            return text
    raise AssertionError(value)  # one digit with sign and exponent has at most 7 characters
