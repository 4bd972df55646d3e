"""Repeatability and reproducibility of a study, and the performance card of a probe."""

from __future__ import annotations

import platform
from dataclasses import asdict
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import InputError
from tsis.present.document import envelope
from tsis.present.figures import agreement_limits, read_over_true
from tsis.present.labels import KNOWN, counted, quantity_of
from tsis.present.page import Card, Page, Picture, Table, on_axes
from tsis.present.study import (
    NUMBERS,
    ends,
    interval_document,
    limit_intervals,
    limit_rows,
    limits_document,
    method_of,
)
from tsis.study.card import OPERATORS
from tsis.study.folder import read_seal
from tsis.study.plan import QUANTITIES
from tsis.study.precision import REPEATABILITY_SD

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from datetime import datetime

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.study.card import PerformanceCard, Precision, PrecisionAnalysis
    from tsis.study.folder import Study
    from tsis.study.precision import Linearity
    from tsis.study.proportions import Interval


PER_CENT = 100.0
METHOD_NOTES = (
    "Within-subject sd: scatter of repeats of one target by one operator (ISO 5725: repeatability). The "
    "repeatability coefficient is 2.77 times as large: two such readings differ by less with a probability of 95 %.",
    "Reproducibility adds the scatter between conditions and how it varies with the target. With two or three of them "
    "its interval is wide, and no number of targets makes it narrow.",
    "Only targets that every condition read completely are used. Targets that are hard to read are among those left "
    "out, so the numbers hold for targets that can be read.",
    "Repeats of the virtual probe differ by its errors alone: an operator's hand adds nothing to them.",
)


def precision_page(analysis: PrecisionAnalysis) -> Page:
    """Numbers, notes, limits of agreement and lines of a study of repeatability."""
    study, results = analysis.study, analysis.results
    return Page(
        title=f"Repeatability, study {study.plan.name}",
        subtitle=f"{', '.join(study.devices)}; {counted(study.plan.repeats, 'repeat')} by each operator",
        cards=tuple(_card(item) for item in results if item.over == OPERATORS),
        notes=precision_notes(analysis),
        pictures=tuple(picture for item in results for picture in _pictures(analysis, item)),
        tables=precision_tables(analysis),
        provenance={
            "study": {"name": study.plan.name, "made": study.plan.made.isoformat(), "tsis": study.plan.tsis},
            "sealed truth (SHA-256)": study.plan.commitment,
            "head of the log": study.chain.head,
        },
    )


def precision_notes(analysis: PrecisionAnalysis) -> tuple[str, ...]:
    """What the numbers mean, and what could not be computed."""
    outliers = [
        f"{_title(item)}: one target scatters more than the others (Cochran's C "
        f"{item.within.largest_variance_fraction:.3f}, limit {item.within.cochran_limit:.3f}, ISO 5725-2)."
        for item in analysis.results
        if item.within.largest_variance_fraction is not None
        and item.within.cochran_limit is not None
        and item.within.largest_variance_fraction > item.within.cochran_limit
    ]
    missing = [f"{device}, {quantity_of(name).label}: {why}." for (device, name), why in analysis.missing.items()]
    return (*missing, *outliers, *METHOD_NOTES)


def precision_tables(analysis: PrecisionAnalysis) -> tuple[Table, ...]:
    """A table of each quantity of each device, then of the devices together."""
    return tuple(
        Table(title=_title(item), columns=NUMBERS, values=tuple(_rows(item)))
        for item in sorted(analysis.results, key=lambda item: item.over != OPERATORS)
    )


def _title(item: Precision) -> str:
    return f"{item.device}: {quantity_of(item.quantity).heading}, over {counted(len(item.conditions), item.over[:-1])}"


def _card(item: Precision) -> Card:
    quantity = quantity_of(item.quantity)
    name, unit = quantity.label, quantity.unit
    interval = coefficient_interval(item)
    return Card(
        title=f"{item.device}: repeatability coefficient, {name}",
        value=f"{item.within.coefficient:.3g} {unit}",
        detail=f"{ends(interval, 2)}, {counted(len(item.complete), 'target')}",
        doubtful=bool(item.incomplete),
    )


def coefficient_interval(item: Precision) -> Interval | None:
    """Interval of the repeatability coefficient; None where repeats never differ."""
    try:
        return item.within.interval()
    except InputError:
        return None


def _between_interval(item: Precision) -> Interval | None:
    try:
        return None if item.between is None else item.between.interval()
    except InputError:
        return None


def _rows(item: Precision) -> Iterator[tuple[str, str, str, str]]:
    within, between, used = item.within, item.between, len(item.complete)
    conditions, repeats = counted(len(item.conditions), item.over[:-1]), counted(item.repeats, "repeat")
    yield ("rests on", f"{counted(used, 'target')}, {conditions}, {repeats}", f"{len(item.incomplete)} left out", "")
    interval = coefficient_interval(item)
    low, high = (None, None) if interval is None else (end / REPEATABILITY_SD for end in interval)
    yield (
        "within-subject sd",
        f"{within.within_sd:.3g}",
        "-" if low is None else f"{low:.3g} to {high:.3g}",
        method_of(interval),
    )
    if within.within_cv is not None:
        yield ("within-subject CV", f"{PER_CENT * within.within_cv:.3g} %", "-", "")
    yield ("repeatability coefficient", f"{within.coefficient:.3g}", ends(interval), method_of(interval))
    if between is not None:
        wide = _between_interval(item)
        spreads = {f"sd of {item.over}": between.operator_sd, "sd of their interaction": between.interaction_sd}
        for name, value in spreads.items():
            yield (name, f"{value:.3g}", "-", "")
        yield ("reproducibility sd", f"{between.sd:.3g}", "-", "")
        yield ("reproducibility coefficient", f"{between.coefficient:.3g}", ends(wide), method_of(wide))
    for pair, limits in item.limits.items():
        for name, shown, ends_text, method in limit_rows(item.quantity, limits):
            yield (f"{pair[0]} less {pair[1]}, {name.partition(': ')[2]}", shown, ends_text, method)
    bias, _ = limit_intervals(item.errors)
    yield ("bias", f"{item.errors.bias:+.3g}", ends(bias), method_of(bias))
    yield ("bias over the true value", f"{PER_CENT * item.relative_bias:+.3g} %", "-", "")
    if item.line is None:
        yield ("line over the true values", "none", "needs 4 targets, 3 true values", "")
    else:
        yield from _line(item.line)


def _line(line: Linearity) -> Iterator[tuple[str, str, str, str]]:
    for name, value, interval in (
        ("slope of the line, 1 is right", line.slope, line.slope_interval()),
        ("intercept of the line, 0 is right", line.intercept, line.intercept_interval()),
    ):
        yield (name, f"{value:.3f}", ends(interval), method_of(interval))
    yield ("scatter about the line", f"{line.scatter_sd:.3g}", f"R^2 {line.r_squared:.3f}", "")
    yield ("curvature beside the line", f"p = {line.curvature_p:.2g}", "-", "Student")


def _pictures(analysis: PrecisionAnalysis, item: Precision) -> Iterator[Picture]:
    name = quantity_of(item.quantity).label
    if item.over == OPERATORS:
        read, true = means_over_true(analysis.study, item)
        yield Picture(
            title=f"{item.device}: {name} read over true",
            draw=on_axes(read_over_true, true, read, label=quantity_of(item.quantity).heading),
            size=(4.6, 4.2),
            alt=f"Mean reading of {counted(len(item.complete), 'target')} over the true {name}",
            caption="Mean of all readings of each target.",
        )
    for pair, limits in item.limits.items():
        yield Picture(
            title=f"{name}: {pair[0]} less {pair[1]}",
            draw=on_axes(agreement_limits, limits, label=quantity_of(item.quantity).heading),
            size=(4.6, 4.2),
            alt=f"Differences of {counted(limits.targets, 'target')} over their means",
            caption=f"{item.device}. First readings; dashed the limits between which 95 % of differences lie.",
        )


def means_over_true(study: Study, item: Precision) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean readings of the complete targets, and their true values, both of shape (targets,)."""
    import numpy as np

    truths = read_seal(study)[0].truths
    values: dict[str, list[float]] = {code: [] for code in item.complete}
    for reading in study.readings:
        if reading.device == item.device and reading.code in values and item.quantity in reading.values:
            values[reading.code].append(reading.values[item.quantity])
    read = [float(np.mean(values[code])) for code in item.complete]
    return np.array(read), np.array([truths[code].values[item.quantity] for code in item.complete])


def precision_document(analysis: PrecisionAnalysis) -> dict[str, Any]:
    """The numbers as JSON values; null where a value is unknown."""
    return envelope(
        "study repeatability",
        study={"name": analysis.study.plan.name, "repeats": analysis.study.plan.repeats},
        results=[_result(item) for item in analysis.results],
        missing=[
            {"device": device, "quantity": name, "reason": why} for (device, name), why in analysis.missing.items()
        ],
        head=analysis.study.chain.head,
    )


def _result(item: Precision) -> dict[str, Any]:
    within, between, line = item.within, item.between, item.line
    return {
        **{name: getattr(item, name) for name in ("quantity", "device", "over", "repeats")},
        "conditions": list(item.conditions),
        "complete": list(item.complete),
        "incomplete": list(item.incomplete),
        "repeatability": {
            **{name: getattr(within, name) for name in ("within_sd", "within_cv", "degrees_of_freedom", "coefficient")},
            "interval": interval_document(coefficient_interval(item)),
            **{name: getattr(within, name) for name in ("largest_variance_fraction", "cochran_limit")},
        },
        "reproducibility": None
        if between is None
        else {
            **{name: getattr(between, name) for name in ("operator_sd", "interaction_sd", "sd", "coefficient")},
            "interval": interval_document(_between_interval(item)),
        },
        "limits_of_agreement": [
            {"first": pair[0], "second": pair[1], **limits_document(limits)} for pair, limits in item.limits.items()
        ],
        "errors": {**limits_document(item.errors), "relative_bias": item.relative_bias},
        "line": None
        if line is None
        else {
            **asdict(line),
            "slope_interval": interval_document(line.slope_interval()),
            "intercept_interval": interval_document(line.intercept_interval()),
        },
    }


RESULTS = {True: "passed", False: "FAILED", None: "not checked"}
CARD_NUMBERS = ("quantity", "repeat sd", "coefficient", "between operators", "bias", "slope", "90 % holds", "rests on")
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
            *(_quantity_card(item) for item in card.results[:2]),
        ),
        notes=(
            *(f"Not measured: {why}." for why in card.missing),
            "Two readings of a phantom differ by less than the coefficient with a probability of 95 %.",
            "The card holds for phantoms like these. Undecided readings: "
            f"{len(card.decisions.undecided)} of {len(card.decisions.targets)} phantoms.",
        ),
        pictures=_card_pictures(card),
        tables=(
            Table(title="Numbers with 95 % intervals", columns=CARD_NUMBERS, values=numbers),
            Table(
                title="Uncertainty of a reading: standard deviations by source",
                columns=SOURCES,
                values=tuple(_uncertainty(item, card.stated.get(item.quantity)) for item in card.results),
            ),
            Table(title="Phantoms", columns=PHANTOMS, values=tuple(_phantoms(card))),
            Table(title="Checks", columns=("check", "found", "required", "result"), values=checks),
        ),
        provenance=_provenance(card),
    )


def _named(check: str) -> str:
    """Name of a check with the quantity as people write it."""
    quantity, colon, rest = check.partition(": ")
    return f"{quantity_of(quantity).label}: {rest}" if colon and quantity in KNOWN else check


def _quantity_card(item: Precision) -> Card:
    quantity = quantity_of(item.quantity)
    name, unit = quantity.label, quantity.unit
    return Card(
        title=f"repeatability coefficient, {name}",
        value=f"{item.within.coefficient:.2g} {unit}",
        detail=f"{ends(coefficient_interval(item), 2)}; bias {item.errors.bias:+.2g} {unit}",
    )


def _row(card: PerformanceCard, item: Precision) -> tuple[str, ...]:
    bias, _ = limit_intervals(item.errors)
    hits, count = card.covered.get(item.quantity, (0, 0))
    return (
        quantity_of(item.quantity).heading,
        f"{item.within.within_sd:.2g}",
        f"{item.within.coefficient:.2g} ({ends(coefficient_interval(item), 2)})",
        "-" if item.between is None else f"{item.between.coefficient:.2g}",
        f"{item.errors.bias:+.2g} ({ends(bias, 2)})",
        "-" if item.line is None else f"{item.line.slope:.2f} ({ends(item.line.slope_interval(), 2)})",
        f"{hits} of {count}" if count else "-",
        f"{counted(len(item.complete), 'phantom')}, {len(item.conditions)} x {item.repeats}",
    )


def _card_pictures(card: PerformanceCard) -> tuple[Picture, ...]:
    def line(item: Precision, ax: Axes) -> None:
        read, true = means_over_true(card.study, item)
        read_over_true(true, read, ax, label=quantity_of(item.quantity).heading)

    def limits(item: Precision, ax: Axes) -> None:
        agreement_limits(next(iter(item.limits.values())), ax, label=quantity_of(item.quantity).heading)

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

    alt = f"{title}: {', '.join(quantity_of(item.quantity).label for item in items)}"
    size = (2.6 * len(items), 2.4)
    return (Picture(title=title, draw=draw, size=size, alt=alt, caption=caption, wide=True),) if items else ()


def _uncertainty(item: Precision, stated: float | None) -> tuple[str, ...]:
    """Standard deviations of one reading by their source, beside the one that the device states."""
    between, unit = item.between, quantity_of(item.quantity).unit
    parts = (
        item.within.within_sd,
        None if between is None else between.operator_sd,
        None if between is None else between.interaction_sd,
        item.errors.standard_deviation,
        stated,
    )
    cells = ("-" if part is None else f"{part:.2g} {unit}" for part in parts)
    return (quantity_of(item.quantity).label, *cells)


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
