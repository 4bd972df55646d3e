"""``tsis records``: targets of a store.

The store's own libraries are imported when a command runs, so that the program starts quickly.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

import typer

import tsis
from tsis.cli.options import AsJson, scale_of
from tsis.cli.output import print_json
from tsis.cli.progress import FAILED, progress_bar, stop_interrupted, waiting
from tsis.cli.saving import (
    PHANTOM,
    StoreDatabase,
    StoreFolder,
    StoreKind,
    TargetNumber,
    is_there,
    opened,
    target_number,
)
from tsis.errors import InputError, TsisError
from tsis.present.page import Column, Table
from tsis.present.terminal import people, print_notice, rich_table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rich.console import Console

    from tsis.calibration.file import ProbeCalibration
    from tsis.records.importing import ImportedBatch
    from tsis.records.reader import TargetSummary
    from tsis.records.recomputation import Recomputation
    from tsis.records.staleness import StaleResult
    from tsis.records.store import Store, StoreVerification
    from tsis.records.values import StoredEstimate, StoredMap, StoredPress, Target, TargetRecord


def list_targets(
    *,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """List the targets of a store: numbers of presses and estimates, and the last press."""
    with opened(store, kind, database) as records:
        summaries, place = records.targets(), str(records.folder.resolve())
        edited = records.edited_targets()
        stale = {
            item.target.id: [result.kind for result in records.stale_results(item.target)]
            for item in summaries
            if item.estimates and item.target.id in edited
        }
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "records list", store=place, kind=kind, targets=[_summary_document(item, stale) for item in summaries]
            )
        )
        return
    console = people()
    table = Table(
        title=f"Targets ({kind}s)",
        columns=("number", "name", Column(label="presses"), Column(label="estimates"), "last press (UTC)"),
        values=tuple(
            (
                *(item.target.number, item.target.name, item.presses),
                f"{item.estimates}{STALE_MARK if stale.get(item.target.id) else ''}",
                "never" if item.last is None else f"{item.last:%Y-%m-%d %H:%M}",
            )
            for item in summaries
        ),
    )
    console.print(rich_table(table) if summaries else "The store is empty; tsis records import and --save fill it.")
    if any(stale.values()):
        console.print(STALE_MEANS, markup=False, soft_wrap=True)
    console.print(f"Store: {place}", markup=False, soft_wrap=True)
    print_notice(console)


STALE_MARK = " *"
STALE_MEANS = "* The presses have changed since a current estimate was made; tsis records show N tells which."


def _summary_document(summary: TargetSummary, stale: Mapping[str, list[str]]) -> dict[str, Any]:
    target = summary.target
    return {
        "number": target.number,
        "name": target.name,
        "id": target.id,
        "presses": summary.presses,
        "estimates": summary.estimates,
        "changed_since": stale.get(target.id, []),
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
    """Show a target: its presses, the current estimates and map with their intervals, calibrations and history."""
    with opened(store, kind, database) as records:
        target = records.target(number)
        total = records.press_count(target)
        record = records.record(target, limit=limit, offset=offset)
        stale = records.stale_results(target)
    presses, results = record.presses, record.results
    if as_json:
        print_json(_target_document(record, total, stale))
        return
    console = people()
    name = f" {target.name}" if target.name else ""
    console.print(f"Target {target.number}{name} ({target.kind}), version {target.version}", markup=False)
    if target.note:
        console.print(target.note, markup=False)
    console.print(rich_table(_presses(presses, total, offset)))
    changed = {result.id: result.message() for result in stale}
    for stored in sorted(record.active_estimates, key=lambda item: item.made, reverse=True):
        estimate = stored.estimate
        truth = target.truth if set(estimate.names) <= set(target.truth) else None
        title = f"Current estimate: {stored.kind}, {stored.probe}"
        console.print(rich_table(tsis.present.inclusion.estimate_table(estimate, title=title, truth=truth)))
        _print_stale(console, changed.get(stored.id))
        for message in tsis.present.document.estimate_messages(estimate):
            console.print(f"- {message}", markup=False)
        console.print(f"Flags: {', '.join(estimate.flags) or 'none'}", markup=False)
    if record.map is not None:
        found = record.map.estimate
        page = tsis.present.lump_map.lump_map_page(found, title="Current map", subtitle=record.map.probe)
        for table in page.tables:
            console.print(rich_table(replace(table, title=f"Current map: {table.title}")))
        _print_stale(console, changed.get(record.map.id))
        for message in page.notes:
            console.print(f"- {message}", markup=False)
    for message in dict.fromkeys(record.damaged):
        console.print(f"- Left out: {message}", markup=False)
    if not results:
        console.print("No estimate can be read." if record.damaged else "No estimate yet.")
    for identity, calibration in record.calibrations.items():
        console.print(
            f"Calibration {calibration.name} ({identity[:12]}), good until {_until(calibration)}", markup=False
        )
    if results:
        console.print(rich_table(_history(results)))
    print_notice(console)


def _print_stale(console: Console, message: str | None) -> None:
    if message is not None:
        console.print(f"- {message}", markup=False, soft_wrap=True)


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


def _history(results: Sequence[StoredEstimate | StoredMap]) -> Table:
    rows = []
    for stored in results:
        code = str(stored.environment.get("code_sha256", ""))[:SHORT]
        trusted = "yes" if stored.estimate.trusted else "no"
        made = f"{stored.made:%Y-%m-%d %H:%M:%S}"
        rows.append((stored.id[:SHORT], stored.kind, made, code, trusted, (stored.supersedes or "")[:SHORT]))
    columns = ("estimate", "kind", "made (UTC)", "code", "trusted", "supersedes")
    return Table(title="Estimates", columns=columns, values=tuple(rows))


def _until(calibration: ProbeCalibration) -> str:
    return "it is replaced (simulated)" if calibration.expires is None else f"{calibration.expires:%Y-%m-%d}"


def _target_document(record: TargetRecord, total: int, stale: Sequence[StaleResult]) -> dict[str, Any]:
    truth = record.target.truth
    documents = [tsis.present.document.stored_document(stored, truth) for stored in record.estimates]
    return tsis.present.document.envelope(
        "records show",
        target=tsis.files.json_values.to_json_value(record.target),
        presses=[tsis.files.json_values.to_json_value(press) for press in record.presses],
        presses_in_all=total,
        estimate=documents[-1] if documents else None,
        in_force=[stored.id for stored in record.active_results],
        changed_since=[_stale_document(result) for result in stale],
        history=documents[:-1],
        maps=[tsis.present.lump_map.stored_map_document(stored) for stored in record.maps],
        calibrations=[
            {"sha256": identity, "name": calibration.name, "until": _until(calibration)}
            for identity, calibration in record.calibrations.items()
        ],
        damaged=list(record.damaged),
    )


def _stale_document(result: StaleResult) -> dict[str, Any]:
    inputs = [
        {"press": item.press, "name": item.name, "before": item.before, "after": item.after} for item in result.inputs
    ]
    return {"id": result.id, "kind": result.kind, "sentence": result.message(), "inputs": inputs}


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
    """Recompute estimates and maps from the stored frames, report what changed and why, and store what changed.

    The old result stays, superseded by the new one. A calibration that has expired since is used as it
    was then.
    """
    if (number is None) != every:
        raise InputError("give the number of a target, or --all for every one")
    with opened(store, kind, database) as records:
        targets = [records.target(number)] if number is not None else _estimated(records)
        recomputations, failed = _recomputed(records, targets, dry_run=dry_run, single=not every)
    if as_json:
        documents = [tsis.present.records.recomputation_document(target, item) for target, item in recomputations]
        failures = [{"target": number, "reason": reason} for number, reason in failed]
        print_json(
            tsis.present.document.envelope("records recompute", dry_run=dry_run, estimates=documents, failed=failures)
        )
    else:
        console = people()
        for target, item in recomputations:
            _show_recomputation(console, target, item)
        for number, reason in failed:
            console.print(f"Target {number} could not be estimated again: {reason}", markup=False, soft_wrap=True)
        if not recomputations and not failed:
            console.print("No target of this store has an estimate.")
        print_notice(console)
    if failed:
        raise typer.Exit(FAILED)


def _estimated(records: Store) -> list[Target]:
    return [summary.target for summary in records.targets() if summary.estimates]


def _recomputed(
    records: Store, targets: list[Target], *, dry_run: bool, single: bool
) -> tuple[list[tuple[Target, Recomputation]], list[tuple[int, str]]]:
    """Recomputations, and the targets that failed; a single target raises its error."""
    from tsis.records.recomputation import recompute as again

    recomputations: list[tuple[Target, Recomputation]] = []
    failed: list[tuple[int, str]] = []
    with progress_bar("estimating again") as advance:
        for done, target in enumerate(targets):
            if not single:
                advance(done, len(targets))
            try:
                of_target = again(records, target, dry_run=dry_run, progress=advance if single else None)
            except TsisError as error:
                if single:
                    raise
                failed.append((target.number, str(error)))
            else:
                recomputations += [(target, item) for item in of_target]
    return recomputations, failed


def _show_recomputation(console: Console, target: Target, recomputation: Recomputation) -> None:
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
        verified = verification(records, progress=advance)
    if as_json:
        document = tsis.present.records.store_verification_document(verified)
        print_json(tsis.present.document.envelope("records verify", **document))
    else:
        console = people()
        for fault in verified.faults:
            console.print(f"- {fault}", markup=False, soft_wrap=True)
        console.print(tsis.present.records.verdict(verified))
        for note in tsis.present.records.verification_notes(verified):
            console.print(note, markup=False, soft_wrap=True)
        print_notice(console)
    if not verified.sound:
        raise typer.Exit(FAILED)


def backup(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="New folder for the copy.")],
    *,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    as_json: AsJson = False,
) -> None:
    """Copy a store into a new folder and verify the copy; others may save meanwhile."""
    with opened(store, kind, None) as records:
        verification, place = _copy(records, folder)
    if as_json:
        print_json(tsis.present.document.envelope("records backup", **_copied(verification, place)))
    else:
        _print_copy(verification, place)


def restore(
    folder: Annotated[Path, typer.Argument(metavar="BACKUP", help="Folder that tsis records backup wrote.")],
    *,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    as_json: AsJson = False,
) -> None:
    """Copy a backup to where a store shall be, and verify the copy; a store that is there is never replaced."""
    from tsis.records.store import default_folder

    with opened(folder, kind, None) as records:
        verification, place = _copy(records, default_folder(kind) if store is None else store)
    if as_json:
        print_json(tsis.present.document.envelope("records restore", **_copied(verification, place)))
    else:
        _print_copy(verification, place)


def _copy(records: Store, folder: Path) -> tuple[StoreVerification, str]:
    """Copy a store; its verification and the full path of the copy."""
    from tsis.records.store import back_up_store

    with progress_bar("copying every file, and reading it again") as advance:
        return back_up_store(records, folder, progress=advance), str(folder.resolve())


def _copied(verification: StoreVerification, place: str) -> dict[str, Any]:
    return {"store": place, **tsis.present.records.store_verification_document(verification)}


def _print_copy(verification: StoreVerification, place: str) -> None:
    console = people()
    console.print(tsis.present.records.verdict(verification))
    console.print(f"The store is in {place}", markup=False, soft_wrap=True)
    print_notice(console)


NEW = "new"


def import_(
    paths: Annotated[list[Path], typer.Argument(help="Folders that tsis wrote, bundles, sidecars, image files.")],
    *,
    target: Annotated[
        str | None,
        typer.Option(help="Number of the target, or new.", show_default="that of the files, else new"),
    ] = None,
    role: Annotated[
        str | None,
        typer.Option(help="What was pressed: target, plain, untouched or ball.", show_default="target"),
    ] = None,
    force_n: Annotated[
        list[float] | None, typer.Option(help="Force in newtons of image files: one for all, or one for each.")
    ] = None,
    scale_mm: Annotated[
        str | None, typer.Option(help="Millimetres per pixel on the face: one number, or x,y when they differ.")
    ] = None,
    calibration: Annotated[Path | None, typer.Option(help="Calibration file of the frames.")] = None,
    probe: Annotated[str, typer.Option(help="Name of the probe.", show_default="the calibration's")] = "",
    taken: Annotated[
        datetime | None, typer.Option(help="When image files were taken.", show_default="when each was written")
    ] = None,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """Import frames into a store, each once; their files are verified before anything is stored.

    Frames that the store has are skipped, so repeating an interrupted import completes it. The estimate of
    a demo folder is recomputed from its frames; a bundle contains its own. Options that files of a kind say themselves
    are refused.
    """
    from tsis.calibration.file import read_calibration
    from tsis.records.importing import ImportProgress, import_batches, require_importable
    from tsis.records.sources import ImportOptions, find_import_batches

    number = None if target in (None, NEW) else target_number(str(target))
    options = ImportOptions(
        role=role,
        force_n=tuple(force_n or ()),
        mm_per_pixel=None if scale_mm is None else scale_of(scale_mm),
        probe=probe,
        calibration=None if calibration is None else read_calibration(calibration),
        taken=None if taken is None else taken.astimezone(),
    )
    with _Calibrations(store, kind, database) as calibrations, waiting("reading the files"):
        batches = find_import_batches(paths, replace(options, calibration_of=calibrations.of))
    require_importable(batches, kind, number)  # before a store is created
    with opened(store, kind, database, create=True) as records:
        tally = ImportProgress()
        try:
            with progress_bar("storing") as advance:
                entered = import_batches(
                    records, batches, target=number, difference=target == NEW, tally=tally, progress=advance
                )
        except KeyboardInterrupt:
            stop_interrupted(f"; {tally.message}.")
        place = str(records.folder.resolve())
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "records import", store=place, imported=[_imported_document(item) for item in entered]
            )
        )
        return
    console = people()
    for item in entered:
        console.print(_imported_line(item), markup=False, soft_wrap=True)
        for note in item.batch.notes:
            console.print(f"- {note}", markup=False, soft_wrap=True)
    console.print(f"Store: {place}", markup=False, soft_wrap=True)
    print_notice(console)


class _Calibrations:
    """Calibrations that files cite, from a store that is opened at the first request, if it exists."""

    def __init__(self, folder: Path | None, kind: str, database: str | None) -> None:
        self._chosen = folder, kind, database
        self._store: Store | None = None
        self._by_name: dict[str, ProbeCalibration | None] = {}
        self._until = ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._until.close()

    def of(self, cited: str) -> ProbeCalibration | None:
        """The calibration of an identity; None where the store has none, `RecordsError` when it is damaged."""
        from tsis.records.sources import stored_calibration

        if cited not in self._by_name:
            if self._store is None and is_there(*self._chosen):
                self._store = self._until.enter_context(opened(*self._chosen))
            self._by_name[cited] = None if self._store is None else stored_calibration(self._store, cited)
        return self._by_name[cited]


def _imported_line(entered: ImportedBatch) -> str:
    text = tsis.present.records.entered_text(
        entered.target, new=entered.new, added=entered.added, present=entered.present, estimates=entered.estimates
    )
    return f"{entered.batch.kind} in {entered.batch.source}: {text}"


def _imported_document(entered: ImportedBatch) -> dict[str, Any]:
    return {
        "source": str(entered.batch.source),
        "kind": entered.batch.kind,
        "target": entered.target.number,
        "new": entered.new,
        "added": entered.added,
        "present": entered.present,
        "estimates": entered.estimates,
        "notes": list(entered.batch.notes),
    }


FEWEST_LETTERS = 4  # of an identity
NONE = "none"


def edit(
    number: TargetNumber,
    *,
    name: Annotated[str | None, typer.Option(help="New name of the target.")] = None,
    note: Annotated[str | None, typer.Option(help="Note on the target, or on the press with --press.")] = None,
    truth: Annotated[
        list[str] | None,
        typer.Option(help="True value of a phantom, e.g. diameter_mm=10; repeatable, replaces all; none for none."),
    ] = None,
    press: Annotated[
        str | None, typer.Option(help="Change this press instead: its identity or the first letters of it.")
    ] = None,
    force_n: Annotated[str | None, typer.Option(help="Force of the press in newtons, or none where unknown.")] = None,
    role: Annotated[str | None, typer.Option(help="What was pressed: target, plain, untouched or ball.")] = None,
    flags: Annotated[
        list[str] | None, typer.Option("--flag", help="Flag of the press; repeatable, replaces all; none for none.")
    ] = None,
    version: Annotated[
        int | None,
        typer.Option(
            help="Version that you saw; refused when the record has changed since.",
            min=1,
            max=2**31,
            show_default="the last",
        ),
    ] = None,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """Change the entries of a target or a press; frames and estimates never change.

    The audit records what changed, when and by whom. After a change of force or role, recompute the estimate:
    the command says which results rest on the press as it was.
    """
    changes: dict[str, Any] = {} if note is None else {"note": note}
    if press is None:
        if force_n is not None or role is not None or flags:
            raise InputError("--force-n, --role and --flag need --press, the press to change")
        changes |= ({} if name is None else {"name": name}) | ({} if truth is None else {"truth": _truth(truth)})
    else:
        if name is not None or truth is not None:
            raise InputError("--name and --truth belong to the target; leave out --press")
        changes |= _of_a_press(force_n, role, flags)
    if not changes:
        raise InputError(
            "give what to change: --name, --note or --truth; with --press --note, --force-n, --role or --flag"
        )
    with opened(store, kind, database) as records:
        target = records.target(number)
        stale: tuple[StaleResult, ...] = ()
        # The store refuses an edit of another version than the last.
        seen: dict[str, Any] = {} if version is None else {"version": version}
        if press is None:
            edited: Target | StoredPress = records.edit_target(replace(target, **seen), **changes)
        else:
            edited = records.edit_press(replace(_press(records, target, press), **seen), **changes)
            stale = _resting_on(edited.id, records.stale_results(target))
    what = f"target {number}" if press is None else f"press {edited.id[:8]} of target {number}"
    if as_json:
        cited = {"press": None if press is None else edited.id, "record": edited.id, "version": edited.version}
        documents = [_stale_document(result) for result in stale]
        print_json(tsis.present.document.envelope("records edit", target=number, **cited, changed_since=documents))
        return
    console = people()
    console.print(f"Changed {', '.join(changes)} of {what}; it is version {edited.version} now.", markup=False)
    for result in stale:
        console.print(result.message(), markup=False, soft_wrap=True)
    print_notice(console)


def _resting_on(press: str, stale: Sequence[StaleResult]) -> tuple[StaleResult, ...]:
    return tuple(result for result in stale if press in {item.press for item in result.inputs})


def _of_a_press(force_n: str | None, role: str | None, flags: Sequence[str] | None) -> dict[str, Any]:
    changes: dict[str, Any] = {} if role is None else {"role": role}
    if flags:
        changes["flags"] = () if _is_none("--flag", flags) else tuple(flags)
    if force_n is not None:
        from tsis.records.values import parse_force

        changes["force_n"] = parse_force(force_n, called="--force-n", nothing=NONE)
    return changes


def _is_none(option: str, given: Sequence[str]) -> bool:
    if NONE in given and len(given) > 1:
        raise InputError(f"{option} must be only none, or only values; got {', '.join(given)!r:.80}")
    return list(given) == [NONE]


def _truth(given: Sequence[str]) -> dict[str, float]:
    from tsis.records.values import parse_truth

    return {} if _is_none("--truth", given) else parse_truth(given, called="--truth")


def _press(records: Store, target: Target, prefix: str) -> StoredPress:
    presses = [press for press in records.presses(target) if press.id.startswith(prefix)]
    if len(prefix) < FEWEST_LETTERS or len(presses) != 1:
        raise InputError(
            f"--press must be {FEWEST_LETTERS} or more letters of the identity of one press of target {target.number}; "
            f"{prefix!r:.40} fits {len(presses)} (tsis records show {target.number})"
        )
    return presses[0]


Identified = Annotated[
    bool, typer.Option("--identified", help="Include label, names and true times in dicom; masked otherwise.")
]


def export(
    number: TargetNumber,
    *,
    forms: Annotated[
        list[str],
        typer.Option("--format", help="Form: html, pdf, csv, netcdf, zarr, dicom, bundle, or a plug-in's; repeatable."),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="New file or folder; for several forms a new folder of them.", show_default="target-N with its ending"
        ),
    ] = None,
    identified: Identified = False,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """Export a target; no file is overwritten.

    Several forms appear together or not at all. html and pdf are reports; csv, netcdf, zarr and bundle contain notes
    and names too; dicom masks names and times.
    """
    wanted = list(dict.fromkeys(part for form in forms for part in form.split(",")))
    endings = tsis.present.records.export_endings()
    for form in wanted:
        tsis.model.require.require_one_of("form of export", form, endings)
    if identified and not set(wanted) & set(tsis.present.records.MASKED):
        masked = " and ".join(tsis.present.records.MASKED)
        raise InputError(f"--identified belongs to {masked}; the other forms mask nothing (leave it out)")
    stem = f"target-{number}"
    destination = out or Path(stem if len(wanted) > 1 else f"{stem}{endings[wanted[0]]}")
    tsis.files.result_folder.require_absent(destination)
    with opened(store, kind, database) as records, waiting("writing"), ExitStack() as together:
        record = records.record(records.target(number))
        if set(wanted) - set(tsis.present.records.PAGE_FORMS):  # they name missing libraries
            record.require_whole()
        if len(wanted) == 1:
            seal = tsis.present.records.write_form(wanted[0], record, destination, identified=identified)
        else:
            from tsis.records.export import export_folder

            draft, seal = together.enter_context(export_folder(destination)), ""
            for form in wanted:
                seal += tsis.present.records.write_form(
                    form, record, draft / f"{stem}{endings[form]}", identified=identified
                )
    single = len(wanted) == 1
    files = {
        form: str((destination if single else destination / f"{stem}{endings[form]}").resolve()) for form in wanted
    }
    if as_json:
        print_json(
            tsis.present.document.envelope("records export", target=number, files=files, bundle_sha256=seal or None)
        )
        return
    console = people()
    for form, file in files.items():
        console.print(f"{form}: {file}", markup=False, soft_wrap=True)
    if seal:
        console.print(f"SHA-256 of the bundle, for its receiver: {seal}", markup=False, soft_wrap=True)
    print_notice(console)


app = typer.Typer(
    name="records",
    epilog="Start with: tsis demo --save, then tsis records list",
    no_args_is_help=True,
)
app.command("list", epilog="Example: tsis records list")(list_targets)
app.command("show", epilog="Example: tsis records show 1 --limit 20")(show)
app.command("verify", epilog="Example: tsis records verify")(verify)
app.command("backup", epilog="Example: tsis records backup records-backup")(backup)
app.command("restore", epilog="Example: tsis records restore records-backup --store restored-records")(restore)
app.command("import", epilog="Example: tsis records import first-press")(import_)
app.command("recompute", epilog="Example: tsis records recompute --all --dry-run")(recompute)
app.command("edit", epilog="Example: tsis records edit 1 --name 'soft, 8 mm' --note 'second row, left'")(edit)
app.command("export", epilog="Example: tsis records export 1 --format pdf --format csv --out target-1")(export)
