"""Analysis of probe designs by the nominal calibration of a camera."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from tsis.imaging.sensor import Sensor
from tsis.inclusion import InclusionPrior
from tsis.inclusion.design.alternatives import ASPECTS, CRITERIA, compare_designs, design_alternatives, rank_designs
from tsis.inclusion.design.protocol import protocol_of
from tsis.inclusion.design.search import MOST_EVALUATIONS, optimise_design
from tsis.inclusion.tissue import protocol_forces
from tsis.model.probe import Probe
from tsis.model.require import require_integer, require_one_of, require_type
from tsis.virtual.probe import nominal_calibration

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.inclusion.design.alternatives import Design
    from tsis.inclusion.design.protocol import Protocol
    from tsis.inclusion.design.search import DesignOptimum
    from tsis.model.calibration import Calibration


QUICK_DEGREES = ("forces", "frames", "reference")  # aspects that need one solution of the press
PLANNED = "as planned"


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignQuestion:
    """A planned probe with its presses, and the designs to compare it with.

    Parameters
    ----------
    probe
        The planned probe.
    forces_n
        Forces of the presses in newtons; 0.5 and 1 on a dome, else 1 when empty.
    with_reference
        Whether there is a reference press on tissue without inclusion.
    frames_per_press
        Number of frames of each press.
    compared
        Aspects to vary, of `tsis.inclusion.design.alternatives.ASPECTS`.
    criterion
        Criterion of the ranking and the search: ``"all"``, or the error of a parameter.
    traced
        Whether the light is that of the lamps; else it is uniform.
    evaluations
        Stacks of layers that the search may solve, in [1, 25]; no search when None.
    prior
        Ranges of the inclusions for the mean errors, and the prior of the tissue.

    Raises
    ------
    InputError
        When a value lies outside its range, or a name is unknown.
    """

    probe: Probe
    forces_n: tuple[float, ...] = ()
    with_reference: bool = True
    frames_per_press: int = 1
    compared: tuple[str, ...] = QUICK_DEGREES
    criterion: str = "all"
    traced: bool = False
    evaluations: int | None = None
    prior: InclusionPrior = field(default_factory=InclusionPrior)

    def __post_init__(self) -> None:
        require_type("probe", self.probe, Probe)
        for aspect in self.compared:
            require_one_of("aspect", aspect, ASPECTS)
        require_type("prior", self.prior, InclusionPrior)
        require_one_of("criterion", self.criterion, CRITERIA)
        if self.evaluations is not None:
            require_integer("evaluations", self.evaluations, 1, MOST_EVALUATIONS)
        _ = self.planned

    @property
    def planned(self) -> Protocol:
        """The probe with its presses."""
        forces = self.forces_n or protocol_forces(self.probe, tissue_young_kpa=self.prior.tissue_young_kpa)
        once = protocol_of(self.probe, tuple(forces), with_reference=self.with_reference)
        return replace(once, frames_each=self.frames_per_press, name=PLANNED)

    @property
    def protocols(self) -> tuple[Protocol, ...]:
        """The planned protocol, then each different alternative."""
        planned = self.planned
        changed = [other for aspect in self.compared for other in design_alternatives(planned, aspect)]  # type: ignore[arg-type]
        return (planned, *{other.name: other for other in changed}.values())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DesignAnalysis:
    """The designs and the result of the search, if any.

    ``designs`` includes the optimum: best first by the criterion, those that break a limit last.
    """

    question: DesignQuestion
    designs: tuple[Design, ...]
    optimum: DesignOptimum | None = None

    @property
    def planned(self) -> Design:
        """The planned design."""
        return next(design for design in self.designs if design.protocol.name == PLANNED)

    @property
    def best(self) -> Design:
        """The first design; it breaks a limit when all do."""
        return self.designs[0]


SENSOR = Sensor()


def design_calibration() -> Calibration:
    """The nominal calibration of a planned probe."""
    return nominal_calibration(SENSOR)


def compared_designs(
    question: DesignQuestion, *, progress: Callable[[int, int], None] | None = None
) -> tuple[Design, ...]:
    """Evaluate the planned design and its alternatives; the press of a new probe takes seconds and is cached.

    ``progress`` is called with (done, all) designs and may raise to stop.
    """
    return compare_designs(
        question.protocols,
        of=question.probe,
        prior=question.prior,
        calibration=design_calibration(),
        sensor=SENSOR,
        traced=question.traced,
        progress=progress,
    )


def searched_design(
    question: DesignQuestion, *, progress: Callable[[int, int], None] | None = None
) -> DesignOptimum | None:
    """Optimise the moduli of the layers and the forces, which takes minutes; None without a search."""
    if question.evaluations is None:
        return None
    return optimise_design(
        question.planned,
        prior=question.prior,
        calibration=design_calibration(),
        sensor=SENSOR,
        criterion=question.criterion,
        evaluations=question.evaluations,
        traced=question.traced,
        progress=progress,
    )


def analyse_designs(
    question: DesignQuestion, designs: tuple[Design, ...], optimum: DesignOptimum | None = None
) -> DesignAnalysis:
    """Rank the designs, the optimum of a search among them."""
    ranked = rank_designs([*designs, *([] if optimum is None else [optimum.best])], question.criterion)
    return DesignAnalysis(question=question, designs=ranked, optimum=optimum)
