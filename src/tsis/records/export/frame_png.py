"""Frames of a dossier as lossless PNG files, one at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2

from tsis.instrument.png import QUICK

if TYPE_CHECKING:
    from tsis.records.dossier import TargetRecord
    from tsis.records.values import StoredPress


def frame_png(dossier: TargetRecord, press: StoredPress) -> bytes:
    """The frame of a press as a grey PNG of as many bits as it has.

    Raises
    ------
    RecordsError
        When the stored frame is not what its press says.
    """
    return bytes(cv2.imencode(".png", dossier.levels(press), QUICK)[1].tobytes())
