"""``tsis doctor``: what is installed, and what is missing."""

from __future__ import annotations

import os
import platform
import shutil
from dataclasses import asdict, dataclass
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from packaging.requirements import Requirement

import tsis
from tsis.__about__ import __version__
from tsis.cli.options import AsJson
from tsis.cli.output import print_json
from tsis.cli.progress import FAILED, waiting
from tsis.errors import PluginError, RecordsError
from tsis.present.page import Table
from tsis.present.terminal import people, print_notice, rich_table

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator


SHOWN = ("numpy", "scipy", "numba", "llvmlite", "matplotlib", "scikit-image")
LEAST_FREE_GB = 1.0
OK, ABSENT, PROBLEM = "ok", "absent", "problem"  # absent: an optional part


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One line of the answer.

    Attributes
    ----------
    what, state, detail
        The part; ``"ok"``, ``"absent"`` (an optional part is not installed) or ``"problem"``; its version or place.
    cure
        The command or step that changes the state; empty where none is needed.
    """

    what: str
    state: str
    detail: str
    cure: str = ""


def doctor(
    *,
    cameras: Annotated[bool, typer.Option(help="Search for cameras, which takes seconds.")] = True,
    as_json: AsJson = False,
) -> None:
    """Say what is installed, where data lie, which cameras answer, and what is missing with its cure.

    The exit code is 1 where something that the plain install needs is broken. No GPU is needed.
    """
    findings = [*_versions(), *_extras(), *_plugins(), *_places()]
    if cameras:
        with waiting("searching for cameras"):
            findings += _cameras()
    if as_json:
        print_json(tsis.present.document.envelope("doctor", findings=[asdict(finding) for finding in findings]))
    else:
        _print(findings)
    if any(finding.state == PROBLEM for finding in findings):
        raise typer.Exit(FAILED)


def _print(findings: Iterable[Finding]) -> None:
    console = people()
    shown = tuple(findings)
    rows = tuple((finding.what, finding.state, finding.detail) for finding in shown)
    table = Table(title="Installation", columns=("", "state", "version or place"), values=rows)
    console.print(rich_table(table))
    for finding in shown:
        if finding.cure:
            console.print(f"- {finding.what}: {finding.cure}", markup=False, soft_wrap=True)
    print_notice(console)


def _versions() -> Iterator[Finding]:
    yield Finding(what="tsis", state=OK, detail=__version__)
    yield Finding(what="Python", state=OK, detail=f"{platform.python_version()}, {platform.platform()}")
    for name in SHOWN:
        yield Finding(what=name, state=OK, detail=metadata.version(name))


def _extras() -> Iterator[Finding]:
    """Each extra by name, as the installed metadata lists them."""
    package = metadata.metadata("tsis")
    requirements = [Requirement(text) for text in metadata.requires("tsis") or []]
    for extra in sorted(set(package.get_all("Provides-Extra") or ()) - {"all"}):
        names = [
            item.name
            for item in requirements
            if item.name != "tsis" and item.marker is not None and item.marker.evaluate({"extra": extra})
        ]
        lacking = [name for name in names if not _is_installed(name)]
        if not names:  # a system library, which the search for cameras finds
            continue
        yield Finding(
            what=f"extra {extra}",
            state=ABSENT if lacking else OK,
            detail=f"without {', '.join(lacking)}" if lacking else ", ".join(names),
            cure=f'python -m pip install "tsis[{extra}]"' if lacking else "",
        )


def _plugins() -> Iterator[Finding]:
    """Each plug-in that an installed package offers, loaded."""
    for kind in tsis.plugins.PLUGIN_KINDS:
        for name, plugin in tsis.plugins.find_plugins(kind).items():
            try:
                tsis.plugins.load_plugin(kind, name)
            except PluginError as error:  # everything else works without it
                yield Finding(what=f"plug-in {name}", state=ABSENT, detail=plugin.package, cure=str(error))
            else:
                yield Finding(what=f"plug-in {name}", state=OK, detail=f"{plugin.package}, {kind}")


def _is_installed(name: str) -> bool:
    try:
        metadata.version(name)
    except metadata.PackageNotFoundError:
        return False
    return True


def _places() -> Iterator[Finding]:
    cache = tsis.files.cache.cache_folder()
    usable = _is_writable(cache)
    yield Finding(
        what="cache",
        state=OK if usable else PROBLEM,
        detail=f"{cache}, {_megabytes(cache):.0f} MB",
        cure="" if usable else "make the folder writable, or set TSIS_CACHE_DIR to one that is",
    )
    free_gb = shutil.disk_usage(_existing(cache)).free / 1e9
    yield Finding(
        what="free disk",
        state=OK if free_gb >= LEAST_FREE_GB else PROBLEM,
        detail=f"{free_gb:.1f} GB beside the cache",
        cure="" if free_gb >= LEAST_FREE_GB else f"free at least {LEAST_FREE_GB:g} GB",
    )
    if find_spec("sqlalchemy") is not None:
        yield _store()


def _store() -> Finding:
    folder = tsis.records.store.default_folder("phantom")
    if not (folder / tsis.records.database.DATABASE_FILE).is_file():
        return Finding(what="store", state=OK, detail=f"{folder}, not yet made: tsis demo --save")
    try:
        with tsis.records.store.open_store(folder, kind="phantom", create=False) as store:
            return Finding(what="store", state=OK, detail=f"{folder}, {len(store.targets())} targets")
    except RecordsError as error:
        return Finding(what="store", state=PROBLEM, detail=str(folder), cure=str(error))


def _cameras() -> Iterator[Finding]:
    search = tsis.instrument.discovery.find_cameras()
    names = ", ".join(item.spec for item in search.cameras) or "none"
    yield Finding(what="cameras", state=OK, detail=f"{names}; virtual always")
    for source, message in search.missing.items():
        yield Finding(what=f"camera source {source}", state=ABSENT, detail="cannot be searched", cure=message)


def _existing(folder: Path) -> Path:
    """The folder, or the nearest one above it that exists."""
    return next(place for place in (folder, *folder.parents) if place.exists())


def _is_writable(folder: Path) -> bool:
    place = _existing(folder)
    return place.is_dir() and os.access(place, os.W_OK)


def _megabytes(folder: Path) -> float:
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()) / 1e6
