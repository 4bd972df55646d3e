"""Report of an estimate of an inclusion."""

from __future__ import annotations

import itertools
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.imaging.corrections import subtract_background
from tsis.inclusion.flags import AT_PRIOR_END, INCLUSION_FLAGS
from tsis.model.estimate import INTERVAL_LEVEL, NO_UNIT, label_of, probability_text
from tsis.present.document import estimate_messages, sd_text
from tsis.present.figures import marginal, posterior, tissue_section, trade_off
from tsis.present.images import (
    change_picture,
    force_of,
    frame_picture,
    profile_picture,
    surface_picture,
)
from tsis.present.labels import quantity_of
from tsis.present.page import Card, Column, Page, Picture, Table, flags_table, on_axes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.inclusion import InclusionPrior
    from tsis.inclusion.budget import UncertaintyBudget
    from tsis.model.budget import QuantityBudget
    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage
    from tsis.present.page import Value


_AT_PRIOR_ENDS = frozenset(flag.name for flag in AT_PRIOR_END.values())
LIKELY = 0.95  # probability from which an inclusion is shown as certain


def inclusion_page(
    estimate: Estimate,
    *,
    title: str,
    subtitle: str,
    targets: Sequence[TactileImage],
    references: Sequence[TactileImage],
    prior: InclusionPrior,
    ring_edges_mm: NDArray[np.float64],
    truth: Mapping[str, float] | None = None,
    provenance: Mapping[str, Any] | None = None,
    budget: UncertaintyBudget | None = None,
    forces: Mapping[str, QuantityBudget] = MappingProxyType({}),
    notes: Sequence[str] = (),
) -> Page:
    """The page of an estimate: images, surface, posterior with the truth where known, and provenance.

    Pictures show the target of the highest force and the reference nearest to it; the profiles show all frames.

    Parameters
    ----------
    estimate
        The estimate.
    title, subtitle
        Heading of the page.
    targets, references
        The presses on the target, at least one, and the reference presses, each of known force.
    prior
        Ranges of the plots.
    ring_edges_mm
        Rings of the profile.
    truth
        True parameters of a virtual phantom.
    provenance
        Additions to the provenance of the estimate.
    budget, forces
        Uncertainty budgets of the estimate, and of the forces by the name of the frame.
    notes
        Further messages.
    """
    target, reference = _shown(targets, references)
    return Page(
        title=title,
        subtitle=subtitle,
        cards=inclusion_cards(estimate, truth),
        notes=(
            *estimate_messages(estimate),
            *(() if budget is None else budget_notes(budget)),
            *notes,
        ),
        pictures=(
            *((marginals_picture(estimate, prior, truth),) if estimate.trusted else ()),
            *_image_pictures(target, reference),
            profile_picture({"target": targets, "plain tissue": references}, ring_edges_mm),
            *((trade_off_picture(estimate, truth),) if estimate.trusted else ()),
        ),
        tables=(
            estimate_table(estimate, truth=truth),
            *flags_table(estimate.flags, INCLUSION_FLAGS),
            *(() if budget is None else budget_tables(budget, forces)),
        ),
        provenance={**(provenance or {}), **estimate.provenance},
    )


def _shown(
    targets: Sequence[TactileImage], references: Sequence[TactileImage]
) -> tuple[TactileImage, TactileImage | None]:
    """The target of the highest force, and the reference whose force is nearest."""
    target = max(targets, key=force_of)
    return target, min(references, key=lambda frame: abs(force_of(frame) - force_of(target)), default=None)


def estimate_table(estimate: Estimate, *, title: str = "Result", truth: Mapping[str, float] | None = None) -> Table:
    """Mean and interval of each parameter, what the data narrowed and could at best narrow, and the truth if known.

    An sd may lie below the least sd of an unbiased estimate (Cramér-Rao), which uses no prior. Of an estimate that is
    not to be trusted the table has only what was believed before.
    """
    columns: tuple[str | Column, ...] = (
        "quantity",
        Column(label="mean", form=".3g"),
        f"{INTERVAL_LEVEL:.0%} interval".replace("%", " %"),
        *(Column(label=label, form=sd_text) for label in ("sd", "prior sd", "least sd without prior")),
    )
    names = dict.fromkeys((*estimate.names, *(truth or ())))
    rows = [(*_estimate_row(estimate, name), *(() if not truth else (truth.get(name, "not known"),))) for name in names]
    return Table(
        title=title, columns=(*columns, *((Column(label="truth", form=".4g"),) if truth else ())), values=tuple(rows)
    )


def _estimate_row(estimate: Estimate, name: str) -> tuple[Value, ...]:
    label = quantity_of(name).axis
    if name not in estimate.names:
        return (label, "not estimated", "", "", "", "")
    withheld, prior_sd = estimate.withheld_reason(name), estimate.prior_sd[name]
    if not estimate.trusted:
        return (label, withheld, "", "", prior_sd, "")
    low, high = estimate.interval(INTERVAL_LEVEL)[name]
    bound = estimate.cramer_rao_sd.get(name, np.inf)  # of a hardness nobody computes it
    return (
        label,
        withheld or estimate.mean[name],
        f"{low:.3g} to {high:.3g}",
        estimate.sd[name] if estimate.identified(name) else "",
        prior_sd,
        bound if np.isfinite(bound) else "none known",
    )


def budget_tables(budget: UncertaintyBudget, forces: Mapping[str, QuantityBudget]) -> tuple[Table, ...]:
    """The uncertainty budget of each parameter that is not withheld, and of each force."""
    titled = [(f"Uncertainty budget: {label_of(name)}", quantity) for name, quantity in budget.quantities.items()]
    titled += [(f"Uncertainty budget: force in {name}", quantity) for name, quantity in forces.items()]
    return tuple(
        Table(title=f"{title} {_uncertain(quantity)}", columns=_headings(quantity.unit), values=_budget_rows(quantity))
        for title, quantity in titled
    )


def _headings(unit: str) -> tuple[str, ...]:
    sensitivity, contribution = f"sensitivity / {unit} per unit", f"contribution / {unit}"
    return "source", "type, distribution", "standard uncertainty", sensitivity, contribution, "variance"


def _uncertain(quantity: QuantityBudget) -> str:
    """The value and its expanded uncertainty to two digits."""
    expanded = quantity.expanded
    decimals = int(np.clip(1 - np.floor(np.log10(expanded)), 0, 9)) if expanded > 0 else 3
    text = f"{quantity.value:.{decimals}f} ± {expanded:.{decimals}f} {quantity.unit}"
    return f"{text} (95 %, k = {quantity.coverage_factor:.3g})"


def _budget_rows(quantity: QuantityBudget) -> tuple[tuple[str, ...], ...]:
    rows = [
        (
            part.source,
            f"{part.evaluation}, {part.distribution}",
            _with_unit(part.standard_uncertainty, part.unit),
            f"{part.sensitivity:.3g}",
            f"{part.contribution:.2g}",
            f"{quantity.fraction(part):.1%}",
        )
        for part in quantity.components
    ]
    totals = [("combined", f"{quantity.combined:.3g}", "100.0%"), ("expanded", f"{quantity.expanded:.3g}", "")]
    if quantity.sampled_sd is not None and quantity.departure is not None:
        totals.append(("sd of the samples", f"{quantity.sampled_sd:.3g}", f"{quantity.departure:+.0%}"))
    return (*rows, *((name, "", "", "", number, note) for name, number, note in totals))


def _with_unit(value: float, unit: str) -> str:
    return f"{value:.3g}" if unit == NO_UNIT else f"{value:.3g} {unit}"


def budget_notes(budget: UncertaintyBudget) -> tuple[str, ...]:
    """A message for each parameter without a budget."""
    return tuple(
        f"The uncertainty budget of the {label_of(name)} is withheld: {reason}."
        for name, reason in budget.withheld.items()
    )


def inclusion_cards(estimate: Estimate, truth: Mapping[str, float] | None = None) -> tuple[Card, ...]:
    """A card for each parameter, without a number for an untrusted estimate, and one for the presence."""
    return (*(_card(estimate, name, truth or {}) for name in estimate.names), *_presence_card(estimate))


def _card(estimate: Estimate, name: str, truth: Mapping[str, float]) -> Card:
    heading, unit = quantity_of(name).title, quantity_of(name).unit
    true = [f"truth {truth[name]:.3g} {unit}"] if name in truth else []
    withheld = estimate.withheld_reason(name)
    if not estimate.trusted:
        return Card(title=heading, value=withheld, detail="; ".join(true), doubtful=True)
    low, high = estimate.interval(INTERVAL_LEVEL)[name]
    interval = f"{low:.3g} to {high:.3g} {unit}"
    value = interval if withheld else f"{estimate.mean[name]:.3g} {unit}"
    detail = [withheld or f"90 % interval {interval}", *true]
    doubtful = bool(withheld) or not _AT_PRIOR_ENDS.isdisjoint(estimate.flags)  # which makes all intervals wrong
    return Card(title=heading, value=value, detail="; ".join(detail), doubtful=doubtful)


def _presence_card(estimate: Estimate) -> tuple[Card, ...]:
    if estimate.presence is None:
        return ()
    withheld = "" if estimate.presence_trusted else "not to be trusted"
    return (
        Card(
            title="Is there an inclusion?",
            value=withheld or probability_text(estimate.presence),
            detail="probability of an inclusion over plain, even tissue",
            doubtful=bool(withheld) or estimate.presence < LIKELY,
        ),
    )


def marginals_picture(estimate: Estimate, prior: InclusionPrior, truth: Mapping[str, float] | None) -> Picture:
    """Posterior of each parameter of a trusted estimate against its prior."""

    def marginals(figure: Figure) -> None:
        axes = figure.subplots(1, len(estimate.names), squeeze=False)[0]
        for name, ax in zip(estimate.names, axes, strict=True):
            marginal(estimate, name, ax, prior_range=getattr(prior, name), truth=(truth or {}).get(name))
        axes[0].legend(frameon=False, fontsize=8)

    intervals = estimate.interval(INTERVAL_LEVEL)
    text = ", ".join(f"{name} {low:.3g} to {high:.3g}" for name, (low, high) in intervals.items())
    marked = "" if not truth else " The dashed line is the truth."
    return Picture(
        title="Posterior of each parameter",
        draw=marginals,
        size=(9.5, 2.8),
        alt=f"Posterior of each parameter, 90 % intervals: {text}",
        caption=f"Posterior (blue) against the uniform prior (grey), 90 % interval shaded.{marked}",
        wide=True,
    )


def estimate_pictures(estimate: Estimate) -> tuple[Picture, ...]:
    """The posterior of each parameter beside its prior, and the section of the tissue; without numbers if withheld."""
    why = f"Withheld: {', '.join(estimate.flags)}" if not estimate.trusted else ""

    def marginals(figure: Figure) -> None:
        posterior(estimate, figure)

    parameters = Picture(
        title="Posterior of each parameter",
        draw=marginals,
        size=(4.4, 1.6 * len(estimate.names)),  # as narrow as the place beside a live image
        alt=why or f"Posterior of {', '.join(estimate.names)} with the 90 % interval and the prior",
        caption="" if why else "Posterior (blue) against the prior (grey), 90 % interval shaded.",
    )
    if not {"diameter_mm", "depth_mm"} <= set(estimate.names):
        return (parameters,)
    section = Picture(
        title="Section of the tissue, to scale",
        draw=on_axes(tissue_section, estimate),
        size=(4.4, 3.6),
        alt=why or "Outlines of the inclusion below the surface, drawn from the posterior",
        caption="" if why else "Each thin outline is a sample of the posterior; the thick one has the medians.",
    )
    return (parameters, section)


def trade_off_picture(estimate: Estimate, truth: Mapping[str, float] | None) -> Picture:
    """Joint posteriors of all pairs of at least two parameters of a trusted estimate."""

    def pairs(figure: Figure) -> None:
        names = list(itertools.combinations(estimate.names, 2))
        for (item, other), ax in zip(names, figure.subplots(1, len(names), squeeze=False)[0], strict=True):
            point = (truth[item], truth[other]) if truth and item in truth and other in truth else None
            trade_off(estimate, (item, other), ax, truth=point)

    marked = "" if not truth else " The cross is the truth."
    return Picture(
        title="Which parameters trade off",
        draw=pairs,
        size=(9.5, 3.0),
        alt="Joint posterior of each pair of parameters",
        caption=f"Joint posteriors: a slanted band is a combination known better than its parts.{marked}",
        wide=True,
    )


def _image_pictures(target: TactileImage, reference: TactileImage | None) -> tuple[Picture, ...]:
    signal = target if reference is None else subtract_background(target, reference)
    change = () if reference is None else (change_picture(signal),)
    return (frame_picture(target), *change, surface_picture(signal))
