"""Frames of a dark disc on an evenly lit probe, and frames that no command takes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

DISC_PX, CENTRE = 30.0, (140.0, 90.0)


def write_disc_frames(folder: Path) -> None:
    """A dark disc of 30 px radius on an evenly lit probe, the probe untouched, and frames that do not fit them."""
    y, x = np.mgrid[:200, :300]
    disc = np.where(np.hypot(x - CENTRE[0], y - CENTRE[1]) < DISC_PX, 120, 200).astype(np.uint8)
    cv2.imwrite(str(folder / "press.png"), disc)
    cv2.imwrite(str(folder / "untouched.png"), np.full((200, 300), 200, np.uint8))
    cv2.imwrite(str(folder / "small.png"), np.full((20, 30), 200, np.uint8))
    cv2.imwrite(str(folder / "deep.png"), np.full((200, 300), 200, np.uint16))
    (folder / "cut.png").write_bytes((folder / "press.png").read_bytes()[:-30])
    (folder / "empty.png").write_bytes(b"")
    (folder / "notes.png").write_text("no picture")


def entries(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}
