"""Models of presses, targets, estimates and jobs."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import Field

from tsis.calibration.guard import GuardFlag
from tsis.console.api._models import Identity, ItemModel, Measured, RequestModel, ResponseModel, Whole
from tsis.console.api._value_schemas import CameraInfoItem, PressItem, ShiftItem, TargetItem
from tsis.console.services import LONGEST_SEQUENCE_S, MOST_SEQUENCE_FRAMES, RESULTS, SHORTEST_SEQUENCE_S, JobState
from tsis.imaging import COLOUR_MAPS
from tsis.instrument.recording import RecordingReport
from tsis.records.values import LONGEST_NAME, LONGEST_NOTE


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


class EstimatesResponse(ResponseModel):
    """Estimates of a target, the oldest first."""

    command: Literal["estimates"] = "estimates"
    target: int
    in_force: list[str] = Field(description="identities of the last of each kind")
    estimates: list[EstimateItem]
    damaged: list[str] = Field(description="one message for each stored estimate that was changed")


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
