"""Which frames of a batch are stored already, and in which target."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from sqlalchemy import select

from tsis.records.store import MOST_AT_ONCE, press_of_row, press_query, press_table, target_of_row, target_table

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from tsis.records._values import StoredPress, Target
    from tsis.records.importing._found import IncomingPress
    from tsis.records.store import Store


def numbered(store: Store, number: int) -> Target | None:
    """The target that people call by this number; None where there is none yet."""
    return _target(store, target_table.c.number == number)


def stored_frames(store: Store, frames: Sequence[IncomingPress]) -> tuple[StoredPress, ...]:
    """Presses of any target that may be one of these: by their frame, or by the file that it came from.

    Another release of the library that packs frames gives the same levels another name; the file's own hash, where a
    press tells it, is still the same then.
    """
    result = store.presses_of_frames([frame.frame for frame in frames])
    given = {press.frame for press in result}
    missing = {frame.sha256: frame.name for frame in frames if frame.frame not in given}
    further = _named(store, sorted(set(missing.values())))
    return (*result, *(press for press in further if press.settings.get("sha256") in missing))


def matched(frames: Sequence[IncomingPress], presses: Iterable[StoredPress]) -> list[StoredPress | None]:
    """The press of each frame, no press for two of them; None where there is none.

    It is one of the same levels or the same file that has the same name, else was taken at the same time.
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
    """The target that these frames belong to; None where they make a new one.

    It is the one that holds all presses on the target among them. Frames of the untouched probe or of plain tissue may
    serve several targets and tell nothing; where there is no other, all must be there. So is one whose every press is
    among these frames, for then an import was cut short.

    Parameters
    ----------
    store, frames
        Where, and what is to be entered.
    presses
        As of `stored_frames`.
    """
    reporting = [frame for frame in frames if frame.role == "target"] or list(frames)
    result: list[tuple[int, Target]] = []
    for identity in dict.fromkeys(press.target for press in presses):
        own = [press for press in presses if press.target == identity]
        reported = sum(press is not None for press in matched(reporting, own))
        if reported == 0:
            continue
        target = _target(store, target_table.c.id == identity)
        stored = sum(press is not None for press in matched(frames, own))
        if target is not None and (reported == len(reporting) or stored == store.press_count(target)):
            result.append((stored, target))
    return max(result, key=lambda item: (item[0], -item[1].number))[1] if result else None


def _unused(candidates: deque[StoredPress] | None, used: set[str]) -> StoredPress | None:
    while candidates and candidates[0].id in used:
        candidates.popleft()
    return candidates[0] if candidates else None


def _named(store: Store, names: Sequence[str]) -> list[StoredPress]:
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
