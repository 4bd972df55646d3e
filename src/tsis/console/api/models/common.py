"""What every body and every answer has."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from tsis.__about__ import RESEARCH_USE_ONLY, __version__


def _whole(value: Any) -> Any:
    return int(value) if isinstance(value, float) and value.is_integer() else value


Whole = Annotated[int, BeforeValidator(_whole)]  # 3.0 is a whole number in JSON
Identity = Annotated[str, Field(pattern="^[0-9a-f]{32}$", examples=["6f1c0d9a1b7e4f0c8a2d3b5e7f901234"])]
Measured = Annotated[float | None, Field(description="null where there is no such number, or it is infinite")]


class Given(BaseModel):
    """What a call takes: no field more than these, of their own types, numbers finite."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class Told(BaseModel):
    """Part of an answer, read off the program's own values."""

    model_config = ConfigDict(from_attributes=True)


class Answer(Told):
    """What every answer starts with; each also tells by ``command`` what it is."""

    notice: str = Field(default=RESEARCH_USE_ONLY, description="what the program may be used for")
    tsis: str = Field(default=__version__, description="version of the program")


class Problem(BaseModel):
    """Why a call was not done."""

    error: str = Field(description="one sentence: the name, the requirement, the value received, the cure")
    kind: str = Field(description="class of the error, as in tsis.model.errors", examples=["InputError"])
