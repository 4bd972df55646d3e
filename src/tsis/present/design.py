"""Analysis of probe designs before a probe is built, and its report."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.imaging.sensor import Sensor
from tsis.inclusion import InclusionPrior
from tsis.inclusion.design.alternatives import ASPECTS, CRITERIA, compare_designs, design_alternatives, rank_designs
from tsis.inclusion.design.protocol import protocol_of
from tsis.inclusion.design.search import MOST_EVALUATIONS, optimise_design
from tsis.inclusion.prior import PARAMETERS
from tsis.inclusion.tissue import protocol_forces
from tsis.model.probe import Probe
from tsis.model.require import require_integer, require_one_of, require_type
from tsis.present.document import envelope
from tsis.present.figures import design_errors
from tsis.present.labels import quantity_of
from tsis.present.page import Card, Page, Picture, Table
from tsis.virtual.probe import nominal_calibration

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.figure import Figure

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
    question: DesignQuestion, result: tuple[Design, ...], optimum: DesignOptimum | None = None
) -> DesignAnalysis:
    """Rank the designs."""
    designs = [*result, *([] if optimum is None else [optimum.best])]
    return DesignAnalysis(question=question, designs=rank_designs(designs, question.criterion), optimum=optimum)


HEADINGS = ("design", "d / mm", "h / mm", "E / kPa", "known", "strain", "whole", "grey", "breaks")
CROSSES = "Nearer to the corner is better; crosses break a limit."


def design_document(design: DesignAnalysis) -> dict[str, Any]:
    """The analysis as a JSON document."""
    question, best = design.question, design.optimum
    return envelope(
        "design",
        planned=asdict(question.planned),
        criterion=question.criterion,
        designs=[_document(design) for design in design.designs],
        optimum=None if best is None else _optimum_document(best),
        prior=asdict(question.prior),
        calibration=design_calibration().provenance(),
        sensor=asdict(SENSOR),
        light="traced" if question.traced else "even",
    )


def design_rows(designs: Sequence[Design]) -> tuple[tuple[str, ...], ...]:
    """The designs under `HEADINGS`, in their order."""
    return tuple(_row(design) for design in designs)


def design_caption(designs: Sequence[Design]) -> str:
    """Caption of `design_rows`."""
    return (
        f"Expected errors over {len(designs[0].information.inclusions)} inclusions, best first; what breaks a limit "
        "comes last."
    )


def design_notes(design: DesignAnalysis) -> tuple[str, ...]:
    """Notes on the table: prior errors, meaning of the columns, broken limits, the optimum."""
    before = design.question.prior.sd
    broken = {
        f"{design.protocol.name}: {message}" for design in design.designs for message in design.limits.broken.values()
    }
    return (
        f"Before any press: d {before['diameter_mm']:.2f} mm, h {before['depth_mm']:.2f} mm, "
        f"E {before['young_kpa']:.1f} kPa.",
        "known: fraction of the inclusions whose modulus would be known to 20 kPa; whole: fraction on which the whole "
        "face touches in the weakest press; grey: the brightest pixel.",
        *sorted(broken),
        *(() if design.optimum is None else _optimum_notes(design.optimum)),
    )


def draw_errors(designs: Sequence[Design], figure: Figure) -> None:
    """Draw errors of depth over diameter and of modulus over depth, with a numbered point for each design."""
    left, right = figure.subplots(1, 2)
    design_errors(designs, ("diameter_mm", "depth_mm"), left)
    design_errors(designs, ("depth_mm", "young_kpa"), right)
    figure.legend(*left.get_legend_handles_labels(), loc="outside right upper", fontsize=8, markerscale=0.8)


def design_page(design: DesignAnalysis) -> Page:
    """The report: errors of the planned design beside the prior, their plot, and all designs."""
    designs = design.designs
    return Page(
        title="Predicted performance",
        subtitle=design.planned.protocol.described,
        cards=(*(_card(design, name) for name in PARAMETERS), _best_card(design)),
        notes=design_notes(design),
        pictures=(
            Picture(
                title="Expected errors",
                draw=partial(draw_errors, designs),
                size=(11.0, 4.0),
                alt=f"Expected errors of {len(designs)} designs; the best is {design.best.protocol.name}. The table "
                "below holds the numbers.",
                caption=CROSSES,
                wide=True,
            ),
        ),
        tables=(Table(title=design_caption(designs), columns=HEADINGS, values=design_rows(designs)),),
    )


def _card(response: DesignAnalysis, name: str) -> Card:
    design = response.planned
    quantity = quantity_of(name)
    unit, digits = quantity.unit, quantity.decimals
    error, before = design.information.rmse[name], response.question.prior.sd[name]
    return Card(
        title=f"{quantity.label.capitalize()}, as planned",
        value=f"± {error:.{digits}f} {unit}",
        detail=f"before any press ± {before:.{digits}f} {unit}",
        doubtful=bool(design.limits.broken),
    )


def _best_card(design: DesignAnalysis) -> Card:
    best, criterion = design.best, design.question.criterion
    by = "all three together" if criterion == "all" else quantity_of(criterion).axis
    return Card(
        title="Best of all",
        value=best.protocol.name,
        detail=f"by {by}" + ("; it breaks a limit, as all do" if best.limits.broken else ""),
        doubtful=bool(best.limits.broken),
    )


def _row(design: Design) -> tuple[str, ...]:
    errors, limits = design.information.rmse, design.limits
    return (
        design.protocol.name,
        f"{errors['diameter_mm']:.2f}",
        f"{errors['depth_mm']:.2f}",
        f"{errors['young_kpa']:.1f}",
        f"{design.information.identified_fraction:.0%}",
        f"{limits.strain:.2f}",
        f"{limits.whole_fraction:.0%}",
        f"{limits.brightest_grey:.0f}",
        ", ".join(limits.broken),
    )


def _document(design: Design) -> dict[str, Any]:
    information = design.information
    bound = information.cramer_rao_sd
    return {
        "name": design.protocol.name,
        "presses": design.protocol.described,
        "layers_young_kpa": [layer.young_kpa for layer in design.protocol.probe.layers],
        "face_curvature_mm": design.protocol.probe.face_curvature_mm,
        "expected_rmse": information.rmse,
        "modulus_identified_share": information.identified_fraction,
        "mean_log_narrowing": information.log_sd,
        "limits": asdict(design.limits),
        "broken": design.limits.broken,
        "inclusions": [
            {"inclusion": inclusion, "expected_sd": sd, "cramer_rao_sd": least if np.isfinite(least).all() else None}
            for inclusion, sd, least in zip(
                information.inclusions.tolist(), information.expected_sd.tolist(), bound.tolist(), strict=True
            )
        ],
    }


def _optimum_document(best: DesignOptimum) -> dict[str, Any]:
    return {
        "stiffening": best.stiffening,
        "gradient": best.gradient,
        "forces_n": list(best.best.protocol.forces_n),
        "binding": list(best.binding),
        "evaluations": best.evaluations,
    }


def _optimum_notes(best: DesignOptimum) -> tuple[str, ...]:
    layers = ", ".join(f"{layer.young_kpa:.3g}" for layer in best.best.protocol.probe.layers)
    forces = " and ".join(f"{force:.2g}" for force in best.best.protocol.forces_n)
    binding = ", ".join(best.binding) or "nothing; it lies inside the search"
    return (
        f"Best found after {best.evaluations} stacks: layers of {layers} kPa from the tissue up, pressed at "
        f"{forces} N.",
        f"What binds it: {binding}.",
    )
