"""``tsis records list``: the targets of a store."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich.markup import escape
from rich.table import Table

from tsis.cli.console_output import people, print_json, print_notice
from tsis.cli.records.chosen_store import PHANTOM, StoreDatabase, StoreFolder, StoreKind, opened
from tsis.cli.targets import AsJson
from tsis.report.document import envelope

if TYPE_CHECKING:
    from tsis.records import TargetSummary


def list_targets(
    *,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """List the targets of a store: how often each was pressed and estimated, and when last."""
    with opened(store, kind, database) as records:
        found, place = records.targets(), str(records.folder.resolve())
    if as_json:
        print_json(envelope("records list", store=place, kind=kind, targets=[_document(each) for each in found]))
        return
    console = people()
    table = Table("number", "name", "presses", "estimates", "last press (UTC)", title=escape(f"Targets ({kind}s)"))
    for each in found:
        last = "never" if each.last is None else f"{each.last:%Y-%m-%d %H:%M}"
        cells = (str(each.target.number), each.target.name, str(each.presses), str(each.estimates), last)
        table.add_row(*(escape(cell) for cell in cells))
    console.print(table if found else "The store is empty; tsis records import and --keep fill it.")
    console.print(f"Store: {place}", markup=False, soft_wrap=True)
    print_notice(console)


def _document(each: TargetSummary) -> dict[str, Any]:
    target = each.target
    return {
        "number": target.number,
        "name": target.name,
        "id": target.id,
        "presses": each.presses,
        "estimates": each.estimates,
        "last": None if each.last is None else each.last.isoformat(),
    }
