"""How the whole bench is."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from tsis.console.api._models import OwnerItem, RequestModel, ResponseModel, Whole
from tsis.console.api._models_camera import CameraItem, FrameAnalysisItem
from tsis.console.api._models_records import JobItem
from tsis.console.services import MOST_TYPED_N
from tsis.files import LARGEST_TARGET
from tsis.virtual import LARGEST_FORCE_N


class StateResponse(ResponseModel):
    """Everything that the pages show."""

    command: Literal["state"] = "state"
    camera: CameraItem
    target: int = Field(description="number of the target that snapshots go to")
    role: str = Field(description="what is pressed: target, plain, untouched or ball")
    roles: list[str] = Field(description="what may be pressed")
    force_n: float | None = Field(description="newtons, as typed or that of the virtual probe; null where not known")
    calibration: str = Field(description="name of the one in force; empty without one")
    calibration_identity: str = Field(description="its SHA-256; empty without one")
    sight: FrameAnalysisItem | None = Field(description="what the newest frame shows; null while none is looked at")
    holder: OwnerItem | None = Field(description="who holds the camera; null when nobody does")
    sequence: JobItem | None = Field(description="the sequence under way or the last one")
    jobs: list[JobItem]
    trouble: list[str] = Field(description="one sentence for each thing to know, the most urgent first")
    busy: str = Field(description="what is being done now that acts must wait for; empty when nothing is")
    gauge: str = Field(description="name of the gauge that forces are read from; empty without one")


class TargetChoiceRequest(RequestModel):
    """The target that snapshots go to."""

    number: Whole = Field(ge=1, le=LARGEST_TARGET, examples=[1])


class PressRequest(RequestModel):
    """What is pressed and how hard; what is left out stays as it is."""

    role: Literal["target", "plain", "untouched", "ball"] | None = Field(
        default=None, description="one of the state's roles; null for the present one"
    )
    force_n: float | None = Field(
        default=None,
        ge=0.0,
        le=MOST_TYPED_N,
        description=f"newtons, at most {LARGEST_FORCE_N:g} for the virtual probe, whose force is always known; "
        "of other cameras null says that nobody knows it",
    )
