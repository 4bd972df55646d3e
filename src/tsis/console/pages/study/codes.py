"""Every target by its code, in the order of reading: what is read and what is left, and after the end what is true."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Any

from nicegui import ui

from tsis.console.pages.headings import panel_title

if TYPE_CHECKING:
    from tsis.console.pages.study.seen import StudySeen, Told
    from tsis.study import Study

SHEETS = (20, 50, 200)


class CodeTable:
    """The table of targets."""

    def __init__(self) -> None:
        panel_title("Targets")
        self._table = ui.table(rows=[], columns=[], row_key="number", pagination=SHEETS[0]).classes("targets")
        self._table.props(
            f'flat dense wrap-cells :rows-per-page-options="{list(SHEETS)}" rows-per-page-label="Targets on a sheet"'
        )

    def show(self, found: StudySeen, told: Told | None) -> None:
        """Show codes with what is read, or with the truth where the study says it."""
        if told is None:
            headings, rows = _progress(found.study)
        else:
            headings, rows = told.targets.headings, list(told.targets.rows)
        self._table.columns = [_column(at, words) for at, words in enumerate(("order", *headings))]
        self._table.rows = [
            {"number": number, **{f"c{at}": text for at, text in enumerate((str(number), *row))}}
            for number, row in enumerate(rows, start=1)
        ]
        self._table.update()


def _column(at: int, words: str) -> dict[str, Any]:
    return {"name": f"c{at}", "label": words, "field": f"c{at}", "align": "left"}


def _progress(study: Study) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Codes, and for each device whether it has read them; the virtual probe's first."""
    devices = tuple(dict.fromkeys((study.plan.device, *study.devices)))
    most: dict[tuple[str, str], dict[str, int]] = defaultdict(lambda: defaultdict(int))
    for reading in study.readings:
        most[reading.code, reading.device][reading.operator] += 1
    rows = [
        (code, *(_state(max(most[code, device].values(), default=0), study.plan.repeats) for device in devices))
        for code in study.plan.codes
    ]
    return ("code", *devices), rows


def _state(read: int, repeats: int) -> str:
    if read >= repeats:
        return "read"
    return f"read {read} of {repeats}" if read else "left"


__all__ = ["CodeTable"]
