"""``--keep``: what other commands took and estimated goes into the store of records."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tsis.cli.records.chosen_store import DATABASE, LARGEST_NUMBER, PHANTOM, opened
from tsis.instrument.png import whole_levels
from tsis.model.errors import InputError, RecordsError, TsisError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tsis.calibration import ProbeCalibration
    from tsis.model import Estimate, TactileImage
    from tsis.records import Press, Store, Target

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
        max=LARGEST_NUMBER,
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Keeping:
    """Where what a command finds is kept."""

    folder: Path | None
    kind: str
    number: int | None

    def opened(self) -> Store:
        """The store, to be closed by a ``with``."""
        return opened(self.folder, self.kind, os.environ.get(DATABASE), create=True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Made:
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


def chosen_keeping(
    keep: bool, folder: Path | None, kind: str | None = None, number: int | None = None
) -> Keeping | None:
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
    keeping = Keeping(folder=folder, kind=kind or PHANTOM, number=number)
    keeping.opened().close()
    return keeping


def require_keepable(frames: Sequence[TactileImage]) -> None:
    """Refuse frames of which a store could not keep every level, before anything is computed."""
    for frame in frames:
        try:
            whole_levels(frame.grey, frame.full_scale)
        except InputError as error:
            raise InputError(
                f"{frame.name!r} must hold the grey levels that the camera gave, to be kept; got levels between them, "
                "as of a colour picture (save it as a grey PNG file and use that everywhere, or leave out --keep)"
            ) from error


def keep_made(keeping: Keeping, made: Made) -> dict[str, Any]:
    """Store presses, calibration and estimate; what a result says of it.

    Raises
    ------
    RecordsError
        When it could not be stored as a whole; it says how much was.
    """
    from tsis.records import environment

    with keeping.opened() as store:
        target = _target(store, keeping, made)
        moment = datetime.now(UTC)
        presses: list[Press] = []
        total = sum(len(each) for each in made.frames.values())
        try:
            for role, frames in made.frames.items():
                for frame in frames:
                    taken = moment + timedelta(microseconds=len(presses))  # so that their order is kept
                    presses.append(
                        store.add_press(target, frame, role=role, taken=taken, probe=made.probe, calibration=made.known)
                    )
            used = [press for press in presses if press.role != "untouched"]
            stored = store.add_estimate(
                target,
                made.estimate,
                kind=made.kind,
                presses=used,
                probe=made.probe,
                calibration=made.known,
                options=made.options,
                environment=environment(),
            )
        except TsisError as error:
            raise RecordsError(f"{error}; {len(presses)} of {total} presses are stored and stay") from error
        return {"store": str(store.folder.resolve()), "target": target.number, "estimate": stored.id}


def kept_note(kept: Mapping[str, Any]) -> str:
    """One line for people."""
    return f"Kept as target {kept['target']} in {kept['store']}."


def _target(store: Store, keeping: Keeping, made: Made) -> Target:
    truth = made.truth if store.kind == PHANTOM else {}
    return numbered_target(store, keeping.number, name=made.name, truth=truth)


def numbered_target(
    store: Store, number: int | None, *, name: str = "", truth: Mapping[str, float] | None = None
) -> Target:
    """The target of that number, entered where there is none; a new one where none is named."""
    if number is not None:
        for each in store.targets():
            if each.target.number == number:
                return each.target
    return store.add_target(number=number, name=name, truth=truth or {})
