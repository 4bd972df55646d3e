"""What is so, as pairs of a term and what it is."""

from __future__ import annotations

from importlib import metadata
from typing import TYPE_CHECKING

from tsis.console.pages.words import time_words
from tsis.records.environment import environment

if TYPE_CHECKING:
    from tsis.calibration.cited import UsableCalibration
    from tsis.console.bench import Bench, BenchState
    from tsis.records import Store

Facts = tuple[tuple[str, str], ...]

ALSO = ("matplotlib", "sqlalchemy", "nicegui", "fastapi", "uvicorn")  # beside those that change results
SHORT = 16  # digits of a SHA-256 that tell one calibration from another on a page


def version_facts() -> Facts:
    """Of this program, of what it runs on, and of the libraries that it rests on."""
    found = environment()
    libraries = {**found["libraries"], **{name: metadata.version(name) for name in ALSO}}
    return (
        ("tsis", found["tsis"]),
        ("Its code", f"SHA-256 {found['code_sha256'][:SHORT]}…"),
        ("Python", f"{found['python']} on {found['machine']}"),
        *libraries.items(),
    )


def calibration_facts(state: BenchState, cited: UsableCalibration | None) -> Facts:
    """The calibration in force."""
    if cited is None and state.camera.choice.is_virtual:
        return (("In force", "the virtual probe's own, once it runs"),)
    if cited is None:
        return (("In force", "none; lengths are in pixels, and nothing can be estimated"),)
    known = cited.known
    dates = (
        (("Made", "with the virtual probe; it does not age"),)
        if known.made is None or known.expires is None
        else (("Made", time_words(known.made)), ("Good until", time_words(known.expires)))
    )
    return (
        ("In force", known.name),
        ("Identity", f"SHA-256 {cited.identity[:SHORT]}…"),
        *dates,
        ("Probe", known.probe or "not written down"),
        ("Camera", known.camera or "any; not written down"),
    )


def camera_facts(state: BenchState) -> Facts:
    """The camera and the seed of the virtual one."""
    now = state.camera
    size = f"{now.columns} x {now.rows} pixels" if now.rows else "not known before it runs"
    found = [
        ("Camera", now.name or ("the virtual probe" if now.choice.is_virtual else now.choice.spec)),
        ("Mode", now.mode or "not known before it runs"),
        ("Picture", size),
    ]
    if now.choice.is_virtual:
        found += [
            ("Probe", now.choice.probe),
            ("It presses", now.choice.phantom),
            ("Seed of its errors", str(now.choice.seed)),
        ]
    return tuple(found)


def place_facts(bench: Bench) -> Facts:
    """Where things are kept, and how much."""
    store = bench.store
    return (
        ("Snapshots and sequences", str(bench.terms.workspace.resolve())),
        ("Store of records", str(store.folder.resolve())),
        ("Its rows", "in SQLite, in that folder" if bench.terms.database is None else "in PostgreSQL"),
        ("Its kind", f"{store.kind}s"),
        *_counts(store),
    )


def _counts(store: Store) -> Facts:
    found = store.targets()
    return (
        ("Targets", str(len(found))),
        ("Presses", str(sum(each.presses for each in found))),
        ("Estimates", str(sum(each.estimates for each in found))),
    )
