"""The camera: which one, how it is, its settings."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from tsis.catalog import list_phantoms, list_probes, list_spheres
from tsis.console.api._models import ItemModel, Measured, RequestModel, ResponseModel, Whole
from tsis.console.services import LONGEST_SPEC, CameraChoice

PROBES, PHANTOMS = tuple(list_probes()), (*list_phantoms(), *list_spheres())
LARGEST_EXACT = 2**53 - 1  # whole number of JSON: many programs round larger ones

USUAL = CameraChoice()


class CameraChoiceRequest(RequestModel):
    """A camera and its mode; of the virtual probe also what it presses."""

    spec: str = Field(
        default=USUAL.spec,
        max_length=LONGEST_SPEC,
        description="virtual, or SOURCE:ID of a camera that a search found",
        examples=["virtual", "aravis:Fake_1", "opencv:0"],
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


class CameraChoiceItem(ItemModel):
    """The camera as it was chosen."""

    spec: str
    mode: str | None
    probe: str
    phantom: str
    diameter_mm: float | None
    depth_mm: float | None
    young_kpa: float | None
    seed: int


class SettingItem(ItemModel):
    """A number that the camera lets one set."""

    name: str = Field(examples=["exposure_ms"])
    value: Measured
    low: Measured
    high: Measured
    unit: str = Field(description="empty for the driver's own", examples=["ms"])


class CameraItem(ItemModel):
    """How the camera is."""

    choice: CameraChoiceItem
    name: str = Field(description="empty before it was connected")
    mode: str
    modes: list[str]
    running: bool = Field(description="whether frames are wanted")
    lost: bool = Field(description="whether they stay away nevertheless; it is being connected anew")
    failure: str = Field(description="why they stayed away last; empty when they never did")
    received: int = Field(description="frames that came whole")
    missed: int = Field(description="frames that the camera numbered and that never came")
    interruptions: int
    frames_per_s: Measured = Field(description="of the last two seconds")
    rows: int = Field(description="of a frame, pixels; 0 before the first")
    columns: int
    full_scale: float = Field(description="grey level at which the camera clips; 0 before the first frame")
    mm_per_pixel: tuple[float, float] | None = Field(description="size (x, y) of a pixel on the face, mm; null unknown")
    settings: list[SettingItem]


class SettingsResponse(ResponseModel):
    """What can be adjusted now; empty while the camera is stopped or away."""

    command: Literal["settings"] = "settings"
    settings: list[SettingItem]


class SettingsRequest(RequestModel):
    """New values of settings by name; all are looked at before the first is made."""

    values: dict[Annotated[str, Field(max_length=LONGEST_SPEC)], float] = Field(
        min_length=1, max_length=100, examples=[{"exposure_ms": 12.5, "gain": 3.0}]
    )


class PresetRequest(RequestModel):
    """A way back to a known state of the settings."""

    name: Literal["default", "minimal"] = Field(description="as the camera came, or as low as exposure and gain go")


class CameraInfoItem(ItemModel):
    """A camera that answered the search."""

    spec: str = Field(description="what to choose it by", examples=["aravis:Fake_1"])
    source: str
    identity: str
    maker: str
    model: str
    note: str


class CamerasResponse(ResponseModel):
    """What the last search found."""

    command: Literal["cameras"] = "cameras"
    searched: bool = Field(description="whether a search is over; begin one with POST /v1/cameras/search")
    found: list[CameraInfoItem]
    missing: dict[str, str] = Field(description="for each source that could not look, why and what to do")


class FlagItem(ItemModel):
    """One thing that speaks against using a press as it is."""

    name: str = Field(examples=["off-centre"])
    value: Measured
    limit: Measured
    advice: str = Field(description="what to do")


class ForceItem(ItemModel):
    """A force and where it is known from."""

    value_n: float = Field(description="newtons")
    source: str = Field(description="gauge, virtual or typed")


class ContactItem(ItemModel):
    """The contact in a frame, in its pixels."""

    centroid_px: tuple[float, float] = Field(description="(x, y), weighted by the signal")
    outline_px: list[tuple[float, float]] = Field(description="points (x, y) of its boundary")


class FrameAnalysisItem(ItemModel):
    """What the newest frame that was looked at shows."""

    number: int = Field(description="how many frames had come")
    flags: list[FlagItem]
    force: ForceItem | None = Field(description="null where nobody knows it")
    still: str = Field(description="settled, moving, or how long to wait; empty where nobody can tell")
    contact: ContactItem | None = Field(description="null when nothing stands out")
    histogram: list[int] = Field(description="pixels in equal bins of grey levels from 0 to full scale")
    clipped_share: float = Field(description="of the pixels, at full scale")
    warnings: list[str] = Field(description="what is wrong with the exposure")


class FrameAnalysisResponse(ResponseModel):
    """What the newest frame shows; null while none is looked at."""

    command: Literal["sight"] = "sight"
    sight: FrameAnalysisItem | None
