"""What calls take and answer: models of pydantic, some made from value classes and their docstrings."""

from __future__ import annotations

import inspect
import re
from datetime import datetime
from functools import partial
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, GetCoreSchemaHandler, computed_field
from pydantic_core import CoreSchema, core_schema

from tsis.__about__ import LARGEST_TARGET, RESEARCH_USE_ONLY, __version__
from tsis.calibration.guard.limits import GuardFlag
from tsis.catalog.phantoms import list_phantoms, list_spheres
from tsis.catalog.probes import list_probes
from tsis.console.services.camera import MOST_TYPED_N
from tsis.console.services.captures import LONGEST_SEQUENCE_S, MOST_SEQUENCE_FRAMES, SHORTEST_SEQUENCE_S
from tsis.console.services.choice import LONGEST_SPEC, CameraChoice, PressForce
from tsis.console.services.control import LOCK_S, LONGEST_LOCK_S, LONGEST_OWNER_NAME, SHORTEST_LOCK_S
from tsis.console.services.frames import ContactView, FrameAnalysis
from tsis.console.services.jobs import RESULTS, JobState
from tsis.console.services.state import CameraState
from tsis.files.json_values import free_to_json
from tsis.imaging.colour import COLOUR_MAPS
from tsis.imaging.depth import GelReading
from tsis.instrument.camera import Setting
from tsis.instrument.discovery import CameraInfo
from tsis.instrument.recording import RecordingReport
from tsis.records.recomputation import Shift
from tsis.records.values import LONGEST_NAME, LONGEST_NOTE, StoredPress, Target
from tsis.virtual.camera import LARGEST_FORCE_N


class Fields:
    """Marks a value class in an annotation: which fields JSON leaves out, and which properties it adds.

    Mappings become plain objects, their infinite numbers strings.
    """

    def __init__(self, *, without: tuple[str, ...] = (), also: tuple[str, ...] = ()) -> None:
        self._without, self._also = without, also

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """The schema that pydantic makes of the class, with these changes."""
        schema = handler(source)
        values: Any = handler.resolve_ref_schema(schema)["schema"]
        for field in values["fields"]:
            field["serialization_exclude"] = field["name"] in self._without
            inner = field["schema"].get("schema", {})
            if inner.get("type") == "dict":
                inner["serialization"] = core_schema.plain_serializer_function_ser_schema(
                    partial(free_to_json, where=field["name"]), return_schema=inner.copy()
                )
        values["computed_fields"] = [core_schema.computed_field(name, core_schema.str_schema()) for name in self._also]
        return schema


CameraInfoItem = Annotated[CameraInfo, Fields(also=("spec",))]
PressItem = Annotated[StoredPress, Fields(without=("target",))]
ShiftItem = Annotated[Shift, Fields(without=("low_shift", "high_shift"))]
TargetItem = Annotated[Target, Fields()]
UNBOUNDED = {  # numbers that may be infinite, which JSON writes as null
    CameraState: ("frames_per_s",),
    GuardFlag: ("value", "limit"),
    Setting: ("value", "low", "high"),
}
VALUES = (
    *(CameraChoice, CameraInfo, CameraState, ContactView, FrameAnalysis, GelReading, GuardFlag, JobState, PressForce),
    *(RecordingReport, Setting, Shift, StoredPress, Target),
)


def describe_values(schemas: dict[str, Any]) -> None:
    """Complete the schemas of value classes: each field is there, and described as the docstring says."""
    for value in VALUES:
        schema = schemas[value.__name__]
        schema["description"], described = docstring_parts(value)
        schema["required"] = list(schema["properties"])
        for name, field in schema["properties"].items():
            field.pop("default", None)
            if name in described:
                field["description"] = described[name]
            if name in UNBOUNDED.get(value, ()):
                field["anyOf"] = [{"type": field.pop("type")}, {"type": "null"}]


def docstring_parts(value: type) -> tuple[str, dict[str, str]]:
    """The summary of a class's docstring, and the description of each of its parameters or attributes."""
    text = inspect.cleandoc(value.__doc__ or "") + "\n"
    described: dict[str, str] = {}
    for names, description in re.findall(r"^(\w+(?:, \w+)*)\n((?:    .*\n)+)", text, flags=re.MULTILINE):
        described |= dict.fromkeys(names.split(", "), re.sub(r"\bNone\b", "null", " ".join(description.split())))
    return text.partition("\n")[0], described


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


class SnapshotRequest(RequestModel):
    """Colours of a snapshot; the raw frame beside it has none."""

    map_name: str = Field(
        default="viridis", max_length=40, description="a colour map", json_schema_extra={"enum": list(COLOUR_MAPS)}
    )


class FilesItem(ItemModel):
    """Files of a snapshot, on the machine of the console."""

    colour: str
    raw: str
    sidecar: str


class SavedPressResponse(ResponseModel):
    """A press that is on the disk and in the store."""

    command: Literal["snapshot"] = "snapshot"
    target: int
    press: PressItem
    files: FilesItem
    flags: tuple[GuardFlag, ...] = Field(description="flags of the press")
    notes: list[str]


class PressesResponse(ResponseModel):
    """Some presses of a target, in the order in which they were taken."""

    command: Literal["presses"] = "presses"
    target: int
    total: int = Field(description="how many there are")
    offset: int
    presses: list[PressItem]


class SequenceOfSeconds(RequestModel):
    """A sequence that ends after a time."""

    seconds: float = Field(ge=SHORTEST_SEQUENCE_S, le=LONGEST_SEQUENCE_S)


class SequenceOfFrames(RequestModel):
    """A sequence that ends after so many frames."""

    frames: Whole = Field(ge=1, le=MOST_SEQUENCE_FRAMES)


TrueValue = Annotated[float, Field(ge=-1e9, le=1e9)]


class TargetSummaryItem(ItemModel):
    """A target and how much is stored of it."""

    target: TargetItem
    presses: int
    estimates: int
    last: datetime | None = Field(description="when it was pressed last; null when it never was")


class TargetsResponse(ResponseModel):
    """Some targets of the store, by number."""

    command: Literal["targets"] = "targets"
    total: int
    offset: int
    targets: list[TargetSummaryItem]


class TargetResponse(ResponseModel):
    """A target."""

    command: Literal["target"] = "target"
    target: TargetItem
    presses: int = Field(description="how many there are")


class TargetRequest(RequestModel):
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


Numbers = Annotated[list[float], Field(min_length=2, max_length=2)]
Presses = Annotated[
    list[Identity] | None,
    Field(min_length=1, max_length=1000, description="presses to use; null for the newest of each role and force"),
]


class InclusionPriorRequest(RequestModel):
    """Prior of the inclusion and its surroundings; omitted values are defaults."""

    diameter_mm: Numbers | None = Field(default=None, description="range (low, high)")
    depth_mm: Numbers | None = Field(default=None, description="range from the skin to the inclusion's top")
    young_kpa: Numbers | None = Field(default=None, description="range of the modulus, above that of the tissue")
    tissue_young_kpa: float | None = Field(default=None, ge=0.05, le=2000.0)
    tissue_young_sd: float | None = Field(default=None, ge=1e-4, le=0.3, description="relative")
    thickness_mm: float | None = Field(default=None, ge=2.0, le=500.0)
    thickness_sd: float | None = Field(default=None, ge=1e-4, le=0.2, description="relative")
    poisson: float | None = Field(default=None, ge=0.0, le=0.495)
    poisson_sd: float | None = Field(default=None, ge=0.0, le=0.05)
    offset_sd_mm: float | None = Field(default=None, ge=0.0, le=5.0)
    presence: float | None = Field(
        default=None, ge=0.001, le=0.999, description="probability that there is an inclusion"
    )


class HardnessPriorRequest(RequestModel):
    """Prior of the object; omitted values are defaults."""

    young_kpa: Numbers | None = Field(default=None, description="range within [1, 1e5]")
    poisson: Numbers | None = Field(default=None, description="range within [0.45, 0.495]")


class InclusionRequest(RequestModel):
    """An estimate of an inclusion under the surface."""

    kind: Literal["inclusion"]
    presses: Presses = None
    prior: InclusionPriorRequest | None = None


class HardnessRequest(RequestModel):
    """An estimate of the hardness of an object that is touched itself."""

    kind: Literal["hardness"]
    presses: Presses = None
    prior: HardnessPriorRequest | None = None
    radius_mm: float | None = Field(
        default=None, ge=1.0, le=50.0, description="of the object; from its frames when null"
    )
    radius_sd_mm: float | None = Field(default=None, ge=0.0, le=1000.0)
    reference_radius_mm: float | None = Field(default=None, ge=1.0, le=50.0, description="of the known ball")
    blur_mm: float | None = Field(default=None, ge=0.0, le=1.0)
    drift_sd: float | None = Field(default=None, ge=0.0, le=0.5, description="relative")


EstimateRequest = Annotated[InclusionRequest | HardnessRequest, Field(discriminator="kind")]


class ParameterItem(ItemModel):
    """Posterior of one parameter, in the unit of its name."""

    withheld: str | None = Field(description="why the mean is withheld; null where it is not")
    mean: float | None = Field(description="null where it is withheld")
    sd: float | None = Field(description="null where the mean is withheld")
    interval_90: tuple[float, float] | None = Field(description="null where the estimate is not trusted")
    prior_sd: float
    narrowing: float | None = Field(
        description="sd over prior_sd, 1 where the data are not informative; null where the estimate is not trusted"
    )
    cramer_rao_sd: Measured = Field(description="least sd of any unbiased estimate; null without a bound")
    truth: float | None = Field(default=None, description="of a phantom, where known")


class EstimateItem(ItemModel):
    """A stored estimate with everything that is needed to recompute it."""

    id: str
    kind: str
    made: datetime
    probe: str
    presses: list[str]
    calibration: str
    supersedes: str | None
    parameters: dict[str, ParameterItem]
    presence: float | None = Field(
        description="probability that there is an inclusion; null where not computed or not trusted"
    )
    presence_trusted: bool = Field(description="whether the probability may be used")
    log_bayes_factor: float | None = Field(
        default=None, description="natural logarithm of how much better an inclusion explains the frames, not rounded"
    )
    identifiability: str = Field(description="what the data determine and what not")
    prior: str
    trusted: bool = Field(description="false: the numbers of this estimate are withheld, and null here")
    flags: list[str]
    notes: list[str]
    options: dict[str, Any]
    environment: dict[str, Any]
    provenance: dict[str, Any]


class LumpItem(ItemModel):
    """One lump of a map."""

    name: str
    probability: float
    contrast_above: float | None = Field(description="of the contrast, where only a bound can be told")
    estimate: dict[str, Any] = Field(
        description="parameters as of an estimate, with intervals; the depth is of the top"
    )


class PlaceItem(ItemModel):
    """A place to press next."""

    x_mm: float
    y_mm: float
    gain_nats: float = Field(description="expected gain of information")


class MapItem(ItemModel):
    """A stored map of lumps with everything that is needed to recompute it, without its volumes."""

    id: str
    made: datetime
    probe: str
    presses: list[str]
    calibration: str
    supersedes: str | None
    lumps: list[LumpItem] | None = Field(description="null where the map is not trusted")
    count_probability: list[float] | None = Field(description="of 0, 1, 2, ... lumps")
    next_places: list[PlaceItem] | None
    trusted: bool = Field(description="false: the numbers of this map are withheld, and null here")
    flags: list[str]
    notes: list[str]
    left_out: list[str] = Field(description="presses that were not used, each with its reason")
    options: dict[str, Any]
    environment: dict[str, Any]
    provenance: dict[str, Any]


class EstimatesResponse(ResponseModel):
    """Estimates and maps of a target, the oldest first."""

    command: Literal["estimates"] = "estimates"
    target: int
    in_force: list[str] = Field(description="identities of the last of each kind")
    estimates: list[EstimateItem]
    maps: list[MapItem] = Field(description="maps of lumps under the places of its presses")
    damaged: list[str] = Field(description="one message for each stored estimate or map that was changed")


class RecomputeRequest(RequestModel):
    """How to recompute the current estimates."""

    dry_run: bool = Field(default=False, description="whether to store nothing")


class RecomputationItem(ItemModel):
    """A recomputed estimate."""

    kind: str
    same: bool
    sentence: str = Field(description="how the result changed, and why")
    causes: list[str]
    notes: list[str]
    shifts: tuple[ShiftItem, ...]
    flags_gained: list[str]
    flags_lost: list[str]
    before: str = Field(description="identity of the recomputed estimate")
    stored_as: str | None = Field(description="identity of the new one; null when nothing was stored")


class EstimateResult(ItemModel):
    """An estimate, as it is stored."""

    kind: Literal["estimate"] = "estimate"
    estimate: EstimateItem


class RecomputeResult(ItemModel):
    """Recomputed estimates."""

    kind: Literal["recompute"] = "recompute"
    recomputations: list[RecomputationItem]


class SequenceResult(ItemModel):
    """A sequence on the disk."""

    kind: Literal["sequence"] = "sequence"
    folder: str
    report: RecordingReport


class SearchResult(ItemModel):
    """The cameras that answered."""

    kind: Literal["cameras"] = "cameras"
    found: tuple[CameraInfoItem, ...]
    missing: dict[str, str]


JobResult = Annotated[EstimateResult | RecomputeResult | SequenceResult | SearchResult, Field(discriminator="kind")]


class JobResponse(ResponseModel):
    """A job."""

    command: Literal["job"] = "job"
    job: JobState
    result: JobResult | None = Field(
        default=None,
        description=f"null before it is done, of jobs that the pages began, and of all but the last {RESULTS} results",
    )


class JobsResponse(ResponseModel):
    """The jobs of this console, the newest last."""

    command: Literal["jobs"] = "jobs"
    jobs: tuple[JobState, ...]
