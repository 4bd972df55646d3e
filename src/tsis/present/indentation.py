"""Page of moduli from curves of force over depth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.hardness.curve_flags import INDENTATION_FLAGS
from tsis.hardness.force_curves import repeated_modulus
from tsis.hardness.shore import shore
from tsis.present.labels import counted
from tsis.present.page import Card, Column, Page, Picture, Table, flags_table, on_axes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes

    from tsis.model.estimate import Estimate

MOST_PICTURES = 12
LEAST_SHORE_KPA = 0.1


def indentation_page(estimates: Sequence[Estimate], *, provenance: Mapping[str, Any]) -> Page:
    """One row and one picture a curve, and the flags of all."""
    flags = list(dict.fromkeys(flag for estimate in estimates for flag in estimate.flags))
    drawn = [estimate for estimate in estimates if "fit" in estimate.provenance]
    return Page(
        title="Modulus from force curves",
        subtitle=counted(len(estimates), "curve"),
        cards=tuple(_card(estimate) for estimate in estimates[:1]) if len(estimates) == 1 else (),
        notes=(*_repeats(estimates), *dict.fromkeys(note for estimate in estimates for note in _notes(estimate))),
        pictures=tuple(_picture(estimate) for estimate in drawn[:MOST_PICTURES]),
        tables=(indentation_table(estimates), *flags_table(flags, INDENTATION_FLAGS)),
        provenance=provenance,
    )


def indentation_table(estimates: Sequence[Estimate]) -> Table:
    """Modulus, interval, Shore reading, depth and flags of each curve."""
    columns = (
        "curve",
        Column(label="modulus", unit="kPa", form=".3g"),
        Column(label="90 % from", unit="kPa", form=".3g"),
        Column(label="to", unit="kPa", form=".3g"),
        Column(label="Shore 00", form=".0f"),
        Column(label="depth", unit="µm", form=".3g"),
        "flags",
    )
    return Table(title="Moduli", columns=columns, values=tuple(_row(estimate) for estimate in estimates))


def curve_name(estimate: Estimate) -> str:
    """Name of the curve, or a general one."""
    return str(estimate.provenance["curve"]["name"] or "curve")


def _row(estimate: Estimate) -> tuple[str | float | None, ...]:
    withheld = bool(estimate.withheld_reason("young_kpa"))
    mean = None if withheld else estimate.mean["young_kpa"]
    low, high = estimate.interval()["young_kpa"] if estimate.trusted else (None, None)
    reading = shore(mean).shore_00 if mean is not None and LEAST_SHORE_KPA <= mean <= 1e6 else None
    fit = estimate.provenance.get("fit")
    depth = None if fit is None else 1e3 * fit["depth_mm"]
    return curve_name(estimate), mean, low, high, reading, depth, ", ".join(estimate.flags) or "none"


def _repeats(estimates: Sequence[Estimate]) -> tuple[str, ...]:
    """A sentence on several curves as repeats of one sample."""
    found = repeated_modulus(estimates)
    if found is None:
        return ()
    low, high = found.interval_kpa
    return (
        f"As repeats of one sample, {found.count} curves give {found.young_kpa:.3g} kPa, 90 % interval {low:.3g} to "
        f"{high:.3g} kPa; from curve to curve they scatter by {100 * found.scatter:.0f} %, which their own intervals "
        "leave out.",
    )


def _notes(estimate: Estimate) -> tuple[str, ...]:
    return tuple(f"{curve_name(estimate)}: {note}" for note in estimate.printed_notes)


def _card(estimate: Estimate) -> Card:
    withheld = estimate.withheld_reason("young_kpa")
    detail = ""
    if estimate.trusted:
        low, high = estimate.interval()["young_kpa"]
        detail = f"90 % interval {low:.3g} to {high:.3g} kPa"
    value = withheld or f"{estimate.mean['young_kpa']:.3g} kPa"
    return Card(title="Young's modulus", value=value, detail=detail, doubtful=bool(withheld))


def _picture(estimate: Estimate) -> Picture:
    return Picture(
        title=curve_name(estimate),
        draw=on_axes(force_over_depth, estimate),
        size=(4.2, 3.0),
        alt="Force over depth below the first contact, and the fitted force",
    )


def force_over_depth(estimate: Estimate, ax: Axes) -> Axes:
    """Draw the used part of the curve and the fitted force over the depth below the first contact."""
    fit = estimate.provenance["fit"]
    depth = 1e3 * (np.array(fit["position_mm"]) - fit["contact_mm"])
    power = 3 * np.floor(np.log10(max(fit["peak_n"], 1e-15)) / 3)
    unit = {0: "N", -3: "mN", -6: "µN", -9: "nN", -12: "pN"}.get(int(power), f"1e{int(power)} N")
    ax.plot(depth, np.array(fit["force_n"]) / 10**power, ".", markersize=3, label="curve")
    ax.plot(depth, np.array(fit["fitted_n"]) / 10**power, linewidth=1, label="fit")
    ax.set(xlabel="depth / µm", ylabel=f"force / {unit}")
    ax.legend(frameon=False, loc="upper left")  # above the curve; to look for the best place takes long
    return ax
