"""Presses: taken now, and those that are stored."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import Field

from tsis.console.api.models.common import Answer, Given, Told, Whole
from tsis.console.api.models.sight import FlagTold
from tsis.console.bench.sequences import LONGEST_S, MOST_FRAMES, SHORTEST_S
from tsis.imaging.colour import COLOUR_MAPS


class SnapshotGiven(Given):
    """How a snapshot is coloured for the eye; the raw frame beside it is not."""

    map_name: str = Field(
        default="viridis", max_length=40, description="a colour map", json_schema_extra={"enum": list(COLOUR_MAPS)}
    )


class PressTold(Told):
    """A stored press."""

    id: str
    role: str
    taken: datetime
    frame: str = Field(description="SHA-256 of the stored file")
    rows: int
    columns: int
    full_scale: float = Field(description="grey level at which the camera clips")
    force_n: float | None = Field(description="newtons; null where nobody measured it")
    mm_per_pixel: tuple[float, float] | None = Field(description="size (x, y) of a pixel on the face; null unknown")
    axis_px: tuple[float, float] = Field(description="where the probe's axis meets the image")
    probe: str
    calibration: str | None = Field(description="SHA-256 of the calibration in force; null without one")
    flags: list[str]
    settings: dict[str, Any] = Field(description="what the camera was set to")
    name: str
    note: str
    version: int


class FilesTold(Told):
    """Files of a snapshot, on the machine of the console."""

    colour: str
    raw: str
    sidecar: str


class KeptAnswer(Answer):
    """A press that is on the disk and in the store."""

    command: Literal["snapshot"] = "snapshot"
    target: int
    press: PressTold
    files: FilesTold
    flags: list[FlagTold] = Field(description="what speaks against it")
    notes: list[str]


class PressesAnswer(Answer):
    """Some presses of a target, in the order in which they were taken."""

    command: Literal["presses"] = "presses"
    target: int
    total: int = Field(description="how many there are")
    offset: int
    presses: list[PressTold]


class SequenceOfSeconds(Given):
    """A sequence that ends after a time."""

    seconds: float = Field(ge=SHORTEST_S, le=LONGEST_S)


class SequenceOfFrames(Given):
    """A sequence that ends after so many frames."""

    frames: Whole = Field(ge=1, le=MOST_FRAMES)
