"""Matching of the frames of a batch with stored presses and their target."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from sqlalchemy import select

from tsis.records.store import MOST_AT_ONCE, press_of_row, press_query, press_table, target_of_row, target_table

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from tsis.records._values import StoredPress, Target
    from tsis.records.importing._batch import IncomingPress
    from tsis.records.store import Store


def target_by_number(store: Store, number: int) -> Target | None:
    """The target of this number, or None."""
    return _target(store, target_table.c.number == number)


def stored_frames(store: Store, frames: Sequence[IncomingPress]) -> tuple[StoredPress, ...]:
    """Presses of any target with the same frame or the same source file.

    Another release of the PNG library may give the same levels another hash; the hash of the source file is the same.
    """
    result = store.presses_of_frames([frame.frame for frame in frames])
    present = {press.frame for press in result}
    missing = {frame.sha256: frame.name for frame in frames if frame.frame not in present}
    further = _presses_by_name(store, sorted(set(missing.values())))
    return (*result, *(press for press in further if press.settings.get("sha256") in missing))


def match_presses(frames: Sequence[IncomingPress], presses: Iterable[StoredPress]) -> list[StoredPress | None]:
    """The press of each frame, each press at most once, or None.

    A press matches by levels or source file, and by name, else by time.
    """
    where: dict[tuple[object, object], deque[StoredPress]] = {}
    for press in presses:
        for content in {press.frame, press.settings.get("sha256")} - {None}:
            for label in (press.name, press.taken):
                where.setdefault((content, label), deque()).append(press)
    used: set[str] = set()
    result: list[StoredPress | None] = []
    for frame in frames:
        positions = [(content, label) for label in (frame.name, frame.taken) for content in (frame.frame, frame.sha256)]
        same = next((item for position in positions if (item := _unused(where.get(position), used)) is not None), None)
        if same is not None:
            used.add(same.id)
        result.append(same)
    return result


def target_with(store: Store, frames: Sequence[IncomingPress], presses: Sequence[StoredPress]) -> Target | None:
    """The target of these frames, or None for a new one; ``presses`` is the result of `stored_frames`.

    It is the target that has all their presses on a target, or whose presses are all among them, after an interrupted
    import. Frames of the untouched probe and reference presses may serve several targets, so they count only where
    there are no others.
    """
    decisive = [frame for frame in frames if frame.role == "target"] or list(frames)
    result: list[tuple[int, Target]] = []
    for identity in dict.fromkeys(press.target for press in presses):
        own = [press for press in presses if press.target == identity]
        matches = sum(press is not None for press in match_presses(decisive, own))
        if matches == 0:
            continue
        target = _target(store, target_table.c.id == identity)
        stored = sum(press is not None for press in match_presses(frames, own))
        if target is not None and (matches == len(decisive) or stored == store.press_count(target)):
            result.append((stored, target))
    return max(result, key=lambda item: (item[0], -item[1].number))[1] if result else None


def _unused(candidates: deque[StoredPress] | None, used: set[str]) -> StoredPress | None:
    while candidates and candidates[0].id in used:
        candidates.popleft()
    return candidates[0] if candidates else None


def _presses_by_name(store: Store, names: Sequence[str]) -> list[StoredPress]:
    presses: list[StoredPress] = []
    with store.database.reading() as connection:
        for at in range(0, len(names), MOST_AT_ONCE):
            some = press_table.c.name.in_(names[at : at + MOST_AT_ONCE])
            presses += [press_of_row(row._asdict()) for row in connection.execute(press_query().where(some))]
    return presses


def _target(store: Store, which: object) -> Target | None:
    with store.database.reading() as connection:
        row = connection.execute(select(target_table).where(which)).first()  # type: ignore[arg-type]
    return None if row is None else target_of_row(row._asdict())
