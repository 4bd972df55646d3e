"""Base models of requests and responses, and those of program, calibration and control."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, computed_field

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.console.services import LOCK_S, LONGEST_LOCK_S, LONGEST_OWNER_NAME, SHORTEST_LOCK_S


def _whole(value: Any) -> Any:
    return int(value) if isinstance(value, float) and value.is_integer() else value


Whole = Annotated[int, BeforeValidator(_whole)]  # 3.0 is a whole number in JSON
Identity = Annotated[str, Field(pattern="^[0-9a-f]{32}$", examples=["6f1c0d9a1b7e4f0c8a2d3b5e7f901234"])]
Measured = Annotated[float | None, Field(description="null where there is no such number, or it is infinite")]


HTTP_VERSION = 1  # of all responses, until a name is removed from one or changes its meaning


class RequestModel(BaseModel):
    """Body of a call: only these fields, of their own types, with finite numbers."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class ItemModel(BaseModel):
    """Part of a response, read from the program's own values."""

    model_config = ConfigDict(from_attributes=True)


class SchemaItem(ItemModel):
    """Name and version of the response's form; the version increases as those of the results of commands do."""

    name: str = Field(examples=["tsis-http-estimates"])
    version: int


class ResponseModel(ItemModel):
    """First fields of every response; ``command`` names its kind."""

    notice: str = Field(default=RESEARCH_USE_ONLY, description="what the program may be used for")
    tsis: str = Field(default=__version__, description="version of the program")
    command: str

    @computed_field(alias="schema")
    def response_schema(self) -> SchemaItem:
        """``tsis-http-`` and the command."""
        return SchemaItem(name=f"tsis-http-{self.command}", version=HTTP_VERSION)


class Problem(BaseModel):
    """Why a call failed."""

    error: str = Field(description="one sentence: the name, the requirement, the value received, the cure")
    kind: str = Field(description="class of the error, as in tsis.errors", examples=["InputError"])


class StoreItem(ItemModel):
    """Where records are stored."""

    folder: str
    kind: str
    identity: str


class AboutResponse(ResponseModel):
    """The program and its folders."""

    command: Literal["about"] = "about"
    environment: dict[str, Any] = Field(description="versions of program, language and libraries, SHA-256 of the code")
    store: StoreItem
    workspace: str = Field(description="folder of snapshots and sequences")


class CalibrationItem(ItemModel):
    """A calibration by its name and identity."""

    name: str
    probe: str
    sha256: str = Field(description="its identity, which results cite")
    made: datetime | None
    expires: datetime | None = Field(description="null for one that is simulated")


class CalibrationResponse(ResponseModel):
    """The active calibration; null without one."""

    command: Literal["calibration"] = "calibration"
    calibration: CalibrationItem | None


class ControlRequest(RequestModel):
    """A request for the camera's control."""

    name: str = Field(
        min_length=1, max_length=LONGEST_OWNER_NAME, description="what others see, one line", examples=["script of Ann"]
    )
    over: bool = Field(default=False, description="whether to take it from another owner")
    held_s: float = Field(
        default=LOCK_S,
        ge=SHORTEST_LOCK_S,
        le=LONGEST_LOCK_S,
        description="seconds without a call after which the camera is free again",
    )


class ControlResponse(ResponseModel):
    """The caller owns the camera's control."""

    command: Literal["control"] = "control"
    identity: str = Field(description="to be sent as header TSIS-Control with each command; it is a secret")
    name: str
    held_s: float


class OwnerItem(ItemModel):
    """The owner of the camera's control."""

    name: str
    yours: bool = Field(description="whether it is who sent the header TSIS-Control with this call")
