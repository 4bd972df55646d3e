"""The camera and the whole instrument: choice, state, settings, press."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from tsis.__about__ import LARGEST_TARGET
from tsis.catalog.phantoms import list_phantoms, list_spheres
from tsis.catalog.probes import list_probes
from tsis.console.api._models import OwnerItem, RequestModel, ResponseModel, Whole
from tsis.console.api._value_schemas import CameraInfoItem
from tsis.console.services import LONGEST_SPEC, MOST_TYPED_N, CameraChoice, CameraState, FrameAnalysis, JobState
from tsis.instrument import Setting
from tsis.virtual.camera import LARGEST_FORCE_N

PROBES, PHANTOMS = tuple(list_probes()), (*list_phantoms(), *list_spheres())
LARGEST_EXACT = 2**53 - 1  # whole number of JSON: many programs round larger ones

USUAL = CameraChoice()


class CameraChoiceRequest(RequestModel):
    """A camera and its mode; of the virtual probe also what it presses."""

    spec: str = Field(
        default=USUAL.spec,
        max_length=LONGEST_SPEC,
        description="virtual, virtual-gel:SENSOR of the catalog, or SOURCE:ID of a camera that a search found",
        examples=["virtual", "virtual-gel:gelsight-mini", "aravis:Fake_1", "opencv:0"],
    )
    mode: str | None = Field(
        default=None, max_length=LONGEST_SPEC, description="label of the mode to start in; null for the camera's first"
    )
    probe: str = Field(
        default=USUAL.probe,
        description="probe of the catalog",
        json_schema_extra={"enum": list(PROBES)},
        max_length=LONGEST_SPEC,
    )
    phantom: str = Field(
        default=USUAL.phantom,
        description="what the virtual probe presses: a phantom, or a sphere for hardness",
        json_schema_extra={"enum": list(PHANTOMS)},
        max_length=LONGEST_SPEC,
    )
    diameter_mm: float | None = Field(
        default=None, ge=0.1, le=100.0, description="of the inclusion instead of the catalog's"
    )
    depth_mm: float | None = Field(default=None, ge=0.2, le=200.0, description="from the skin to the inclusion's top")
    young_kpa: float | None = Field(default=None, ge=0.1, le=1e6, description="modulus of the inclusion")
    seed: Whole = Field(default=USUAL.seed, ge=0, le=LARGEST_EXACT, description="of the virtual probe's errors")


class SettingsResponse(ResponseModel):
    """What can be adjusted now; empty while the camera is stopped or away."""

    command: Literal["settings"] = "settings"
    settings: tuple[Setting, ...]


class SettingsRequest(RequestModel):
    """New values of settings by name; all are checked before the first is changed."""

    values: dict[Annotated[str, Field(max_length=LONGEST_SPEC)], float] = Field(
        min_length=1, max_length=100, examples=[{"exposure_ms": 12.5, "gain": 3.0}]
    )


class PresetRequest(RequestModel):
    """A known state of the settings."""

    name: Literal["default", "minimal"] = Field(description="as the camera came, or as low as exposure and gain go")


class CamerasResponse(ResponseModel):
    """What the last search found."""

    command: Literal["cameras"] = "cameras"
    searched: bool = Field(description="whether a search is over; begin one with POST /v1/cameras/search")
    found: tuple[CameraInfoItem, ...]
    missing: dict[str, str] = Field(description="for each source that could not be searched, why and what to do")


class FrameAnalysisResponse(ResponseModel):
    """Analysis of the newest frame; null without one."""

    command: Literal["sight"] = "sight"
    sight: FrameAnalysis | None


class StateResponse(ResponseModel):
    """Everything that the pages show."""

    command: Literal["state"] = "state"
    camera: CameraState
    target: int = Field(description="number of the target that snapshots go to")
    role: str = Field(description="what is pressed: target, plain, untouched or ball")
    roles: list[str] = Field(description="what may be pressed")
    force_n: float | None = Field(description="newtons, as typed or that of the virtual probe; null where not known")
    calibration: str = Field(description="name of the active one; empty without one")
    calibration_identity: str = Field(description="its SHA-256; empty without one")
    sight: FrameAnalysis | None = Field(description="analysis of the newest frame; null without one")
    holder: OwnerItem | None = Field(description="owner of the camera's control; null without one")
    sequence: JobState | None = Field(description="the running or last sequence")
    jobs: tuple[JobState, ...]
    trouble: list[str] = Field(description="one message for each problem, the most urgent first")
    busy: str = Field(description="the running command that others wait for; empty without one")
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
        "of other cameras null stands for an unknown force",
    )
