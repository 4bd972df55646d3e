"""Estimates: what is asked for, and what came out."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import Field

from tsis.console.api.models.common import Answer, Given, Identity, Measured, Told

Numbers = Annotated[list[float], Field(min_length=2, max_length=2)]
Presses = Annotated[
    list[Identity] | None,
    Field(min_length=1, max_length=1000, description="presses to use; null for the newest of each role and force"),
]


class InclusionPriorGiven(Given):
    """What is believed of the inclusion and its surroundings before the data; what is left out is as by default."""

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


class HardnessPriorGiven(Given):
    """What is believed of the object before the data; what is left out is as by default."""

    young_kpa: Numbers | None = Field(default=None, description="range within [1, 1e5]")
    poisson: Numbers | None = Field(default=None, description="range within [0.45, 0.495]")


class InclusionGiven(Given):
    """An estimate of an inclusion under the surface."""

    kind: Literal["inclusion"]
    presses: Presses = None
    prior: InclusionPriorGiven | None = None


class HardnessGiven(Given):
    """An estimate of the hardness of an object that is touched itself."""

    kind: Literal["hardness"]
    presses: Presses = None
    prior: HardnessPriorGiven | None = None
    radius_mm: float | None = Field(
        default=None, ge=1.0, le=50.0, description="of the object; from its frames when null"
    )
    radius_sd_mm: float | None = Field(default=None, ge=0.0, le=1000.0)
    reference_radius_mm: float | None = Field(default=None, ge=1.0, le=50.0, description="of the known ball")
    blur_mm: float | None = Field(default=None, ge=0.0, le=1.0)
    drift_sd: float | None = Field(default=None, ge=0.0, le=0.5, description="relative")


EstimateGiven = Annotated[InclusionGiven | HardnessGiven, Field(discriminator="kind")]


class ParameterTold(Told):
    """What is known of one parameter, in the unit that its name carries."""

    mean: float
    sd: float
    interval_90: tuple[float, float]
    prior_sd: float
    narrowing: float = Field(description="sd over prior_sd: 1 says that the data told nothing")
    cramer_rao_sd: Measured = Field(description="least sd of any unbiased estimate; null where nothing bounds it")
    truth: float | None = Field(default=None, description="of a phantom, where somebody knows it")


class EstimateTold(Told):
    """A stored estimate with all that is needed to make it again."""

    id: str
    kind: str
    made: datetime
    probe: str
    presses: list[str]
    calibration: str
    supersedes: str | None
    parameters: dict[str, ParameterTold]
    presence: float | None = Field(description="probability that there is an inclusion; null where nobody asked")
    log_bayes_factor: float | None = Field(
        default=None, description="natural logarithm of how much better an inclusion explains the frames, not rounded"
    )
    identifiability: str = Field(description="what the data tell and what not")
    prior: str
    trusted: bool = Field(description="false says: use no number of this estimate")
    flags: list[str]
    notes: list[str]
    options: dict[str, Any]
    environment: dict[str, Any]
    provenance: dict[str, Any]


class EstimatesAnswer(Answer):
    """Estimates of a target in the order in which they were made."""

    command: Literal["estimates"] = "estimates"
    target: int
    in_force: list[str] = Field(description="identities of the last of each kind")
    estimates: list[EstimateTold]
    damaged: list[str] = Field(description="one sentence for each that is stored but is not as it was")


class RecomputeGiven(Given):
    """How to make the estimates in force again."""

    dry_run: bool = Field(default=False, description="whether to store nothing")


class ShiftTold(Told):
    """How far one parameter moved; `moved` in units of its old standard deviation."""

    name: str
    before: float
    after: float
    interval_before: tuple[float, float]
    interval_after: tuple[float, float]
    moved: Measured


class RecomputationTold(Told):
    """An estimate made again."""

    kind: str
    same: bool
    sentence: str = Field(description="what became of the result, and why")
    causes: list[str]
    notes: list[str]
    shifts: list[ShiftTold]
    flags_gained: list[str]
    flags_lost: list[str]
    before: str = Field(description="identity of the estimate that was made again")
    stored_as: str | None = Field(description="identity of the new one; null when nothing was stored")
