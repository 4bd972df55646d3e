"""``tsis contacts``: contacts in frames."""

from __future__ import annotations

import io
import itertools
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.cli.options import AsJson
from tsis.cli.output import leave, print_json
from tsis.cli.progress import progress_bar
from tsis.cli.sensor import (
    GelFrames,
    GelReference,
    SensorOption,
    chosen_sensor,
    gel_frame_paths,
    read_gel_frame,
    read_gel_reference,
)
from tsis.present.terminal import print_page

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray


def contacts(
    frames: GelFrames,
    *,
    sensor: SensorOption = "",
    reference: GelReference = None,
    sequence: Annotated[
        bool, typer.Option("--sequence", help="Frames are of one press in the order of time: refuse moving ones.")
    ] = False,
    csv: Annotated[
        Path | None,
        typer.Option("--csv", help="Table of the contacts to write, with forces from JSON files beside the frames."),
    ] = None,
    page: Annotated[Path | None, typer.Option("--html", help="Page with overlays to write.")] = None,
    figure: Annotated[Path | None, typer.Option("--figure", help="Picture of the overlays to write.")] = None,
    as_json: AsJson = False,
) -> None:
    """Find the contact in frames of a gel sensor: centre, radius or ellipse, area, and a quality with reasons.

    The exit code is 3 where no contact is good.
    """
    for path in (csv, page, figure):
        if path is not None:
            tsis.files.result_folder.require_absent(path)
    chosen = chosen_sensor(sensor)
    paths = gel_frame_paths(frames)
    levels = [read_gel_frame(path) for path in paths]
    with progress_bar("finding contacts") as advance:
        gel_contacts = tsis.imaging.gel_contact.contacts(
            levels,
            sensor=chosen,
            reference=read_gel_reference(chosen, reference),
            names=[path.name for path in paths],
            sequence=sequence or len(paths) > len(frames),
            progress=advance,
        )
    provenance = {"notice": RESEARCH_USE_ONLY, "tsis": __version__, "sensor": chosen.name, "frames": len(paths)}
    shown = tsis.present.gel_sensor.gel_contacts_page(levels, gel_contacts, provenance=provenance)
    written: list[str] = []
    outputs: tuple[tuple[Path | None, Callable[[], bytes]], ...] = (
        (csv, lambda: tsis.present.gel_sensor.contacts_csv(gel_contacts, [_sidecar_force(path) for path in paths])),
        (page, lambda: tsis.present.html.html_bytes(shown)),
        (figure, lambda: _picture(levels, gel_contacts)),
    )
    for path, content in outputs:
        if path is not None:
            tsis.files.atomic.write_durably(path, content())
            written.append(str(path))
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "contacts",
                sensor=chosen.name,
                contacts=tsis.present.gel_sensor.contact_documents(gel_contacts),
                files=written,
            )
        )
    else:
        notes = (*shown.notes, *missing_frames_note(frames))
        print_page(replace(shown, notes=notes), where=", ".join(written))
    leave(trusted=any(contact.good for contact in gel_contacts))


GAP = 1.8  # times the median time between frames


def missing_frames_note(frames: Sequence[Path]) -> tuple[str, ...]:
    """A sentence on gaps of a recorded folder; none for a folder without gaps, or for single frames."""
    if len(frames) != 1 or not frames[0].is_dir():
        return ()
    times = [arrived for _, arrived in tsis.instrument.recording.read_recording_index(frames[0])]
    steps = sorted(after - before for before, after in itertools.pairwise(times))
    usual = steps[len(steps) // 2] if steps else 0.0
    lost = sum(round(step / usual) - 1 for step in steps if usual > 0 and step > GAP * usual)
    if not lost:
        return ()
    counted = "1 frame of the recording is" if lost == 1 else f"{lost} frames of the recording are"
    return (f"{counted} missing: a contact may have moved where nobody saw it, press again slower.",)


def _sidecar_force(frame: Path) -> tuple[float | None, float | None]:
    """Force in newtons and its sd, where a JSON file beside the frame holds one."""
    beside = frame.with_suffix(".json")
    force = tsis.files.reading.read_object(beside).get("force") if beside.is_file() else None
    if not isinstance(force, dict):
        return None, None
    newtons, sd = force.get("force_n"), force.get("force_sd_n")
    name = f"force_n of {beside.name}"
    newtons = tsis.model.require.require_number(name, newtons, -1000.0, 1000.0, hint="newtons")
    return newtons, None if sd is None else tsis.model.require.require_number(
        f"sd of {name}", sd, 0.0, 1000.0, hint="newtons"
    )


def _picture(levels: Sequence[NDArray[Any]], gel_contacts: Sequence[Any]) -> bytes:
    from matplotlib.figure import Figure

    drawn = Figure(figsize=tsis.present.gel_sensor.overlay_inches(len(gel_contacts)), layout="constrained")
    tsis.present.gel_sensor.draw_contacts(drawn, levels, gel_contacts)
    buffer = io.BytesIO()
    drawn.savefig(buffer, format="png", dpi=130)
    return buffer.getvalue()
