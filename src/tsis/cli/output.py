"""What commands print: tables for people, JSON for programs."""

from __future__ import annotations

import io
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

import tsis
from tsis.cli.progress import WITHHELD, progress_bar
from tsis.present.terminal import print_page, print_tables

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from contextlib import AbstractContextManager
    from typing import Any

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.present.page import Page, Table


RESULT, PAGE = "result.json", "index.html"


def print_json(document: Mapping[str, Any]) -> None:
    """Write a result, which `tsis.present.document.envelope` made, to standard output, and nothing else there."""
    sys.stdout.write(result_bytes(document).decode())
    sys.stdout.flush()


def print_watched(counts: Mapping[str, int]) -> None:
    """Write the result of a watched camera: its frames, and how many of them had each flag."""
    flagged = {name: counts[name] for name in sorted(counts) if name != "frames"}
    print_json(tsis.present.document.envelope("acquire", "watch", frames=counts.get("frames", 0), flagged=flagged))


def result_bytes(document: Mapping[str, Any]) -> bytes:
    """Content of a result's file; `KeyError` where the document names no schema."""
    return tsis.files.canonical_json.json_bytes({"schema": document["schema"], **document})


def plain_json_bytes(values: Mapping[str, Any]) -> bytes:
    """Content of a JSON file that is no result, such as a sidecar."""
    return tsis.files.canonical_json.json_bytes(values)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CommandOutcome:
    """What a command found: for programs, and as the page for people; the exit code is 3 where it is untrusted."""

    document: Mapping[str, Any]
    page: Page
    files: Mapping[str, bytes] = field(default_factory=dict)
    trusted: bool = True

    def with_notes(self, *notes: str) -> CommandOutcome:
        """The same with further notes for people."""
        return replace(self, page=replace(self.page, notes=(*self.page.notes, *notes)))


def leave(*, trusted: bool) -> None:
    """End a command whose result was printed, with the exit code 3 where it must not be trusted."""
    if not trusted:
        raise typer.Exit(WITHHELD)


def publish(outcome: CommandOutcome, out: Path, *, as_json: bool) -> None:
    """Write the folder ``out`` (or the next free name) and print what is in it."""
    print_outcome(outcome, write_outcome(outcome, out), as_json=as_json)
    leave(trusted=outcome.trusted)


def write_outcome(outcome: CommandOutcome, out: Path) -> Path:
    """Write the folder ``out`` (or the next free name), whole or not at all; which one it is."""
    files = {
        **outcome.files,
        RESULT: result_bytes(outcome.document),
        "index.html": tsis.present.html.html_bytes(outcome.page),
    }
    return tsis.files.result_folder.write_folder(tsis.files.result_folder.free_folder(out), files)


def print_outcome(outcome: CommandOutcome, folder: Path, *, as_json: bool) -> None:
    """Print what was found, and where it is."""
    if as_json:
        print_json({**outcome.document, "folder": str(folder)})
        return
    print_page(outcome.page, where=f"Page: {folder / 'index.html'}")


Out = Annotated[
    Path | None,
    typer.Option(
        "--out", help="Folder for the figures and result.json; a number is added when it exists.", metavar="FOLDER"
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CommandResult:
    """What a command found; a figure is a call that draws it, made only when somebody asked for a folder."""

    document: Mapping[str, Any]
    tables: tuple[Table, ...] = ()
    notes: tuple[str, ...] = ()
    figures: Mapping[str, Callable[[], Figure]] = field(default_factory=dict)
    arrays: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)  # NPY files of the folder


def show_result(result: CommandResult, out: Path | None, *, as_json: bool, trusted: bool = True) -> None:
    """Write the folder when one is named, and print the answer; its document carries the notes too."""
    document = {**result.document, "notes": list(result.notes)}
    folder = None
    if out is not None:
        destination = tsis.files.result_folder.free_folder(out)  # refused before anything is drawn
        files = {f"{name}.png": _png(draw()) for name, draw in result.figures.items()}
        files |= {f"{name}.npy": npy_bytes(values) for name, values in result.arrays.items()}
        folder = tsis.files.result_folder.write_folder(destination, {**files, RESULT: result_bytes(document)})
    if as_json:
        print_json(document if folder is None else {**document, "folder": str(folder)})
    else:
        print_tables(result.tables, result.notes, where="" if folder is None else f"Figures: {folder}")
    leave(trusted=trusted)


def npy_bytes(values: NDArray[Any]) -> bytes:
    """Content of an NPY file."""
    buffer = io.BytesIO()
    np.save(buffer, values, allow_pickle=False)
    return buffer.getvalue()


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=150)
    return buffer.getvalue()


def surrogate_progress() -> AbstractContextManager[Callable[[int, int], None]]:
    """A bar that shows how the tables of a new probe or prior are built."""
    return progress_bar("solving the press for this probe (cached for next time)")
