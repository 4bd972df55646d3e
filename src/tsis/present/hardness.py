"""Report of an object's hardness by direct contact."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.hardness.flags import HARDNESS_FLAGS
from tsis.hardness.shore import shore
from tsis.model.estimate import INTERVAL_LEVEL
from tsis.present.document import estimate_messages
from tsis.present.figures import contact_growth, modulus, tactile_image
from tsis.present.inclusion import estimate_table, inclusion_cards
from tsis.present.page import Card, Page, Picture, Table, flags_table, on_axes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tsis.hardness.table import ContactTable
    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage
    from tsis.records.values import StoredEstimate


def hardness_page(
    estimate: Estimate,
    *,
    title: str,
    images: Sequence[TactileImage],
    table: ContactTable,
    provenance: Mapping[str, Any],
    truth_kpa: float | None = None,
) -> Page:
    """The page of a hardness estimate: the modulus, the growth of the contact, the frames and notes.

    ``table`` has the contact radii of the probe, ``provenance`` versions, files and options; ``truth_kpa`` is the true
    modulus where known.
    """
    growth = on_axes(contact_growth, estimate, table=table)
    pictures = [
        *([modulus_picture(estimate, truth_kpa)] if estimate.trusted else []),
        _picture(
            "Growth of the contact", growth, "Contact radius over force, of the frames and, if trusted, of the estimate"
        ),
    ]
    pictures += [_frame(image) for image in images]
    return Page(
        title=title,
        subtitle=", ".join(image.name for image in images),
        cards=(hardness_card(estimate, truth_kpa),),
        notes=hardness_notes(estimate),
        pictures=tuple(pictures),
        tables=(hardness_table(estimate, truth_kpa=truth_kpa), *flags_table(estimate.flags, HARDNESS_FLAGS)),
        provenance=provenance,
    )


def hardness_card(estimate: Estimate, truth_kpa: float | None = None) -> Card:
    """The modulus, if trusted, with the truth where known."""
    withheld = estimate.withheld_reason("young_kpa")
    interval = [f"90 % interval {_interval_text(estimate)}"] if estimate.trusted else []
    truth = [] if truth_kpa is None else [f"truth {truth_kpa:.3g} kPa"]
    return Card(
        title="Young's modulus",
        value=withheld or f"{estimate.mean['young_kpa']:.3g} kPa",
        detail="; ".join(interval + truth),
        doubtful=bool(withheld),
    )


def modulus_picture(estimate: Estimate, truth_kpa: float | None = None) -> Picture:
    """Posterior of the modulus of a trusted estimate."""
    density = on_axes(modulus, estimate, truth_kpa=truth_kpa)
    return _picture("Modulus", density, "Posterior density of the modulus with its 90 % interval")


def hardness_table(estimate: Estimate, *, title: str = "Result", truth_kpa: float | None = None) -> Table:
    """Modulus, Shore readings and contacts, and the true modulus where known."""
    true = () if truth_kpa is None else (("true modulus", f"{truth_kpa:g} kPa"),)
    return Table(title=title, columns=("quantity", "value"), values=(*hardness_rows(estimate), *true))


def hardness_rows(estimate: Estimate) -> tuple[tuple[str, str], ...]:
    """Names and values for people, without the modulus of an untrusted estimate."""
    withheld = estimate.withheld_reason("young_kpa")
    rows = [("Young's modulus", withheld or f"{estimate.mean['young_kpa']:.3g} kPa")]
    if estimate.trusted:
        rows.append(("90 % interval", _interval_text(estimate)))
    if not withheld:
        readings = shore(estimate.mean["young_kpa"])
        for name, value in (("Shore 00", readings.shore_00), ("Shore A", readings.shore_a)):
            rows.append((f"{name} (converted)", "outside the scale" if value is None else f"{value:.0f}"))
    for press in estimate.provenance.get("presses", ()):
        contact, name = press["seen"], press["name"] or "image"
        radius = f"{contact['radius_mm']:.3f} mm ± {100 * contact['radius_sd']:.2f} %"
        rows += [(f"contact radius, {name}", radius), (f"force by light, {name}", f"{contact['light_force_n']:.3g} N")]
    return tuple(rows)


def hardness_notes(estimate: Estimate) -> tuple[str, ...]:
    """Messages on a hardness estimate, the most important first."""
    messages = [estimate.printed_identifiability, *estimate.printed_notes]
    if not estimate.withheld_reason("young_kpa"):
        messages.append(f"Shore readings are converted, not measured. {shore(estimate.mean['young_kpa']).source}.")
    return (*messages, f"Prior: {estimate.prior}.")


def _interval_text(estimate: Estimate) -> str:
    low, high = estimate.interval(INTERVAL_LEVEL)["young_kpa"]
    return f"{low:.3g} to {high:.3g} kPa"


def _picture(title: str, draw: Any, alt: str) -> Picture:
    return Picture(title=title, draw=draw, size=(4.2, 3.0), alt=alt)


def _frame(image: TactileImage) -> Picture:
    return Picture(
        title=image.name or "Frame",
        draw=on_axes(tactile_image, image),
        size=(4.2, 3.0),
        alt=f"Grey levels of {image.name or 'a frame'}",
        caption=f"{image.force_n:g} N.",
    )


HARDNESS = "hardness"


def estimate_cards(stored: StoredEstimate, truth: Mapping[str, float]) -> tuple[Card, ...]:
    """The numbers of an estimate of either kind, with the truth where known."""
    if stored.kind == HARDNESS:
        return (hardness_card(stored.estimate, truth.get("young_kpa")),)
    return inclusion_cards(stored.estimate, truth)


def estimate_table_of(stored: StoredEstimate, truth: Mapping[str, float]) -> Table:
    """All numbers of an estimate of either kind, with the truth where known."""
    if stored.kind == HARDNESS:
        return hardness_table(stored.estimate, title="All numbers", truth_kpa=truth.get("young_kpa"))
    return estimate_table(stored.estimate, title="All numbers", truth=truth)


def estimate_messages_of(stored: StoredEstimate) -> tuple[str, ...]:
    """Messages on an estimate of either kind, the most important first."""
    return hardness_notes(stored.estimate) if stored.kind == HARDNESS else estimate_messages(stored.estimate)
