"""Frames of a dossier as lossless PNG files, one at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from tsis.instrument.png import QUICK
from tsis.model.errors import RecordsError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.records.dossier import Dossier
    from tsis.records.values import Press


def checked_levels(dossier: Dossier, press: Press) -> NDArray[Any]:
    """Grey levels of a press, shape (rows, columns), uint8 or uint16.

    Raises
    ------
    RecordsError
        When the stored frame is not of the size and kind that its press says.
    """
    found = dossier.levels(press)
    if found.dtype not in (np.uint8, np.uint16) or found.shape != (press.rows, press.columns):
        raise RecordsError(
            f"frame {press.frame:.12} must hold {press.rows} x {press.columns} grey levels of 8 or 16 bits; "
            f"got {found.shape} of {found.dtype}"
        )
    return found


def frame_png(dossier: Dossier, press: Press) -> bytes:
    """The frame of a press as a grey PNG of as many bits as it has.

    Raises
    ------
    RecordsError
        As `checked_levels`.
    """
    return bytes(cv2.imencode(".png", checked_levels(dossier, press), QUICK)[1].tobytes())
