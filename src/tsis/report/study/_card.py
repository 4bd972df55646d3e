"""A probe's performance card, as a page of two sheets and as a JSON document."""

from __future__ import annotations

import platform
from dataclasses import asdict
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.plots import agreement_limits, read_over_true
from tsis.report._document import envelope
from tsis.report._page import Card, Page, Picture, Table
from tsis.report.study._document import NAMES, counted, ends, labelled, limit_intervals
from tsis.report.study._precision import coefficient_interval, means_over_true
from tsis.study.plan import QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from datetime import datetime

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tsis.study.card import PerformanceCard, Precision


RESULTS = {True: "passed", False: "FAILED", None: "not checked"}
NUMBERS = ("quantity", "repeat sd", "coefficient", "between operators", "bias", "slope", "90 % holds", "rests on")
SOURCES = ("quantity", "repeats (A)", "operators (A)", "operator x phantom (A)", "phantoms, error (A)", "stated (B)")
PHANTOMS = ("phantom", "inclusion", "diameter / mm", "depth / mm", "modulus / kPa", "readings with a size")
VERSIONS = ("numpy", "scipy")


def card_page(card: PerformanceCard, *, now: datetime) -> Page:
    """Two sheets: numbers, checks, lines over the true values, dates and versions."""
    counts, failed = card.decisions.counts(), [check for check in card.checks if check.passed is False]
    detected = "-" if counts is None else f"{counts.true_positives} of {counts.present}"
    alarms = "-" if counts is None else f"{counts.false_positives} of {counts.absent}"
    numbers = tuple(_row(card, item) for item in card.results)
    checks = tuple((_named(entry.name), entry.found, entry.required, RESULTS[entry.passed]) for entry in card.checks)
    return Page(
        title=f"Performance card: {card.device}",
        subtitle=f"study {card.study.plan.name}, {card.study.plan.made:%Y-%m-%d}; card of {now:%Y-%m-%d}",
        cards=(
            Card(
                title="checks",
                value="all passed" if card.passed else f"{len(failed)} failed",
                detail=f"{sum(check.passed is not None for check in card.checks)} checked",
                doubtful=not card.passed,
            ),
            Card(title="inclusions found", value=detected, detail=f"false alarms: {alarms}"),
            *(_card(item) for item in card.results[:2]),
        ),
        notes=(
            *(f"Not measured: {why}." for why in card.missing),
            "Two readings of a phantom differ by less than the coefficient with a probability of 95 %.",
            "The card holds for phantoms like these. Undecided readings: "
            f"{len(card.decisions.undecided)} of {len(card.decisions.targets)} phantoms.",
        ),
        pictures=_pictures(card),
        tables=(
            Table(title="Numbers with 95 % intervals", headings=NUMBERS, rows=numbers),
            Table(
                title="Uncertainty of a reading: standard deviations by source",
                headings=SOURCES,
                rows=tuple(_uncertainty(item, card.stated.get(item.quantity)) for item in card.results),
            ),
            Table(title="Phantoms", headings=PHANTOMS, rows=tuple(_phantoms(card))),
            Table(title="Checks", headings=("check", "found", "required", "result"), rows=checks),
        ),
        provenance=_provenance(card),
    )


def _named(check: str) -> str:
    """Name of a check with the quantity as people write it."""
    quantity, colon, rest = check.partition(": ")
    return f"{NAMES[quantity][0]}: {rest}" if colon and quantity in NAMES else check


def _card(item: Precision) -> Card:
    name, unit = NAMES[item.quantity]
    return Card(
        title=f"repeatability coefficient, {name}",
        value=f"{item.within.coefficient:.2g} {unit}",
        detail=f"{ends(coefficient_interval(item), 2)}; bias {item.errors.bias:+.2g} {unit}",
    )


def _row(card: PerformanceCard, item: Precision) -> tuple[str, ...]:
    bias, _ = limit_intervals(item.errors)
    hits, count = card.covered.get(item.quantity, (0, 0))
    return (
        labelled(item.quantity),
        f"{item.within.within_sd:.2g}",
        f"{item.within.coefficient:.2g} ({ends(coefficient_interval(item), 2)})",
        "-" if item.between is None else f"{item.between.coefficient:.2g}",
        f"{item.errors.bias:+.2g} ({ends(bias, 2)})",
        "-" if item.line is None else f"{item.line.slope:.2f} ({ends(item.line.slope_interval(), 2)})",
        f"{hits} of {count}" if count else "-",
        f"{counted(len(item.complete), 'phantom')}, {len(item.conditions)} x {item.repeats}",
    )


def _pictures(card: PerformanceCard) -> tuple[Picture, ...]:
    def line(item: Precision, ax: Axes) -> None:
        read, true = means_over_true(card.study, item)
        read_over_true(true, read, ax, label=labelled(item.quantity))

    def limits(item: Precision, ax: Axes) -> None:
        agreement_limits(next(iter(item.limits.values())), ax, label=labelled(item.quantity))

    paired = [item for item in card.results if item.limits]
    names = " less ".join(next(iter(paired[0].limits))) if paired else ""
    return (
        *_row_of("Read over true", "Mean of all readings of each phantom.", card.results, line),
        *_row_of(f"Operator {names}", "First readings; dashed the 95 % limits of agreement.", paired, limits),
    )


def _row_of(
    title: str, caption: str, items: Sequence[Precision], plot: Callable[[Precision, Axes], None]
) -> tuple[Picture, ...]:
    """One wide picture with a panel for each quantity; none without any."""

    def draw(figure: Figure) -> None:
        for ax, item in zip(np.atleast_1d(figure.subplots(1, len(items))), items, strict=True):
            plot(item, ax)

    alt = f"{title}: {', '.join(NAMES[item.quantity][0] for item in items)}"
    size = (2.6 * len(items), 2.4)
    return (Picture(title=title, draw=draw, size=size, alt=alt, caption=caption, wide=True),) if items else ()


def _uncertainty(item: Precision, stated: float | None) -> tuple[str, ...]:
    """Standard deviations of one reading by their source, beside the one that the device states."""
    between, unit = item.between, NAMES[item.quantity][1]
    parts = (
        item.within.within_sd,
        None if between is None else between.operator_sd,
        None if between is None else between.interaction_sd,
        item.errors.standard_deviation,
        stated,
    )
    cells = ("-" if part is None else f"{part:.2g} {unit}" for part in parts)
    return (NAMES[item.quantity][0], *cells)


def _phantoms(card: PerformanceCard) -> Iterator[tuple[str, ...]]:
    """Mean reading of each phantom beside its true values."""
    for target in card.decisions.targets:
        own = [r for r in card.study.readings if r.code == target.code and r.device == card.device and r.values]
        cells = []
        for name in QUANTITIES:
            read = [reading.values[name] for reading in own if name in reading.values]
            mean = f"{np.mean(read):.3g}" if read else "-"
            cells.append(f"{mean} (true {target.truth.values[name]:.3g})" if target.truth.has_inclusion else mean)
        score = "undecided" if target.score is None else "found" if card.decisions.calls(target) else "none"
        yield (target.truth.label, score, *cells, str(len(own)))


def _provenance(card: PerformanceCard) -> dict[str, Any]:
    plan, calibration = card.study.plan, card.calibration
    unblinded = card.study.unblinded
    return {
        "study": {"made": f"{plan.made:%Y-%m-%d %H:%M}", "unblinded": unblinded.moment if unblinded else "-"},
        "protocol": {"probe": plan.probe, "forces_n": list(plan.forces_n), "repeats": plan.repeats},
        "calibration": "not given" if calibration is None else calibration.identity,
        "sealed truth (SHA-256)": plan.commitment,
        "head of the log": card.study.chain.head,
        "versions": {"tsis of the study": plan.tsis, "python": platform.python_version()}
        | {name: version(name) for name in VERSIONS},
    }


def card_document(card: PerformanceCard, *, now: datetime) -> dict[str, Any]:
    """The card as JSON values; the whole precision is in ``tsis study repeatability``."""
    counts = card.decisions.counts()
    return envelope(
        "study card",
        device=card.device,
        passed=card.passed,
        made=now.isoformat(),
        checks=[asdict(check) for check in card.checks],
        detection=None
        if counts is None
        else {name: getattr(counts, name) for name in ("true_positives", "present", "false_positives", "absent")},
        quantities=[
            {
                "quantity": item.quantity,
                "within_sd": item.within.within_sd,
                "repeatability_coefficient": item.within.coefficient,
                "reproducibility_coefficient": None if item.between is None else item.between.coefficient,
                "bias": item.errors.bias,
                "slope": None if item.line is None else item.line.slope,
                "stated_sd": card.stated.get(item.quantity),
                "covered": list(card.covered.get(item.quantity, (0, 0))),
                "phantoms": len(item.complete),
            }
            for item in card.results
        ],
        missing=list(card.missing),
        provenance=_provenance(card),
    )
