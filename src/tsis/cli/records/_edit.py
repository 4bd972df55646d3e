"""``tsis records edit``: correct names, notes, truth, forces and roles."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.cli._options import AsJson
from tsis.cli._output import print_json
from tsis.cli._store import PHANTOM, StoreDatabase, StoreFolder, StoreKind, TargetNumber, opened
from tsis.errors import InputError
from tsis.present.terminal import people, print_notice

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.records import StoredPress, Target
    from tsis.records.store import Store


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

    The audit records what changed, when and by whom. After a change of force or role, recompute the estimate.
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
        if press is None:
            edited: Target | StoredPress = records.edit_target(_require_version(target, version), **changes)
        else:
            edited = records.edit_press(_require_version(_press(records, target, press), version), **changes)
    what = f"target {number}" if press is None else f"press {edited.id[:8]} of target {number}"
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "records edit", target=number, press=None if press is None else edited.id, **_now(edited)
            )
        )
        return
    console = people()
    console.print(f"Changed {', '.join(changes)} of {what}; it is version {edited.version} now.", markup=False)
    print_notice(console)


def _of_a_press(force_n: str | None, role: str | None, flags: Sequence[str] | None) -> dict[str, Any]:
    changes: dict[str, Any] = {} if role is None else {"role": role}
    if flags:
        changes["flags"] = () if _is_none("--flag", flags) else tuple(flags)
    if force_n is not None:
        from tsis.records import parse_force

        changes["force_n"] = parse_force(force_n, called="--force-n", nothing=NONE)
    return changes


def _is_none(option: str, given: Sequence[str]) -> bool:
    if NONE in given and len(given) > 1:
        raise InputError(f"{option} must be only none, or only values; got {', '.join(given)!r:.80}")
    return list(given) == [NONE]


def _truth(given: Sequence[str]) -> dict[str, float]:
    from tsis.records import parse_truth

    return {} if _is_none("--truth", given) else parse_truth(given, called="--truth")


def _require_version(record: Any, version: int | None) -> Any:
    """The record with the given version: the store refuses an edit of another version."""
    return record if version is None else replace(record, version=version)


def _press(records: Store, target: Target, prefix: str) -> StoredPress:
    results = [press for press in records.presses(target) if press.id.startswith(prefix)]
    if len(prefix) < FEWEST_LETTERS or len(results) != 1:
        raise InputError(
            f"--press must be {FEWEST_LETTERS} or more letters of the identity of one press of target {target.number}; "
            f"{prefix!r:.40} fits {len(results)} (tsis records show {target.number})"
        )
    return results[0]


def _now(edited: Any) -> dict[str, Any]:
    return {"record": edited.id, "version": edited.version}
