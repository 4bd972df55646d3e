"""Stored targets."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from pydantic import Field

from tsis.console.api.models.common import Answer, Given, Told, Whole
from tsis.records.values import LONGEST_NAME, LONGEST_NOTE

TrueValue = Annotated[float, Field(ge=-1e9, le=1e9)]


class TargetTold(Told):
    """One place that was pressed."""

    number: int
    kind: str = Field(description="phantom or subject")
    name: str = Field(description="of a subject a pseudonym")
    note: str
    truth: dict[str, float] = Field(description="true values of a phantom by name with their unit")
    made: datetime
    id: str
    version: int = Field(description="counts its edits from 1")


class SummaryTold(Told):
    """A target and how much is stored of it."""

    target: TargetTold
    presses: int
    estimates: int
    last: datetime | None = Field(description="when it was pressed last; null when it never was")


class TargetsAnswer(Answer):
    """Some targets of the store, by number."""

    command: Literal["targets"] = "targets"
    total: int
    offset: int
    targets: list[SummaryTold]


class TargetAnswer(Answer):
    """A target."""

    command: Literal["target"] = "target"
    target: TargetTold
    presses: int = Field(description="how many there are")


class TargetGiven(Given):
    """Changes of a target as it was read; what is left out stays."""

    version: Whole = Field(ge=1, le=2**31 - 1, description="that was read; refused when somebody has changed it since")
    name: str | None = Field(default=None, max_length=LONGEST_NAME, description="one line; null leaves it as it is")
    note: str | None = Field(default=None, max_length=LONGEST_NOTE, description="null leaves it as it is")
    truth: dict[Annotated[str, Field(min_length=1, max_length=LONGEST_NAME)], TrueValue] | None = Field(
        default=None,
        max_length=100,
        description="replaces all; diameter_mm, depth_mm and young_kpa as an inclusion can have them; "
        "null leaves it as it is",
        examples=[{"diameter_mm": 10.0}],
    )
