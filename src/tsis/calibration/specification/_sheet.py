"""The specification sheet, and the measured frame rate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration._measured import MeasuredValue
from tsis.calibration.force import HYSTERESIS_POINT
from tsis.errors import InputError
from tsis.model import require_array, require_one_of, require_type

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tsis.calibration.force import ForceLine, ForceLineDiagnostics


FEWEST = 3


def frame_rate(time_s: ArrayLike) -> MeasuredValue:
    """Frames a second of a stream: intervals over the time between the first and the last frame.

    Raises `InputError` when there are too few times, or they do not ascend.

    Parameters
    ----------
    time_s
        Times of the frames on one clock, ascending, shape (n,), n >= 3. Lost frames count as long intervals.

    Returns
    -------
    MeasuredValue
        The rate in 1/s; its standard deviation is that of the mean interval.

    Examples
    --------
    >>> round(frame_rate([0.0, 0.03, 0.07, 0.10]).value, 6)
    30.0
    """
    time = require_array("time_s", time_s, ndim=1)
    if len(time) < FEWEST or (np.diff(time) <= 0).any():
        raise InputError(f"time_s must hold at least {FEWEST} ascending times; got {len(time)} values")
    steps = np.diff(time)
    mean = float(steps.mean())
    error = float(steps.std(ddof=1)) / float(np.sqrt(len(steps)))
    return MeasuredValue(value=1 / mean, sd=error / mean**2, degrees_of_freedom=len(steps) - 1.0, unit="1/s")


SENSITIVITY_NOTE = (
    "5 % false alarms and 5 % misses of one frame; "
    "the source's text gives the probe 2.5e-3 N and the fingertip 2.0e-2 N, its table 4.1 gives 2.0e-3 N and 2.5e-2 N"
)
EDGE_NOTE = "10 to 90 % of an edge of contact; the printed 9.8 um is the pitch of the sensor's pixels"
RATE_NOTE = "frames a second; what can be followed without aliasing is half of it"
LOOP_NOTE = f"loading less unloading over the range, at {HYSTERESIS_POINT:g} of the largest force"
REPEAT_NOTE = "standard deviation of repeated loadings of one tip over the range"
COMPARED = (  # quantity, unit, and the source's values for the fingertip and for its probe
    ("spatial resolution", "mm", "0.1 mm", "9.8 um", EDGE_NOTE),
    ("frame rate", "1/s", "0 to 100 Hz", "0 to 30 Hz", RATE_NOTE),
    ("smallest detectable force", "N", "2.5e-2 N", "2.0e-3 N", SENSITIVITY_NOTE),
    ("largest force", "N", "", "2 N", "without clipped pixels, as far as it was pressed"),
    ("hysteresis", "", "High", "Low", LOOP_NOTE),
    ("repeatability", "", "", "good", REPEAT_NOTE),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpecificationRow:
    """One row of the sheet.

    Attributes
    ----------
    quantity, unit
        Measured quantity and its unit; the unit is empty for a fraction.
    measured
        The value with its uncertainty; None when it was not measured.
    fingertip
        The source's value for the human fingertip, as text in its own unit.
    printed
        The source's value for its probe.
    note
        Note for the comparison.
    """

    quantity: str
    unit: str
    measured: MeasuredValue | None
    fingertip: str
    printed: str
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Specification:
    """A probe's specification sheet: its name, and the rows."""

    probe: str
    rows: tuple[SpecificationRow, ...]

    def __getitem__(self, quantity: str) -> SpecificationRow:
        """The row of a quantity; `UnknownNameError` when there is none."""
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
    """Fill the sheet with measured values; the others stay empty and are never copied from the source.

    Raises `InputError` when ``probe``, the name, is not a text.

    Parameters
    ----------
    line, diagnostics
        The force line of this probe, by `fit_force_line`.
    edge_mm
        Width in mm in which an edge of contact rises from 10 to 90 %, by `edge_width`.
    frames_per_s
        Rate of arrival of the frames, by `frame_rate`.
    """
    require_type("probe", probe, str)
    measured = {
        "spatial resolution": edge_mm,
        "frame rate": frames_per_s,
        "smallest detectable force": diagnostics.detectable_n,
        "largest force": line.with_uncertainty(line.most_n),
        "hysteresis": diagnostics.hysteresis,
        "repeatability": diagnostics.repeatability,
    }
    rows = tuple(
        SpecificationRow(
            quantity=name, unit=unit, measured=measured[name], fingertip=fingertip, printed=printed, note=note
        )
        for name, unit, fingertip, printed, note in COMPARED
    )
    return Specification(probe=probe, rows=rows)
