"""What section 6.4 and table 2.1 print, and what their numbers can mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from studies.shown import Shown

from tsis.study.proportions import Counts
from tsis.study.roc import newcombe_interval

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PRINTED = Counts(true_positives=6, false_negatives=2, true_negatives=7, false_positives=1)
PRINTED_AREA = 0.735
# Table 2.1: sensitivity and specificity in per cent, with the source that the dissertation names for each row.
TABLE_2_1 = (
    ("Clinical breast examination", 57.14, 97.11, "Ratanachaikanont 2005"),
    ("Mammography", 68.6, 91.4, "Carney et al. 2003"),
    ("Doppler ultrasound", 68.1, 95.1, "Raza and Baum 1997"),
    ("Magnetic resonance imaging", 88.2, 67.7, "Bluemke et al. 2004"),
    ("Positron emission tomography", 96.4, 77.3, "Lind et al. 2004"),
    ("Thermography imaging", 97.3, 14.1, "Parisky et al. 2003"),
)


def printed_lines() -> list[str]:
    """What the printed numbers can mean."""
    sensitivity, specificity = PRINTED.sensitivity.interval(), PRINTED.specificity.interval()
    area = newcombe_interval(PRINTED_AREA, 8, 8)
    hit, false = PRINTED.sensitivity.value, 1 - PRINTED.specificity.value
    corner = np.trapezoid([0, hit, 1], [0, false, 1])
    least, most = hit * (1 - false), 1 - false * (1 - hit)
    steps = round(PRINTED_AREA * 128)
    return [
        "printed: sensitivity 75 %, 95 % interval " + percent(sensitivity.low, sensitivity.high),
        "printed: specificity 87.5 %, 95 % interval " + percent(specificity.low, specificity.high),
        f"printed: area {PRINTED_AREA:g}; with 8 + 8 targets its 95 % interval (Newcombe) is {area.low:.3f} to "
        f"{area.high:.3f}, which {'holds' if area.holds(0.5) else 'does not hold'} 0.5",
        f"  through the printed point alone lines enclose {corner:.4f}; no concave curve through it encloses less; "
        f"steps through it enclose {least:.3f} to {most:.3f}",
        f"  areas of 8 + 8 targets are multiples of 1/128, of which the nearest is {steps / 128:.6f}: not 0.735",
    ]


def percent(low: float, high: float) -> str:
    """Ends of an interval of a share."""
    return f"{100 * low:.1f} to {100 * high:.1f} %"


def table_2_1() -> list[str]:
    """Table 2.1 of the source, for context; without numbers of persons it has no intervals."""
    rows = [f"  {name:30} {hit:6.2f} % {empty:6.2f} %  {source}" for name, hit, empty, source in TABLE_2_1]
    return ["table 2.1 as printed, sensitivity and specificity, on persons and so not comparable with phantoms:", *rows]


def youden(rows: tuple[tuple[str, float, float, str], ...]) -> dict[str, float]:
    """Sensitivity and specificity less one, in per cent, of each row: 0 for chance, 100 without error."""
    return {f"{name}, sensitivity and specificity less one": hit + empty - 100 for name, hit, empty, _ in rows}


def draw(rows: tuple[tuple[str, float, float, str], ...], figure: Figure) -> None:
    """Table 2.1 as points; persons, so that no point of a study on phantoms stands among them."""
    axis = figure.subplots()
    for mark, (name, hit, empty, _) in zip("osD^vP", rows, strict=True):
        axis.plot(1 - empty / 100, hit / 100, mark, color="0.35", mfc="none", markersize=8, label=name)
    axis.plot([0, 1], [0, 1], ":", color="0.6", label="chance")
    axis.set(xlabel="1 - specificity", ylabel="sensitivity", xlim=(0, 1), ylim=(0, 1.05))
    axis.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize=9)


SHOWN = (Shown(name="table-2-1", run=lambda _: TABLE_2_1, values=youden, draw=draw),)
