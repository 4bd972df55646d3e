"""Who holds the camera."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from tsis.console.api.models.common import Answer, Given, Told
from tsis.console.bench.control import HELD_S, LONGEST_HELD_S, LONGEST_NAME, SHORTEST_HELD_S


class ControlGiven(Given):
    """A wish to hold the camera."""

    name: str = Field(
        min_length=1, max_length=LONGEST_NAME, description="what others see, one line", examples=["script of Ann"]
    )
    over: bool = Field(default=False, description="whether to take it from whoever holds it")
    held_s: float = Field(
        default=HELD_S,
        ge=SHORTEST_HELD_S,
        le=LONGEST_HELD_S,
        description="seconds without a call after which the camera is free again",
    )


class ControlAnswer(Answer):
    """The camera is held."""

    command: Literal["control"] = "control"
    identity: str = Field(description="to be sent as header TSIS-Control with each act; it is a secret")
    name: str
    held_s: float


class HolderTold(Told):
    """Who holds the camera."""

    name: str
    yours: bool = Field(description="whether it is who sent the header TSIS-Control with this call")
