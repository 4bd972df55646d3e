"""What the newest frame shows."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from tsis.console.api.models.common import Answer, Measured, Told


class FlagTold(Told):
    """One thing that speaks against using a press as it is."""

    name: str = Field(examples=["off-centre"])
    value: Measured
    limit: Measured
    advice: str = Field(description="what to do")


class ForceTold(Told):
    """A force and where it is known from."""

    value_n: float = Field(description="newtons")
    source: str = Field(description="gauge, virtual or typed")


class ContactTold(Told):
    """The contact in a frame, in its pixels."""

    centroid_px: tuple[float, float] = Field(description="(x, y), weighted by the signal")
    outline_px: list[tuple[float, float]] = Field(description="points (x, y) of its boundary")


class SightTold(Told):
    """What the newest frame that was looked at shows."""

    number: int = Field(description="how many frames had come")
    flags: list[FlagTold]
    force: ForceTold | None = Field(description="null where nobody knows it")
    still: str = Field(description="settled, moving, or how long to wait; empty where nobody can tell")
    contact: ContactTold | None = Field(description="null when nothing stands out")
    histogram: list[int] = Field(description="pixels in equal bins of grey levels from 0 to full scale")
    clipped_share: float = Field(description="of the pixels, at full scale")
    warnings: list[str] = Field(description="what is wrong with the exposure")


class SightAnswer(Answer):
    """What the newest frame shows; null while none is looked at."""

    command: Literal["sight"] = "sight"
    sight: SightTold | None
