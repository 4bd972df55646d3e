"""``tsis records recompute``: recompute stored estimates with the current code."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

import tsis
from tsis.cli._options import AsJson
from tsis.cli._output import print_json
from tsis.cli._progress import FAILED, progress_bar
from tsis.cli._store import PHANTOM, StoreDatabase, StoreFolder, StoreKind, opened
from tsis.errors import InputError, TsisError
from tsis.present.terminal import people, print_notice, rich_table

if TYPE_CHECKING:
    from rich.console import Console

    from tsis.records import Recomputation, Target
    from tsis.records.store import Store


def recompute(
    number: Annotated[int | None, typer.Argument(metavar="[N]", help="Number of the target.")] = None,
    *,
    every: Annotated[bool, typer.Option("--all", help="Every target that has an estimate.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Report changes and store nothing.")] = False,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """Recompute estimates from the stored frames, report what changed and why, and store changed estimates.

    The old estimate stays, superseded by the new one. A calibration that has expired since is used as it
    was then.
    """
    if (number is None) != every:
        raise InputError("give the number of a target, or --all for every one")
    with opened(store, kind, database) as records:
        requested = _requested(records) if number is None else [records.target(number)]
        result, failed = _recomputed(records, requested, dry_run=dry_run, single=not every)
    if as_json:
        documents = [tsis.present.records.recomputation_document(target, item) for target, item in result]
        failures = [{"target": number, "reason": reason} for number, reason in failed]
        print_json(
            tsis.present.document.envelope("records recompute", dry_run=dry_run, estimates=documents, failed=failures)
        )
    else:
        console = people()
        for target, item in result:
            _show(console, target, item)
        for number, reason in failed:
            console.print(f"Target {number} could not be estimated again: {reason}", markup=False, soft_wrap=True)
        if not result and not failed:
            console.print("No target of this store has an estimate.")
        print_notice(console)
    if failed:
        raise typer.Exit(FAILED)


def _requested(records: Store) -> list[Target]:
    return [target.target for target in records.targets() if target.estimates]


def _recomputed(
    records: Store, targets: list[Target], *, dry_run: bool, single: bool
) -> tuple[list[tuple[Target, Recomputation]], list[tuple[int, str]]]:
    """Recomputations, and the targets that failed; a single target raises its error."""
    from tsis.records import recompute as again

    result: list[tuple[Target, Recomputation]] = []
    failed: list[tuple[int, str]] = []
    what = "solving the press for this probe (cached for next time)" if single else "estimating again"
    with progress_bar(what) as advance:
        for done, target in enumerate(targets):
            if not single:
                advance(done, len(targets))
            try:
                created = again(records, target, dry_run=dry_run, progress=advance if single else None)
            except TsisError as error:
                if single:
                    raise
                failed.append((target.number, str(error)))
            else:
                result += [(target, item) for item in created]
    return result, failed


def _show(console: Console, target: Target, recomputation: Recomputation) -> None:
    console.print(
        f"Target {target.number}, {recomputation.before.kind}: {recomputation.message}", markup=False, soft_wrap=True
    )
    for note in tsis.present.records.recomputation_notes(recomputation):
        console.print(f"- {note}", markup=False, soft_wrap=True)
    if recomputation.same:
        return
    console.print(rich_table(tsis.present.records.shift_table(recomputation)))
    console.print(tsis.present.records.recomputation_message(recomputation), markup=False)


def verify(
    *,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """Compare every row and file of a store with its audit; exit code 1 and a list of faults when they differ."""
    from tsis.records.store import verify_store as verification

    with opened(store, kind, database) as records, progress_bar("reading every file") as advance:
        result = verification(records, progress=advance)
    if as_json:
        print_json(
            tsis.present.document.envelope("records verify", **tsis.present.records.store_verification_document(result))
        )
    else:
        console = people()
        for fault in result.faults:
            console.print(f"- {fault}", markup=False, soft_wrap=True)
        console.print(tsis.present.records.verdict(result))
        for note in tsis.present.records.verification_notes(result):
            console.print(note, markup=False, soft_wrap=True)
        print_notice(console)
    if not result.sound:
        raise typer.Exit(FAILED)
