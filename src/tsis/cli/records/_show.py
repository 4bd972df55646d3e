"""``tsis records list``: the targets of a store."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.cli._options import AsJson
from tsis.cli._output import print_json
from tsis.cli._store import PHANTOM, StoreDatabase, StoreFolder, StoreKind, TargetNumber, opened
from tsis.present.page import Column, Table
from tsis.present.terminal import people, print_notice, rich_table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tsis.calibration.file import ProbeCalibration
    from tsis.records import StoredEstimate, StoredPress, TargetRecord
    from tsis.records.store import TargetSummary


def list_targets(
    *,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """List the targets of a store: numbers of presses and estimates, and the last press."""
    with opened(store, kind, database) as records:
        result, position = records.targets(), str(records.folder.resolve())
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "records list", store=position, kind=kind, targets=[_document(item) for item in result]
            )
        )
        return
    console = people()
    table = Table(
        title=f"Targets ({kind}s)",
        columns=("number", "name", Column(label="presses"), Column(label="estimates"), "last press (UTC)"),
        values=tuple(
            (
                *(item.target.number, item.target.name, item.presses, item.estimates),
                "never" if item.last is None else f"{item.last:%Y-%m-%d %H:%M}",
            )
            for item in result
        ),
    )
    console.print(rich_table(table) if result else "The store is empty; tsis records import and --save fill it.")
    console.print(f"Store: {position}", markup=False, soft_wrap=True)
    print_notice(console)


def _document(summary: TargetSummary) -> dict[str, Any]:
    target = summary.target
    return {
        "number": target.number,
        "name": target.name,
        "id": target.id,
        "presses": summary.presses,
        "estimates": summary.estimates,
        "last": None if summary.last is None else summary.last.isoformat(),
    }


SHORT = 8  # letters of an identity that are shown
MOST_SHOWN, MOST_OFFSET = 100_000, 10**12


def show(
    number: TargetNumber,
    *,
    limit: Annotated[int, typer.Option(help="Most presses to show.", min=1, max=MOST_SHOWN)] = 50,
    offset: Annotated[int, typer.Option(help="Presses to skip before.", min=0, max=MOST_OFFSET)] = 0,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """Show a target: its presses, the current estimates with their intervals, calibrations and history."""
    with opened(store, kind, database) as records:
        target = records.target(number)
        total = records.press_count(target)
        record = records.record(target, limit=limit, offset=offset)
    presses, estimates = record.presses, record.estimates
    if as_json:
        print_json(_target_document(record, total))
        return
    console = people()
    name = f" {target.name}" if target.name else ""
    console.print(f"Target {target.number}{name} ({target.kind}), version {target.version}", markup=False)
    if target.note:
        console.print(target.note, markup=False)
    console.print(rich_table(_presses(presses, total, offset)))
    for stored in sorted(record.active_estimates, key=lambda item: item.made, reverse=True):
        result = stored.estimate
        truth = target.truth if set(result.names) <= set(target.truth) else None
        title = f"Current estimate: {stored.kind}, {stored.probe}"
        console.print(rich_table(tsis.present.inclusion.estimate_table(result, title=title, truth=truth)))
        for estimate_message in tsis.present.document.estimate_messages(result):
            console.print(f"- {estimate_message}", markup=False)
        console.print(f"Flags: {', '.join(result.flags) or 'none'}", markup=False)
    for estimate_message in record.damaged:
        console.print(f"- Left out: {estimate_message}", markup=False)
    if not estimates:
        console.print("No estimate yet.")
    for identity, calibration in record.calibrations.items():
        console.print(
            f"Calibration {calibration.name} ({identity[:12]}), good until {_until(calibration)}", markup=False
        )
    if estimates:
        console.print(rich_table(_history(estimates)))
    print_notice(console)


def _presses(presses: Sequence[StoredPress], total: int, offset: int) -> Table:
    shown = f"{offset + 1} to {offset + len(presses)} of {total}" if presses else f"none shown of {total}"
    rows = tuple(
        (
            *(press.id[:SHORT], press.role, f"{press.taken:%Y-%m-%d %H:%M:%S}"),
            *(press.force_n, press.name, ", ".join(press.flags)),
        )
        for press in presses
    )
    force = Column(label="force", unit="N", form=".3g")
    columns = ("press", "role", "taken (UTC)", force, "name", "flags")
    return Table(title=f"Presses, {shown}", columns=columns, values=rows)


def _history(estimates: Sequence[StoredEstimate]) -> Table:
    rows = []
    for stored in estimates:
        code = str(stored.environment.get("code_sha256", ""))[:SHORT]
        trusted = "yes" if stored.estimate.trusted else "no"
        created = f"{stored.made:%Y-%m-%d %H:%M:%S}"
        rows.append((stored.id[:SHORT], stored.kind, created, code, trusted, (stored.supersedes or "")[:SHORT]))
    columns = ("estimate", "kind", "made (UTC)", "code", "trusted", "supersedes")
    return Table(title="Estimates", columns=columns, values=tuple(rows))


def _until(calibration: ProbeCalibration) -> str:
    return "it is replaced (simulated)" if calibration.expires is None else f"{calibration.expires:%Y-%m-%d}"


def _target_document(record: TargetRecord, total: int) -> dict[str, Any]:
    truth = dict(record.target.truth)
    created = [
        _estimate(stored, truth if set(stored.estimate.names) <= set(truth) else None) for stored in record.estimates
    ]
    return tsis.present.document.envelope(
        "records show",
        target=tsis.files.to_json_value(record.target),
        presses=[tsis.files.to_json_value(press) for press in record.presses],
        presses_in_all=total,
        estimate=created[-1] if created else None,
        in_force=[stored.id for stored in record.active_estimates],
        history=created[:-1],
        calibrations=[
            {"sha256": identity, "name": calibration.name, "until": _until(calibration)}
            for identity, calibration in record.calibrations.items()
        ],
        damaged=list(record.damaged),
    )


def _estimate(stored: StoredEstimate, truth: Mapping[str, float] | None) -> dict[str, Any]:
    from tsis.records import estimate_to_json

    reference = estimate_to_json(stored)
    created = reference.pop("estimate")
    return {
        **reference,
        **tsis.present.document.estimate_document(stored.estimate, truth),
        "provenance": created["provenance"],
    }
