"""Report of a probe's calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.calibration.file import calibration_sha256
from tsis.calibration.measured import MeasuredValue
from tsis.files.json_values import to_json_value
from tsis.model.calibration import BEND_TERMS, GROWTH_TERMS
from tsis.present.document import envelope
from tsis.present.figures import dot_board, force_residuals, force_sums, hysteresis_loops
from tsis.present.labels import plain_number
from tsis.present.page import Card, Page, Picture, Table, on_axes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure

    from tsis.calibration.dents import DentLight
    from tsis.calibration.file import ProbeCalibration
    from tsis.calibration.force_line import ForceLine, Loading
    from tsis.calibration.session import SessionResult


PER_CENT = 100.0
LEAST_HELD = 0.9  # share of the presses in the 95 % interval of a force line that is as good as it says
Row = tuple[str, str, str]
MEASURED = ("quantity", "value", "95 % interval")


def calibration_document(
    calibration: ProbeCalibration, findings: SessionResult, *, provenance: Mapping[str, Any]
) -> dict[str, Any]:
    """A calibration as a JSON document."""
    saturation = findings.response.saturation
    return envelope(
        "calibrate",
        name=calibration.name,
        sha256=calibration_sha256(calibration),
        values=measured_values(calibration),
        saturation_kpa={"value": saturation.value_kpa, "identified": saturation.identified},
        made=None if calibration.made is None else calibration.made.isoformat(),
        expires=None if calibration.expires is None else calibration.expires.isoformat(),
        provenance=dict(provenance),
    )


def measured_values(calibration: ProbeCalibration) -> dict[str, dict[str, Any]]:
    """Numbers with their uncertainty as JSON values."""
    return {
        name: {"value": value.value, "sd": value.sd, "interval_95": list(value.interval()), "unit": value.unit}
        for name, value in _measured(calibration).items()
    }


def calibration_rows(
    calibration: ProbeCalibration, findings: SessionResult, *, identified: bool = True
) -> tuple[Row, ...]:
    """Quantity, value and 95 % interval of all measurements; the identity only of a calibration that is a file."""
    saturation = findings.response.saturation
    low, high = saturation.interval()
    upper = f"{high:.4g} kPa" if saturation.identified else "open above"
    content = (row for row in content_rows(calibration) if identified or row[0] != "identity")
    rows = (*content, ("saturation", f"{saturation.value_kpa:.4g} kPa", f"{low:.4g} to {upper}"))
    fractions = {
        "largest departure of the mean of tips from the line": findings.line.linearity,
        "hysteresis": findings.line.hysteresis,
        "largest tip against the one before, at 0.8 N": findings.line.tip_difference,
    }
    shown = (*rows, *(_fraction_row(name, value) for name, value in fractions.items() if value is not None))
    return shown if findings.dents is None else (*shown, *light_rows(findings.dents))


def light_rows(dents: DentLight) -> tuple[Row, ...]:
    """Quantity, value and standard uncertainty of the light on dents."""
    light = dents.response.light
    assert light is not None  # of every fit
    middle = len(light.x_mm) // 2
    growth_sd, flux_sd = (float(np.linalg.norm(light.factor[row])) for row in (0, GROWTH_TERMS + BEND_TERMS))
    return (
        _spread_row("gain on tissue over that of the tips", dents.gain_ratio, dents.gain_ratio * dents.gain_sd, ""),
        _spread_row(
            "growth of the light, middle of the face", float(light.growth_per_mm[middle, middle]), growth_sd, "per mm"
        ),
        _spread_row("flux of the light, rim of the pads", float(light.flux_x[middle, -1]), flux_sd, ""),
        ("standard deviation of the light of the strongest press on a pad", f"{dents.product_sd:.1%}", ""),
        (f"dents by {dents.presses} presses on pads, up to", f"{dents.displacement_mm:.2f} mm", ""),
        ("misfit of the pads, 1 or less expected", f"{dents.misfit:.2f}", ""),
    )


def content_rows(calibration: ProbeCalibration, *, cited: str = "") -> tuple[Row, ...]:
    """Quantity, value and interval from the file itself; ``cited`` is its identity where only a part is shown."""
    rows = [
        ("probe", calibration.probe or "not named", ""),
        ("camera", calibration.camera or "not named", ""),
        *((f"setting {name}", f"{value:g}", "") for name, value in calibration.settings.items()),
        ("made", "simulated" if calibration.made is None else f"{calibration.made:%Y-%m-%d %H:%M}", ""),
        ("good until", _expiry(calibration), ""),
        ("identity", (cited or calibration_sha256(calibration))[:12], ""),
    ]
    rows += [_row(name, value) for name, value in _measured(calibration).items()]
    if (line := calibration.force_line) is not None:
        rows.append(("range of force", f"{line.least_n:.2f} to {line.most_n:.2f} N", ""))
    if (response := calibration.response) is not None:
        gain = response.gain_grey_per_kpa
        rows.append(_spread_row("gain", gain, gain * response.gain_sd, "grey/kPa"))
    if (tissue := calibration.tissue) is not None:
        rows.append(("gain on tissue, fitted with the light", f"{tissue.gain_grey_per_kpa:.4g} grey/kPa", ""))
    return tuple(rows)


def specification_rows(calibration: ProbeCalibration) -> tuple[tuple[str, str, str, str], ...]:
    """The sheet: quantity, measured, fingertip, printed in the dissertation."""
    rows = () if calibration.specification is None else calibration.specification.rows
    measured = ("not measured" if row.measured is None else _shown(row.measured, row.unit) for row in rows)
    return tuple((row.quantity, text, row.fingertip, row.printed) for row, text in zip(rows, measured, strict=True))


def specification_tables(calibration: ProbeCalibration) -> tuple[Table, ...]:
    """The specification sheet; no table where there is none."""
    rows = specification_rows(calibration)
    columns = ("quantity", "measured", "fingertip", "printed in the source")
    return (Table(title="Specification sheet (table 4.1)", columns=columns, values=rows),) if rows else ()


def content_tables(calibration: ProbeCalibration) -> tuple[Table, ...]:
    """What a calibration file holds, and its specification sheet."""
    title = f"Calibration {calibration.name}"
    content = Table(title=title, columns=MEASURED, values=content_rows(calibration))
    return (content, *specification_tables(calibration))


def specification_notes(calibration: ProbeCalibration) -> tuple[str, ...]:
    """Notes for the comparison of the columns of the sheet."""
    rows = () if calibration.specification is None else calibration.specification.rows
    return tuple(f"{row.quantity[0].upper()}{row.quantity[1:]}: {row.note}." for row in rows if row.note)


def calibration_notes(calibration: ProbeCalibration, findings: SessionResult) -> tuple[str, ...]:
    """Notes on the limits of the numbers."""
    scale, line = calibration.scale, calibration.force_line
    notes = []
    if findings.dots.distorted:
        notes.append(
            f"The lens distorts: elsewhere in the frame the scale differs by up to {findings.dots.largest_change:.1%}."
        )
    if scale is not None:
        notes.append(f"Scale from {scale.count} dots, which the fit leaves {scale.residual_px:.2f} px off.")
    if line is not None and line.assumed_tip_share > 0:
        notes.append("One tip only: how much tips differ was assumed, as printed in the source (2.45 %).")
    if not findings.response.saturation.identified:
        notes.append("No press came near saturation: it has a lower end only. Press harder with the smallest tip.")
    if findings.line.saturated:
        notes.append("Pixels clipped in the heaviest presses, which end the range of force.")
    if calibration.reference is not None and calibration.reference.flat_frames == 0:
        notes.append("No flat field was taken: light counts as even.")
    if calibration.reference is not None and calibration.reference.patch_px is None:
        notes.append("No reference patch: the lamps' drift is not corrected but counted as 1 % of every force.")
    if calibration.tissue is None:
        notes.append(
            "The light on dents was not measured: estimates of inclusions are wide (tsis calibrate --pad-kpa 5)."
        )
    return tuple(notes)


def line_card(line: ForceLine, loadings: Sequence[Loading]) -> Card:
    """Whether the presses lie as near the force line as its uncertainty says."""
    load_n = np.concatenate([loading.load_n for loading in loadings])
    sums = np.concatenate([loading.total_grey for loading in loadings])
    slope = line.slope_grey_per_n.value
    departure_n = (sums - line.intercept_grey.value) / slope - load_n
    half_n = np.array([np.ptp(line.with_uncertainty(float(force)).interval()) / 2 for force in load_n])
    share = float(np.mean(np.abs(departure_n) <= half_n))
    low, high = PER_CENT * departure_n.min() / line.most_n, PER_CENT * departure_n.max() / line.most_n
    return Card(
        title="Fit of the force line",
        value="as good as it says" if share >= LEAST_HELD else "worse than it says",
        detail=f"{share:.0%} of {len(load_n)} presses lie in its 95 % interval; they depart by {low:+.1f} to "
        f"{high:+.1f} % of the range",
        doubtful=share < LEAST_HELD,
    )


def calibration_page(
    calibration: ProbeCalibration,
    findings: SessionResult,
    *,
    provenance: Mapping[str, Any],
    saved: ProbeCalibration | None = None,
) -> Page:
    """The report of a calibration: numbers, notes, figures of the residuals, tables.

    ``saved`` is the calibration in the file, where it is not the measured one: at another exposure, for another use.
    """
    other = None if saved == calibration else saved
    line, scale = calibration.force_line, calibration.scale
    assert line is not None  # a session measures both
    assert scale is not None

    def residuals(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        force_residuals(findings.loadings, line, left)
        hysteresis_loops(findings.loadings, right)

    x, y = scale.mm_per_pixel
    force = line.slope_grey_per_n
    cards = (
        Card(title="Scale", value=f"{x:.5f} x {y:.5f} mm", detail=f"a pixel, from {scale.count} dots"),
        Card(title="Force", value=f"{plain_number(force.value)} grey/N", detail=f"sd {force.sd / force.value:.2%}"),
        line_card(line, findings.loadings),
        Card(title="Good until", value=_expiry(calibration)),
    )
    pictures = (
        Picture(
            title="Sum of grey levels over the force",
            draw=on_axes(force_sums, findings.loadings, line),
            size=(6.4, 4.2),
            alt="Sums of grey levels rise in a straight line with the force; rings loading, crosses unloading",
        ),
        Picture(
            title="Residuals of the line, and hysteresis",
            draw=residuals,
            size=(9.6, 4.0),
            alt="Departures from the line in per cent of the range, and loading less unloading, by tip",
            wide=True,
        ),
        Picture(
            title="The dot board",
            draw=on_axes(dot_board, findings.dots, image=findings.board, scale=scale),
            size=(6.4, 4.4),
            alt="Frame of the board with the detected dots, their lattice, and the magnified residuals",
        ),
    )
    return Page(
        title=f"Calibration {calibration.name}",
        subtitle=f"probe {calibration.probe}, camera {calibration.camera}",
        cards=cards,
        notes=(*calibration_notes(calibration, findings), *specification_notes(calibration)),
        pictures=pictures,
        tables=(
            *((Table(title=f"Saved: {other.name}", columns=MEASURED, values=content_rows(other)),) if other else ()),
            Table(
                title="Measured at the settings of the session" if other else "Measured",
                columns=MEASURED,
                values=calibration_rows(calibration, findings, identified=other is None),
            ),
            *specification_tables(calibration),
        ),
        provenance={**provenance, "line": to_json_value(findings.line)},
    )


def _expiry(calibration: ProbeCalibration) -> str:
    return "does not age" if calibration.expires is None else f"{calibration.expires:%Y-%m-%d}"


def _measured(calibration: ProbeCalibration) -> dict[str, MeasuredValue]:
    values: dict[str, MeasuredValue] = {}
    if (scale := calibration.scale) is not None:
        values |= {"scale x": scale.mm_per_pixel_x, "scale y": scale.mm_per_pixel_y}
    if (noise := calibration.reference) is not None:
        values |= {"read noise": noise.read_noise_grey, "shot noise": noise.shot_noise_grey}
        values["stray light"] = noise.stray_grey
    if (line := calibration.force_line) is not None:
        values |= {"force line, intercept": line.intercept_grey, "force line, slope": line.slope_grey_per_n}
    return values


def _row(name: str, value: MeasuredValue) -> Row:
    low, high = value.interval()
    return name, f"{plain_number(value.value, 5)} {value.unit}".strip(), _interval(low, high)


def _interval(low: float, high: float) -> str:
    return f"{plain_number(low, 5)} to {plain_number(high, 5)}"


def _spread_row(name: str, value: float, sd: float, unit: str) -> Row:
    """A value with the 95 % interval of its standard deviation."""
    return _row(name, MeasuredValue(value=value, sd=sd, unit=unit))


def _fraction_row(name: str, value: MeasuredValue) -> Row:
    low, high = value.interval()
    return name, f"{PER_CENT * value.value:.2f} %", f"{PER_CENT * low:.2f} to {PER_CENT * high:.2f} %"


def _shown(value: MeasuredValue, unit: str) -> str:
    low, high = value.interval()
    if not unit:
        return f"{PER_CENT * value.value:.2f} % ({PER_CENT * low:.2f} to {PER_CENT * high:.2f})"
    return f"{value.value:.3g} {unit} ({low:.3g} to {high:.3g})"
