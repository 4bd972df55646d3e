"""``tsis contacts``: contacts in frames of a gel sensor."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

import tsis
from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.cli._options import AsJson
from tsis.cli._output import leave, print_json, print_tables
from tsis.cli._progress import progress_bar
from tsis.cli._sensor import SensorOption
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tsis.model import GelSensor


MOST_GEL_FRAMES = 2000
GelFrames = Annotated[list[Path], typer.Argument(help="Frames of the sensor, or a folder that tsis acquire recorded.")]
GelReference = Annotated[
    Path | None,
    typer.Option(
        "--reference",
        help="Frame of the untouched sensor; left out: that of the sensor's file, or the median of many frames.",
    ),
]


def contacts(
    frames: GelFrames,
    *,
    sensor: SensorOption = "",
    reference: GelReference = None,
    sequence: Annotated[
        bool, typer.Option("--sequence", help="Frames are of one press in the order of time: refuse moving ones.")
    ] = False,
    csv: Annotated[Path | None, typer.Option("--csv", help="Table of the contacts to write.")] = None,
    page: Annotated[Path | None, typer.Option("--html", help="Page with overlays to write.")] = None,
    figure: Annotated[Path | None, typer.Option("--figure", help="Picture of the overlays to write.")] = None,
    as_json: AsJson = False,
) -> None:
    """Find the contact in frames of a gel sensor: centre, radius or ellipse, area, and a quality with reasons.

    The exit code is 3 where no contact is good.
    """
    for path in (csv, page, figure):
        if path is not None:
            tsis.report.require_absent(path)
    chosen = chosen_sensor(sensor)
    paths = gel_frame_paths(frames)
    levels = [read_gel_frame(path) for path in paths]
    with progress_bar("finding contacts") as advance:
        found = tsis.imaging.contacts(
            levels,
            sensor=chosen,
            reference=read_gel_reference(chosen, reference),
            names=[path.name for path in paths],
            sequence=sequence or len(paths) > len(frames),
            progress=advance,
        )
    provenance = {"notice": RESEARCH_USE_ONLY, "tsis": __version__, "sensor": chosen.name, "frames": len(paths)}
    written: list[str] = []
    outputs: tuple[tuple[Path | None, Callable[[], bytes]], ...] = (
        (csv, lambda: tsis.report.contacts_csv(found)),
        (page, lambda: tsis.report.gel_contacts_report(levels, found, provenance=provenance)),
        (figure, lambda: _picture(levels, found)),
    )
    for path, content in outputs:
        if path is not None:
            tsis.files.write_durably(path, content())
            written.append(str(path))
    if as_json:
        print_json(
            tsis.report.envelope(
                "contacts", sensor=chosen.name, contacts=tsis.report.contact_documents(found), files=written
            )
        )
    else:
        table = Table(*tsis.report.CONTACT_HEADINGS, title="Contacts")
        for row in tsis.report.gel_contact_rows(found):
            table.add_row(*row)
        print_tables([table], tsis.report.contact_notes(found), where=", ".join(written))
    leave(trusted=any(contact.good for contact in found))


def chosen_sensor(sensor: str) -> GelSensor:
    """The sensor that ``--sensor`` names; without one, a sentence on which file and how to make it."""
    if not sensor:
        raise InputError(
            "frames of a gel sensor need its file: give --sensor gelsight-mini, or another that tsis sensor show "
            "lists, or a file of your own that tsis sensor new makes"
        )
    return tsis.catalog.load_sensor(sensor)


def gel_frame_paths(frames: Sequence[Path]) -> list[Path]:
    """Files of the frames; those of a recorded folder in the order of time."""
    if len(frames) == 1 and frames[0].is_dir():
        frames = [path for path, _ in tsis.instrument.recording.read_recording_index(frames[0])]
    if len(frames) > MOST_GEL_FRAMES:
        raise InputError(
            f"frames must be at most {MOST_GEL_FRAMES}; got {len(frames)}: give every second one, or fewer"
        )
    return list(frames)


def read_gel_frame(path: Path) -> NDArray[Any]:
    """Levels of a frame as stored, in colour where the file has colour."""
    return tsis.instrument.read_levels(path)


def read_gel_reference(sensor: GelSensor, reference: Path | None) -> NDArray[Any] | None:
    """Levels of the given reference, or of the one that the sensor's file names; None without either."""
    if reference is None and sensor.reference_file is not None:
        reference = Path(sensor.reference_file)
    return None if reference is None else read_gel_frame(reference)


def _picture(levels: Sequence[NDArray[Any]], found: Sequence[Any]) -> bytes:
    from matplotlib.figure import Figure

    drawn = Figure(figsize=tsis.report.overlay_inches(len(found)), layout="constrained")
    tsis.report.draw_contacts(drawn, levels, found)
    buffer = io.BytesIO()
    drawn.savefig(buffer, format="png", dpi=130)
    return buffer.getvalue()
