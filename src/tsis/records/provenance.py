"""Provenance of results, and the differences of two estimates."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping
from functools import cache
from importlib import metadata, resources
from typing import TYPE_CHECKING, Any

from tsis.__about__ import __version__
from tsis.files.json_values import free_to_json

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from importlib.resources.abc import Traversable

    from tsis.records.values import StoredEstimate, StoredMap


LIBRARIES = ("numpy", "scipy", "numba", "scikit-image", "pillow")


def environment() -> dict[str, Any]:
    """Versions of program, language and libraries, and the SHA-256 of the program's code."""
    return {
        "tsis": __version__,
        "code_sha256": code_sha256(),
        "python": platform.python_version(),
        "machine": platform.machine(),
        "libraries": {name: metadata.version(name) for name in LIBRARIES},
    }


@cache
def code_sha256() -> str:
    """SHA-256 over every file of this package that can change a result."""
    code = hashlib.sha256()
    for name, file in sorted(_files(resources.files("tsis"), "")):
        content = file.read_bytes()
        code.update(f"{name}\0{len(content)}\0".encode() + content)
    return code.hexdigest()


def _files(folder: Traversable, location: str) -> Iterator[tuple[str, Traversable]]:
    for path in folder.iterdir():
        name = f"{location}/{path.name}"
        if path.is_dir():
            yield from _files(path, name)
        elif path.name.endswith((".py", ".toml", ".npz")):
            yield name, path


FRAMES = ("images", "reference", "presses")  # lists of frames in a provenance
STATED_ELSEWHERE = frozenset({"notice", "tsis", "prior", "scan", *FRAMES})  # a scan by its name
LABELS = frozenset({"name", "settings"})  # do not change any number
SHOWN = 60


def changes(before: StoredEstimate | StoredMap, after: StoredEstimate | StoredMap) -> tuple[str, ...]:
    """Differences of two estimates, or of two maps, apart from their numbers, one clause each.

    Examples
    --------
    >>> from tsis.records.provenance import environment_changes
    >>> list(environment_changes(
    ...     {"tsis": "0.1.0", "libraries": {"numpy": "2.4.5"}}, {"tsis": "0.1.0", "libraries": {"numpy": "2.4.6"}}))
    ['numpy 2.4.5 -> 2.4.6']
    """
    was, now = _json_values(before.estimate.provenance), _json_values(after.estimate.provenance)
    return (
        *environment_changes(before.environment, after.environment),
        *_differences("the probe", before.probe, after.probe),
        *_frame_changes(was, now),
        *_option_changes(_json_values(before.options), _json_values(after.options)),
        *_prior_changes(before, after),
        *_other_changes(was, now),
    )


def environment_changes(was: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    """Changes of the code, this program, Python, the machine and the libraries."""
    if was.get("code_sha256") != now.get("code_sha256"):
        codes = (str(item.get("code_sha256", "unknown"))[:12] for item in (was, now))
        yield "the code changed ({} -> {})".format(*codes)
    for name in ("tsis", "python", "machine"):
        yield from _differences(name, was.get(name), now.get(name), arrow=" ")
    libraries = was.get("libraries", {}), now.get("libraries", {})
    for name in sorted({*libraries[0], *libraries[1]}):
        yield from _differences(name, libraries[0].get(name), libraries[1].get(name), arrow=" ")


def _frame_changes(was: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    """Frames that were replaced, added or removed, or have other metadata."""
    for kind in FRAMES:
        frames = _entries(was.get(kind)), _entries(now.get(kind))
        if len(frames[0]) != len(frames[1]):
            yield f"the inputs changed: {len(frames[0])} -> {len(frames[1])} frames of {kind!r}"
            continue
        for number, (item, other) in enumerate(zip(*frames, strict=True), start=1):
            label = item.get("name") or f"{kind} {number}"
            if item.get("sha256") != other.get("sha256"):
                yield f"the inputs changed: frame {label}"
            for name in sorted({*item, *other} - LABELS - {"sha256", "seen"}):
                yield from _differences(f"the inputs changed: {name} of {label}", item.get(name), other.get(name))


def _entries(frames: Any) -> list[Mapping[str, Any]]:
    """Entries of frames; a bundle may have other content there."""
    return [frame for frame in frames if isinstance(frame, Mapping)] if isinstance(frames, list) else []


def _option_changes(was: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    for name in sorted({*was, *now} - {"prior"}):
        yield from _differences(f"the options changed: {name}", was.get(name), now.get(name))


def _prior_changes(before: StoredEstimate | StoredMap, after: StoredEstimate | StoredMap) -> Iterator[str]:
    """Changes of the prior: that of the options, or the default that the provenance states."""
    stated = all(item.options.get("prior") for item in (before, after))
    sources = (item.options if stated else item.estimate.provenance for item in (before, after))
    was, now = (_json_values({"prior": item.get("prior")})["prior"] for item in sources)
    if not isinstance(was, Mapping) or not isinstance(now, Mapping):  # a bundle may have other content there
        yield from _differences("the prior changed", was, now)
        return
    for name in sorted({*was, *now}):
        what = f"the options changed: {name} of the prior" if stated else f"the default prior changed: {name}"
        yield from _differences(what, was.get(name), now.get(name))


def _other_changes(was: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    """Changes of other provenance: probe, calibration, method, tables."""
    for name in sorted({*was, *now} - STATED_ELSEWHERE):
        item, other = was.get(name), now.get(name)
        if isinstance(item, Mapping) and isinstance(other, Mapping):
            for part in sorted({*item, *other} - LABELS):
                yield from _differences(f"the {name} changed: {part}", item.get(part), other.get(part))
        else:
            yield from _differences(f"the {name} changed:", item, other, arrow=" ")


def _differences(what: str, was: Any, now: Any, *, arrow: str = ": ") -> Iterator[str]:
    if was == now:
        return
    if isinstance(was, (Mapping, list)) or isinstance(now, (Mapping, list)):
        yield what
        return
    yield f"{what}{arrow}{shown_value(was)} -> {shown_value(now)}"


def shown_value(value: Any) -> str:
    """A value in a message."""
    if value is None:
        return "none"
    return f"{value:g}" if isinstance(value, float) else str(value)[:SHOWN]


def _json_values(value: Mapping[str, Any]) -> Mapping[str, Any]:
    """The values as a store returns them."""
    values: Mapping[str, Any] = free_to_json(value, "provenance")
    return values


_NOTHING_CHANGED = "Nothing changed: bit for bit the same."


def comparison_message(same: bool, causes: Sequence[str]) -> str:
    """A message on whether the numbers changed, and why.

    Examples
    --------
    >>> comparison_message(True, ())
    'Nothing changed: bit for bit the same.'
    >>> comparison_message(False, ("numpy 2.4.5 -> 2.4.6",))
    'The result changed: numpy 2.4.5 -> 2.4.6.'
    """
    text = "; ".join(causes)
    if same:
        return f"Bit for bit the same, although not all else is: {text}." if text else _NOTHING_CHANGED
    if text:
        return f"The result changed: {text}."
    return "The result changed, although nothing that is written down did: look at the processor and its settings."
