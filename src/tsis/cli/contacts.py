"""``tsis contacts``: contacts in frames of a probe or of a gel sensor."""

from __future__ import annotations

import io
import itertools
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.cli.options import AsJson, typed_options
from tsis.cli.output import CommandOutcome, leave, print_json, publish
from tsis.cli.presses import folder_of, read_presses
from tsis.cli.progress import progress_bar
from tsis.cli.sensor import (
    SensorOption,
    chosen_sensor,
    gel_frame_forces,
    gel_frame_paths,
    read_gel_frame,
    read_gel_reference,
    session_frames,
    untouched_of,
)
from tsis.errors import InputError
from tsis.present.terminal import print_page

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray


GEL, PROBE = "Gel sensor (--sensor)", "Probe"


def contacts(
    context: typer.Context,
    frames: Annotated[
        list[Path],
        typer.Argument(
            metavar="FOLDER|FRAME...",
            help="Frames of a probe or of a gel sensor, or a folder that tsis acquire, demo or records export wrote.",
        ),
    ],
    *,
    sensor: SensorOption = "",
    reference: Annotated[
        Path | None,
        typer.Option(
            "--reference",
            help="Frame of the untouched probe or sensor; left out: that of the folder or of the sensor's file, or the "
            "median of many frames of a sensor.",
        ),
    ] = None,
    scale_mm: Annotated[
        str | None,
        typer.Option(
            "--scale-mm",
            help="Millimetres per pixel on the face: one number, or x,y when they differ.",
            rich_help_panel=PROBE,
        ),
    ] = None,
    invert: Annotated[
        bool, typer.Option("--invert", help="Light falls where the probe is pressed.", rich_help_panel=PROBE)
    ] = False,
    match_lamps: Annotated[
        bool,
        typer.Option(
            "--match-light",
            help="Scale the reference to the image's lamps; less than half is touched.",
            rich_help_panel=PROBE,
        ),
    ] = False,
    out: Annotated[
        Path, typer.Option(help="Folder to write; a number is added when it exists.", rich_help_panel=PROBE)
    ] = Path("tsis-contacts"),
    sequence: Annotated[
        bool,
        typer.Option(
            "--sequence",
            help="Frames are of one press in the order of time: refuse moving ones.",
            rich_help_panel=GEL,
        ),
    ] = False,
    csv: Annotated[
        Path | None,
        typer.Option(
            "--csv",
            help="Table of the contacts to write, with forces from JSON files or presses.csv beside the frames.",
            rich_help_panel=GEL,
        ),
    ] = None,
    page: Annotated[
        Path | None, typer.Option("--html", help="Page with overlays to write.", rich_help_panel=GEL)
    ] = None,
    figure: Annotated[
        Path | None, typer.Option("--figure", help="Picture of the overlays to write.", rich_help_panel=GEL)
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find and measure the contact in frames: of a probe, or with --sensor of a gel sensor.

    A probe's contact has centre, area, ellipse, light and profile, in a folder with a page. A gel sensor's has centre,
    radius or ellipse, and a quality with reasons; the exit code is 3 where no contact is good.
    """
    if sensor:
        _require_own(context, "a probe, without --sensor", ("scale_mm", "invert", "match_lamps", "out"))
        _gel_contacts(frames, sensor, reference, (csv, page, figure), sequence=sequence, as_json=as_json)
    else:
        _require_own(context, "a gel sensor, with --sensor", ("sequence", "csv", "page", "figure"))
        outcome = _probe_contacts(frames, reference, scale_mm, invert=invert, match_lamps=match_lamps)
        publish(outcome, out, as_json=as_json)


def _require_own(context: typer.Context, what: str, names: Sequence[str]) -> None:
    """Refuse options of the other kind of frames."""
    for option in typed_options(context, names):
        raise InputError(f"{option} is an option for frames of {what}; leave it out")


def _probe_contacts(
    paths: Sequence[Path], reference: Path | None, scale_mm: str | None, *, invert: bool, match_lamps: bool
) -> CommandOutcome:
    folder = folder_of(paths)
    if folder is not None and (folder / tsis.instrument.recording.RECORDING_INDEX).is_file():
        paths = [path for path, _ in tsis.instrument.recording.read_recording_index(folder)]
    presses = read_presses(paths, scale_mm=scale_mm, reference=reference)
    untouched = presses.untouched[0] if presses.untouched else None
    if match_lamps and untouched is None:
        raise InputError("--match-light needs --reference, the frame that it scales")
    findings = [
        tsis.imaging.contact.analyse_image(
            frame,
            tsis.imaging.corrections.match_light(untouched, frame)
            if match_lamps and untouched is not None
            else untouched,
            invert=invert,
        )
        for frame in presses.images
    ]
    scale = presses.images[0].mm_per_pixel
    provenance: dict[str, Any] = {
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "images": [{"name": frame.name, **frame.settings} for frame in presses.images],
        "reference": None if untouched is None else {"name": untouched.name, **untouched.settings},
        "mm_per_pixel": None if scale is None else list(scale),
        "invert": invert,
        "match_light": match_lamps,
    }
    return CommandOutcome(
        document=tsis.present.document.envelope(
            "contacts", "probe", **tsis.present.images.contacts_document(findings), provenance=provenance
        ),
        page=tsis.present.images.contact_page(findings, provenance=provenance),
    )


def _gel_contacts(
    frames: Sequence[Path],
    sensor: str,
    reference: Path | None,
    targets: tuple[Path | None, Path | None, Path | None],
    *,
    sequence: bool,
    as_json: bool,
) -> None:
    """Find the contacts of a gel sensor, write the table, the page and the picture asked for, and print."""
    for path in targets:
        if path is not None:
            tsis.files.result_folder.require_absent(path)
    chosen = chosen_sensor(sensor)
    paths = gel_frame_paths(frames)
    levels = [tsis.imaging.gel_change.face_view(read_gel_frame(path), chosen) for path in paths]
    with progress_bar("finding contacts") as advance:
        gel_contacts = tsis.imaging.gel_contact.contacts(
            levels,
            sensor=chosen,
            reference=read_gel_reference(chosen, reference or untouched_of(frames)),
            names=[path.name for path in paths],
            sequence=sequence or (len(paths) > len(frames) and not session_frames(frames[0])),
            progress=advance,
        )
    provenance = {"notice": RESEARCH_USE_ONLY, "tsis": __version__, "sensor": chosen.name, "frames": len(paths)}
    shown = tsis.present.gel_sensor.gel_contacts_page(levels, gel_contacts, provenance=provenance)
    contents: tuple[Callable[[], bytes], ...] = (
        lambda: tsis.present.gel_sensor.contacts_csv(gel_contacts, gel_frame_forces(paths)),
        lambda: tsis.present.html.html_bytes(shown),
        lambda: _picture(levels, gel_contacts),
    )
    written: list[str] = []
    for path, content in zip(targets, contents, strict=True):
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
    if len(frames) != 1 or not frames[0].is_dir() or session_frames(frames[0]):
        return ()
    times = [arrived for _, arrived in tsis.instrument.recording.read_recording_index(frames[0])]
    steps = sorted(after - before for before, after in itertools.pairwise(times))
    usual = steps[len(steps) // 2] if steps else 0.0
    lost = sum(round(step / usual) - 1 for step in steps if usual > 0 and step > GAP * usual)
    if not lost:
        return ()
    counted = "1 frame of the recording is" if lost == 1 else f"{lost} frames of the recording are"
    return (f"{counted} missing: a contact may have moved where nobody saw it, press again slower.",)


def _picture(levels: Sequence[NDArray[Any]], gel_contacts: Sequence[Any]) -> bytes:
    from matplotlib.figure import Figure

    drawn = Figure(figsize=tsis.present.gel_sensor.overlay_inches(len(gel_contacts)), layout="constrained")
    tsis.present.gel_sensor.draw_contacts(drawn, levels, gel_contacts)
    buffer = io.BytesIO()
    drawn.savefig(buffer, format="png", dpi=130)
    return buffer.getvalue()
