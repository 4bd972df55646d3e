"""Inputs of a stored result that were edited since: what `tsis.records.recomputation` would find changed, at once."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tsis.errors import TsisError
from tsis.records.provenance import shown_value
from tsis.records.values import MAP, REFERENCE_ROLES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.records.values import StoredEstimate, StoredMap, StoredPress, TargetRecord

    Result = StoredEstimate | StoredMap

FORCE, ROLE = "force_n", "role"
MOST_NAMED, SHORT = 3, 8


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangedInput:
    """A value of a press that a result rests on, and the value that the press has now.

    ``press`` is the identity, and ``number`` the place in the order of time, from 1.
    """

    press: str
    number: int
    name: str
    before: Any
    after: Any


@dataclass(frozen=True, slots=True, kw_only=True)
class StaleResult:
    """A current estimate or map whose presses were edited since it was made."""

    target: int
    id: str
    kind: str
    inputs: tuple[ChangedInput, ...]

    def message(self, *, numbered: bool = False) -> str:
        """What changed and how to make it again; presses by their first letters, or by number as in reports."""
        parts = [
            f"{item.name} {shown_value(item.before)} -> {shown_value(item.after)} of press "
            f"{item.number if numbered else item.press[:SHORT]}"
            for item in self.inputs[:MOST_NAMED]
        ]
        if len(self.inputs) > MOST_NAMED:
            parts.append(f"and {len(self.inputs) - MOST_NAMED} more")
        done = "made" if self.kind == MAP else "estimated"
        return (
            f"The presses have changed since the {self.kind} was {done}: {', '.join(parts)}; make it again with tsis "
            f"records recompute {self.target}."
        )


def stale_results(record: TargetRecord) -> tuple[StaleResult, ...]:
    """The current results of a target whose inputs were edited since; ``record`` has all presses.

    Only presses that were ever edited are compared. A frame is read only for one of these without a force, where the
    calibration may give the force.
    """
    found = ((stored, changed_inputs(record, stored)) for stored in record.active_results)
    return tuple(
        StaleResult(target=record.target.number, id=stored.id, kind=stored.kind, inputs=inputs)
        for stored, inputs in found
        if inputs
    )


def changed_inputs(record: TargetRecord, stored: Result) -> tuple[ChangedInput, ...]:
    """The forces and roles that differ from those of a stored result; nothing where it does not tell them."""
    numbers = {press.id: number for number, press in enumerate(record.presses, 1)}
    presses = [record.presses[numbers[identity] - 1] for identity in stored.presses if identity in numbers]
    if all(press.version == 1 for press in presses):
        return ()
    pairs = _of_map(stored, presses) if stored.kind == MAP else _of_estimate(stored, presses)
    changes = []
    for press, role, entry in pairs:
        values: list[tuple[str, Any, Any]] = [(ROLE, role, press.role)]
        if FORCE in entry and press.role != "untouched":
            values.append((FORCE, entry[FORCE], _force(record, stored, press)))
        changes += [
            ChangedInput(press=press.id, number=numbers[press.id], name=name, before=before, after=after)
            for name, before, after in values
            if before != after
        ]
    return tuple(changes)


Pairs = list[tuple["StoredPress", str, Mapping[str, Any]]]  # an edited press, its role in the result, its entry there


def _of_map(stored: Result, presses: Sequence[StoredPress]) -> Pairs:
    entries = _entries(stored, "images")
    if len(entries) != len(presses):
        return []
    return [
        (press, str(entry.get(ROLE, press.role)), entry)
        for press, entry in zip(presses, entries, strict=True)
        if press.version > 1
    ]


def _of_estimate(stored: Result, presses: Sequence[StoredPress]) -> Pairs:
    """The edited presses with the entries of the provenance, which has a list for each role in the order of presses."""
    queues = _entries_by_role(stored)
    if not all(FORCE in entry for queue in queues.values() for entry in queue):
        return []
    pairs: Pairs = []
    for at, press in enumerate(presses):
        if press.version == 1:
            if queues.get(press.role):
                queues[press.role].popleft()
            continue
        later = [other.role for other in presses[at + 1 :] if other.version == 1]
        free = [role for role, queue in queues.items() if len(queue) > later.count(role)]
        # A name never changes, and a role seldom does.
        free.sort(key=lambda role: (queues[role][0].get("name") != press.name, role != press.role))
        if free:
            pairs.append((press, free[0], queues[free[0]].popleft()))
        elif press.role in queues:
            pairs.append((press, "another", {}))
    return pairs


def _entries_by_role(stored: Result) -> dict[str, deque[Mapping[str, Any]]]:
    reference = REFERENCE_ROLES[stored.kind]
    if stored.kind == "inclusion":
        return {"target": deque(_entries(stored, "images")), reference: deque(_entries(stored, "reference"))}
    entries = _entries(stored, "presses")
    return {
        "target": deque(entry for entry in entries if entry.get("ball_radius_mm") is None),
        reference: deque(entry for entry in entries if entry.get("ball_radius_mm") is not None),
    }


def _entries(stored: Result, name: str) -> list[Mapping[str, Any]]:
    """Entries of frames; a bundle may have other content there."""
    listed = stored.estimate.provenance.get(name)
    return [item for item in listed if isinstance(item, Mapping)] if isinstance(listed, (list, tuple)) else []


def _force(record: TargetRecord, stored: Result, press: StoredPress) -> float | None:
    """The force that a repetition would use: that of the press, else of an estimate that of the calibration."""
    calibration = record.calibrations.get(stored.calibration)
    if press.force_n is not None or stored.kind == MAP or calibration is None:
        return press.force_n
    from tsis.calibration.frames import apply_calibration  # slow to import, rarely needed

    on_tissue = stored.kind == "inclusion"
    try:
        frames, _ = apply_calibration(
            calibration, [record.image(press)], identity=stored.calibration, on_tissue=on_tissue
        )
    except TsisError:  # no force line, or an unreadable frame
        return None
    return frames[0].force_n
