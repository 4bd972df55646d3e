"""``--keep``: what other commands took and estimated goes into the store of records, once it is in its folder."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from tsis.cli.console_output import RESULT, print_outcome, publish, write_outcome
from tsis.cli.records.chosen_store import DATABASE, PHANTOM, opened
from tsis.instrument.naming import LARGEST_TARGET
from tsis.instrument.png import whole_levels
from tsis.model.durable import write_durably
from tsis.model.errors import InputError, RecordsError, TsisError
from tsis.report.document import json_bytes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tsis.calibration import ProbeCalibration
    from tsis.cli.console_output import Outcome
    from tsis.model import Estimate, TactileImage
    from tsis.records import Press, Store, Target

NOT_KEPT = 1  # exit code of a command whose results are in their folder and not in the store

Keep = Annotated[
    bool, typer.Option("--keep", help="Keep frames, calibration and estimate in the store: tsis records list.")
]
KeepFolder = Annotated[
    Path | None,
    typer.Option("--store", help="Folder of that store.", show_default="this user's own of that kind"),
]
KeepKind = Annotated[
    str | None, typer.Option("--kind", help="Kind of that store: phantom or subject.", show_default=PHANTOM)
]
KeepTarget = Annotated[
    int | None,
    typer.Option(
        "--target",
        help="Number of the target to keep it under; entered when there is none.",
        show_default="a new one",
        min=1,
        max=LARGEST_TARGET,
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Destination:
    """The store, and the target in it, where a command shall keep what it finds."""

    folder: Path | None
    kind: str
    number: int | None

    def opened(self) -> Store:
        """The store, to be closed by a ``with``."""
        return opened(self.folder, self.kind, os.environ.get(DATABASE), create=True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Keepable:
    """An estimate with all that it rests on, ready to be kept.

    Attributes
    ----------
    kind, estimate, probe, options
        As of `StoredEstimate`.
    frames
        As the camera gave them, by the role of their presses: those of the target first.
    known
        The calibration.
    name, truth
        Of a new target.
    """

    kind: str
    estimate: Estimate
    probe: str
    known: ProbeCalibration
    frames: Mapping[str, Sequence[TactileImage]]
    options: Mapping[str, Any] = field(default_factory=dict)
    name: str = ""
    truth: Mapping[str, float] = field(default_factory=dict)


def chosen_destination(
    keep: bool, folder: Path | None, kind: str | None = None, number: int | None = None
) -> Destination | None:
    """Where to keep, found ready before anything is computed; None where nothing is to be kept.

    Raises
    ------
    InputError
        When a store is named and nothing is to be kept.
    RecordsError
        When the store cannot be opened.
    """
    if not keep:
        given = {"--store": folder, "--kind": kind, "--target": number}
        for option, value in given.items():
            if value is not None:
                raise InputError(f"{option} needs --keep, without which nothing goes into a store")
        return None
    destination = Destination(folder=folder, kind=kind or PHANTOM, number=number)
    destination.opened().close()
    return destination


def require_keepable(frames: Sequence[TactileImage]) -> None:
    """Refuse frames of which a store could not keep name and every level, before anything is computed."""
    from tsis.records.values import LONGEST_NAME

    for frame in frames:
        if len(frame.name) > LONGEST_NAME:
            raise InputError(
                f"the name of a file must have at most {LONGEST_NAME} characters, to be kept; {frame.name[:40]!r}... "
                f"has {len(frame.name)} (give it a shorter one, or leave out --keep)"
            )
        try:
            whole_levels(frame.grey, frame.full_scale)
        except InputError as error:
            raise InputError(
                f"{frame.name!r} must hold the grey levels that the camera gave, to be kept; got levels between them, "
                "as of a colour picture (save it as a grey PNG file and use that everywhere, or leave out --keep)"
            ) from error


def publish_and_keep(
    outcome: Outcome, out: Path, destination: Destination | None, keepable: Keepable, *, as_json: bool
) -> None:
    """Write the folder of results, then keep what they rest on, and print both.

    The folder comes first, so that a store that takes nothing loses nothing: then it stays without the word ``kept``,
    a sentence tells why, and the exit code is 1.
    """
    if destination is None:
        publish(outcome, out, as_json=as_json)
        return
    folder = write_outcome(outcome, out)
    try:
        kept = keep(destination, keepable)
        outcome = replace(
            outcome, document={**outcome.document, "kept": kept}, notes=(*outcome.notes, *kept_notes(kept))
        )
        write_durably(folder / RESULT, json_bytes(outcome.document))
    except TsisError as error:
        print_outcome(outcome, folder, as_json=as_json)
        stop_not_kept(error, str(folder))
    except OSError as error:
        outcome = replace(outcome, notes=(*outcome.notes, f"{RESULT} does not tell it: {error.strerror or error}."))
    print_outcome(outcome, folder, as_json=as_json)


def stop_not_kept(error: TsisError, place: str) -> NoReturn:
    """End a command whose results are all there but for the store."""
    typer.echo(f"Error: the results are in {place}, but they could not be kept: {error}", err=True)
    raise typer.Exit(NOT_KEPT)


def keep(destination: Destination, keepable: Keepable) -> dict[str, Any]:
    """Store presses, calibration and estimate; what a result says of it.

    Raises
    ------
    RecordsError
        When it could not be stored as a whole; it says how much was.
    """
    from tsis.records.importing.differing import truth_note
    from tsis.records.importing.made_here import enter_estimate, new_target
    from tsis.records.importing.present import numbered

    frames = [(role, frame) for role, each in keepable.frames.items() for frame in each]
    with destination.opened() as store:
        truth = keepable.truth if store.kind == PHANTOM else {}
        number = destination.number
        presses: list[Press] = []
        target: Target | None = None
        try:
            target = None if number is None else numbered(store, number)
            if target is None:
                images = [frame for _, frame in frames]
                target = new_target(store, images, number=number, name=keepable.name, truth=truth)
            moment = datetime.now(UTC)
            for at, (role, frame) in enumerate(frames):
                taken = moment + timedelta(microseconds=at)  # so that their order is kept
                presses.append(
                    store.add_press(
                        target, frame, role=role, taken=taken, probe=keepable.probe, calibration=keepable.known
                    )
                )
            stored = enter_estimate(
                store,
                target,
                keepable.estimate,
                kind=keepable.kind,
                presses=presses,
                probe=keepable.probe,
                calibration=keepable.known,
                options=keepable.options,
            )
        except TsisError as error:
            where = "" if target is None else f" in target {target.number}"
            raise RecordsError(f"{error}; {len(presses)} of {len(frames)} presses are stored{where}") from error
        return {
            "store": str(store.folder.resolve()),
            "target": target.number,
            "estimate": stored.id,
            "notes": list(truth_note(truth, target)),
        }


def kept_notes(kept: Mapping[str, Any]) -> tuple[str, ...]:
    """What to tell people."""
    return (f"Kept as target {kept['target']} in {kept['store']}.", *kept["notes"])
