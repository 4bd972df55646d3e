"""A subject's records without what may name the person: notes, names of files, settings that hold paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tsis.records import Dossier, StoredEstimate

LEFT_OUT = frozenset({"settings"})  # by name, wherever they stand
SAID = "Notes, settings and names of files are left out, since this is a subject: the page shows the pseudonym only."


def without_names(dossier: Dossier) -> Dossier:
    """The same with presses by their number; that of a phantom as it is.

    A pseudonym is what the store holds as the target's name. People write names of persons into notes, and cameras and
    folders put them into names of files; where a sentence of the estimate quotes such a name, the press's number
    takes its place.
    """
    if dossier.target.kind != "subject":
        return dossier
    words = {press.name: f"press {number}" for number, press in enumerate(dossier.presses, 1) if press.name}
    for stored in dossier.estimates:
        for name in _quoted(stored.estimate.provenance):
            words.setdefault(name, "a press")
    return replace(
        dossier,
        target=replace(dossier.target, note=""),
        presses=tuple(replace(press, name="", note="", settings={}) for press in dossier.presses),
        estimates=tuple(_estimate(stored, words) for stored in dossier.estimates),
    )


def _estimate(stored: StoredEstimate, words: Mapping[str, str]) -> StoredEstimate:
    told = stored.estimate
    return replace(
        stored,
        options=_plain(stored.options, words),
        estimate=replace(
            told,
            notes=tuple(_reworded(note, words) for note in told.notes),
            identifiability=_reworded(told.identifiability, words),
            provenance=_plain(told.provenance, words),
        ),
    )


def _plain(value: Any, words: Mapping[str, str], *, listed: bool = False) -> Any:
    """Nested values with other words, without settings, and without the names of what is listed: frames."""
    if isinstance(value, Mapping):
        left_out = LEFT_OUT | ({"name"} if listed else set())
        return {name: _plain(inner, words) for name, inner in value.items() if name not in left_out}
    if isinstance(value, str):
        return _reworded(value, words)
    if isinstance(value, Sequence):
        return [_plain(inner, words, listed=True) for inner in value]
    return value


def _quoted(value: Any) -> list[str]:
    """Names of the frames that a provenance lists."""
    if isinstance(value, Mapping):
        return [name for inner in value.values() for name in _quoted(inner)]
    if isinstance(value, Sequence) and not isinstance(value, str):
        own = [inner["name"] for inner in value if isinstance(inner, Mapping) and isinstance(inner.get("name"), str)]
        return [name for name in own if name]
    return []


def _reworded(text: str, words: Mapping[str, str]) -> str:
    for name in sorted(words, key=len, reverse=True):
        text = text.replace(name, words[name])
    return text
