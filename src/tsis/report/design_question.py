"""What somebody wants to know of a probe before it is built, and the designs that answer it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from tsis.imaging.sensor import Sensor
from tsis.inclusion import (
    InclusionPrior,
    compare_designs,
    design_alternatives,
    optimise_design,
    protocol_of,
    rank_designs,
)
from tsis.inclusion.design_alternatives import ASPECTS, CRITERIA
from tsis.inclusion.design_search import MOST_EVALUATIONS
from tsis.model import Probe
from tsis.model.check import require_integer, require_one_of, require_type
from tsis.virtual.probe import nominal_calibration

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.inclusion import Design, DesignOptimum, Protocol
    from tsis.model import Calibration

FLAT_N, DOMED_N = (1.0,), (0.5, 1.0)  # under a dome two forces load the tissue in two different ways
QUICK = ("forces", "frames", "reference")  # of one probe, whose press is solved once
PLANNED = "as planned"


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignQuestion:
    """What would a probe and its presses tell, and what would others?

    Parameters
    ----------
    probe
        What presses.
    forces_n
        Forces of the presses in newtons; 0.5 and 1 on a dome, else 1 when empty.
    with_reference
        Whether plain tissue nearby is pressed too.
    frames_each
        How often each press is made.
    compared
        What is changed, of `tsis.inclusion.design_alternatives.ASPECTS`; nothing when empty.
    criterion
        What designs are ranked and searched by: ``"all"``, or one parameter's error.
    traced
        Whether the lamps light the face; else it is lit evenly.
    evaluations
        Stacks of layers that a search for better ones may solve, in [1, 25]; no search when None.

    Raises
    ------
    InputError
        When a value lies outside its range, or a name is unknown.
    """

    probe: Probe
    forces_n: tuple[float, ...] = ()
    with_reference: bool = True
    frames_each: int = 1
    compared: tuple[str, ...] = QUICK
    criterion: str = "all"
    traced: bool = False
    evaluations: int | None = None

    def __post_init__(self) -> None:
        require_type("probe", self.probe, Probe)
        for aspect in self.compared:
            require_one_of("aspect", aspect, ASPECTS)
        require_one_of("criterion", self.criterion, CRITERIA)
        if self.evaluations is not None:
            require_integer("evaluations", self.evaluations, 1, MOST_EVALUATIONS)
        _ = self.planned

    @property
    def planned(self) -> Protocol:
        """The probe with its presses."""
        forces = self.forces_n or (FLAT_N if self.probe.face_curvature_mm is None else DOMED_N)
        once = protocol_of(self.probe, tuple(forces), with_reference=self.with_reference)
        return replace(once, frames_each=self.frames_each, name=PLANNED)

    @property
    def protocols(self) -> tuple[Protocol, ...]:
        """The planned one first, then each other with its own name."""
        planned = self.planned
        changed = [other for aspect in self.compared for other in design_alternatives(planned, aspect)]  # type: ignore[arg-type]
        return (planned, *{other.name: other for other in changed}.values())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DesignAnswer:
    """The designs, best first, and the best that a search has found.

    Attributes
    ----------
    question
        What was asked.
    designs
        Best first by the question's criterion, those that break a limit last; the searched one among them.
    optimum
        What the search found; None without one.
    """

    question: DesignQuestion
    designs: tuple[Design, ...]
    optimum: DesignOptimum | None = None

    @property
    def planned(self) -> Design:
        """The design that was asked for."""
        return next(one for one in self.designs if one.protocol.name == PLANNED)

    @property
    def best(self) -> Design:
        """The first in order; it may break a limit when all do."""
        return self.designs[0]


SENSOR, PRIOR = Sensor(), InclusionPrior()


def design_calibration() -> Calibration:
    """The calibration that a planned probe is judged with: nobody has measured one yet."""
    return nominal_calibration(SENSOR)


def compared_designs(
    question: DesignQuestion, *, progress: Callable[[int, int], None] | None = None
) -> tuple[Design, ...]:
    """Judge the planned design and its alternatives; a new probe's press takes seconds to solve and is kept.

    Parameters
    ----------
    question
        What is asked.
    progress
        Called with (designs done, designs in all); what it raises ends the work.
    """
    return compare_designs(
        question.protocols,
        of=question.probe,
        prior=PRIOR,
        calibration=design_calibration(),
        sensor=SENSOR,
        traced=question.traced,
        progress=progress,
    )


def searched_design(
    question: DesignQuestion, *, progress: Callable[[int, int], None] | None = None
) -> DesignOptimum | None:
    """Search the layers' moduli and the forces, for minutes; None when the question asks for no search."""
    if question.evaluations is None:
        return None
    return optimise_design(
        question.planned,
        prior=PRIOR,
        calibration=design_calibration(),
        sensor=SENSOR,
        criterion=question.criterion,
        evaluations=question.evaluations,
        traced=question.traced,
        progress=progress,
    )


def answered(question: DesignQuestion, found: tuple[Design, ...], optimum: DesignOptimum | None = None) -> DesignAnswer:
    """Put what was found in order."""
    designs = [*found, *([] if optimum is None else [optimum.best])]
    return DesignAnswer(question=question, designs=rank_designs(designs, question.criterion), optimum=optimum)
