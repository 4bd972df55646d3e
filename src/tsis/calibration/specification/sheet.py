"""The specification sheet of table 4.1, measured for any probe beside the figures of the human fingertip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.calibration.force.quality import WIDEST
from tsis.calibration.measured import MeasuredValue  # noqa: TC001 - the file format reads the type
from tsis.model.check import require_one_of, require_type

if TYPE_CHECKING:
    from tsis.calibration.force.line import ForceLine, ForceLineDiagnostics

SENSITIVITY_NOTE = (
    "the source's text gives the probe 2.5e-3 N and the fingertip 2.0e-2 N, its table 4.1 gives 2.0e-3 N and 2.5e-2 N"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpecificationRow:
    """One line of the sheet.

    Attributes
    ----------
    quantity, unit
        What was measured, and its unit; empty for a share.
    measured
        The number with its uncertainty; None when it was not measured.
    fingertip
        What the source says of the human fingertip, in words and its own unit.
    printed
        What the source says of its probe.
    note
        What one must know to compare them.
    """

    quantity: str
    unit: str
    measured: MeasuredValue | None
    fingertip: str
    printed: str
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Specification:
    """A probe's specification sheet.

    Attributes
    ----------
    probe
        Name of the probe.
    rows
        Lines of the sheet.
    """

    probe: str
    rows: tuple[SpecificationRow, ...]

    def __getitem__(self, quantity: str) -> SpecificationRow:
        """The line of a quantity; `UnknownNameError` when there is none."""
        by_name = {row.quantity: row for row in self.rows}
        return by_name[require_one_of("quantity", quantity, by_name)]


def specification_sheet(
    *,
    probe: str,
    line: ForceLine,
    diagnostics: ForceLineDiagnostics,
    edge_mm: MeasuredValue | None = None,
    frames_per_s: MeasuredValue | None = None,
) -> Specification:
    """Write the sheet of what was measured; what was not stays empty and is never copied from the source.

    Parameters
    ----------
    probe
        Name of the probe.
    line, diagnostics
        The force line of this probe, by `fit_force_line`.
    edge_mm
        Width in mm in which an edge of contact rises from 10 to 90 %, by `edge_width`.
    frames_per_s
        Rate at which frames arrived, by `frame_rate`.

    Raises
    ------
    InputError
        When ``probe`` is no text.
    """
    require_type("probe", probe, str)
    return Specification(
        probe=probe,
        rows=(
            SpecificationRow(
                quantity="spatial resolution",
                unit="mm",
                measured=edge_mm,
                fingertip="0.1 mm",
                printed="9.8 um",
                note="10 to 90 % of an edge of contact; the printed 9.8 um is the pitch of the sensor's pixels",
            ),
            SpecificationRow(
                quantity="frame rate",
                unit="1/s",
                measured=frames_per_s,
                fingertip="0 to 100 Hz",
                printed="0 to 30 Hz",
                note="frames a second; what can be followed without aliasing is half of it",
            ),
            SpecificationRow(
                quantity="smallest detectable force",
                unit="N",
                measured=diagnostics.detectable_n,
                fingertip="2.5e-2 N",
                printed="2.0e-3 N",
                note=f"5 % false alarms and 5 % misses of one frame; {SENSITIVITY_NOTE}",
            ),
            SpecificationRow(
                quantity="largest force",
                unit="N",
                measured=line.uncertain(line.most_n),
                fingertip="",
                printed="2 N",
                note="without clipped pixels, as far as it was pressed",
            ),
            SpecificationRow(
                quantity="hysteresis",
                unit="",
                measured=diagnostics.hysteresis,
                fingertip="High",
                printed="Low",
                note=f"loading less unloading over the range, at {WIDEST:g} of the largest force",
            ),
            SpecificationRow(
                quantity="repeatability",
                unit="",
                measured=diagnostics.repeatability,
                fingertip="",
                printed="good",
                note="standard deviation of repeated loadings of one tip over the range",
            ),
        ),
    )
