"""``tsis contacts`` and ``tsis depth``: contacts in frames of a gel sensor, depth maps and their calibration."""

from __future__ import annotations

import io
import itertools
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.cli._groups import DefaultCommand
from tsis.cli._options import AsJson
from tsis.cli._output import leave, print_json
from tsis.cli._progress import progress_bar
from tsis.cli._sensor import SensorOption
from tsis.errors import FileInputError, InputError
from tsis.present.page import Column, Table
from tsis.present.terminal import print_page, print_tables

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tsis.imaging.depth import DepthMap
    from tsis.model.gel_sensor import GelSensor


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


def read_gel_frame(path: Path) -> NDArray[Any]:
    """Levels of a frame as stored, in colour where the file has colour; a video is refused with what to do."""
    from tsis.instrument.drivers.files import VIDEO_ENDINGS

    if path.suffix.lower() in VIDEO_ENDINGS:
        raise FileInputError(
            f"{path.name} must be a picture; got a video: tsis acquire --camera video:{path.name} --sensor NAME "
            "--frames 40 --out FOLDER writes its frames, and FOLDER can be given"
        )
    return tsis.instrument.image_files.read_levels(path)


def read_gel_reference(sensor: GelSensor, reference: Path | None) -> NDArray[Any] | None:
    """Levels of the given reference, or of the one that the sensor's file names; None without either."""
    if reference is None and sensor.reference_file is not None:
        reference = Path(sensor.reference_file)
    return None if reference is None else read_gel_frame(reference)


def _picture(levels: Sequence[NDArray[Any]], gel_contacts: Sequence[Any]) -> bytes:
    from matplotlib.figure import Figure

    drawn = Figure(figsize=tsis.present.gel_sensor.overlay_inches(len(gel_contacts)), layout="constrained")
    tsis.present.gel_sensor.draw_contacts(drawn, levels, gel_contacts)
    buffer = io.BytesIO()
    drawn.savefig(buffer, format="png", dpi=130)
    return buffer.getvalue()


MOST_WEIGHTS = 10**6

app = typer.Typer(
    name="depth",
    cls=DefaultCommand.named("map", is_default=False),
    help=f"Depth maps of a gel sensor: tsis depth FRAME... {RESEARCH_USE_ONLY}",
)


@app.command(
    "calibrate",
    epilog="Example: tsis depth calibrate gel-frames/press-1.png gel-frames/press-2.png gel-frames/press-3.png "
    "--sensor gelsight-mini --ball-mm 6 --reference gel-frames/untouched.png --out depth.json",
)
def calibrate(
    frames: GelFrames,
    *,
    sensor: SensorOption = "",
    ball_mm: Annotated[float, typer.Option(help="Diameter of the ball in mm.")],
    reference: GelReference = None,
    out: Annotated[Path, typer.Option(help="Calibration file to write; it must not exist.")] = Path("depth.json"),
    as_json: AsJson = False,
) -> None:
    """Calibrate depth from presses of a ball of known diameter; each is left out in turn to measure the error."""
    tsis.files.result_folder.require_absent(out)
    chosen = chosen_sensor(sensor)
    untouched = required_reference(chosen, reference)
    levels = [read_gel_frame(path) for path in gel_frame_paths(frames)]
    with progress_bar("reading presses") as advance:
        result = tsis.imaging.depth.calibrate_depth(
            levels, sensor=chosen, reference=untouched, ball_mm=ball_mm, progress=advance
        )
    tsis.files.atomic.write_durably(out, tsis.imaging.depth.depth_calibration_json(result))
    if as_json:
        document = tsis.present.document.envelope(
            "depth calibrate", sensor=chosen.name, method=result.method, presses=result.presses, sd_mm=result.sd_mm,
            other_sd_mm=result.other_sd_mm, errors_mm=list(result.errors_mm), file=str(out),
        )  # fmt: skip
        print_json(document)
        return
    left_out = (sum(error**2 for error in result.errors_mm) / len(result.errors_mm)) ** 0.5
    other = result.other_sd_mm
    rows = [
        ("method", result.method),
        ("good presses", f"{result.presses} of {len(levels)}"),
        ("distance from the ball, presses left out / mm", f"{left_out:.4f}"),
        *(() if other is None else (("that of the best other method / mm", f"{other:.4f}"),)),
        ("sd of a depth, the untouched face included / mm", f"{result.sd_mm:.4f}"),
    ]
    table = Table(title="Depth calibration", columns=("quantity", "value"), values=tuple(rows))
    print_tables([table], [], where=f"Calibration: {out}")


@app.command(
    "map",
    epilog="Example: tsis depth map gel-frames/press-4.png --sensor gelsight-mini --calibration depth.json "
    "--reference gel-frames/untouched.png --out depth-maps",
)
def depth_map(
    frames: GelFrames,
    *,
    sensor: SensorOption = "",
    calibration: Annotated[Path, typer.Option(help="File that tsis depth calibrate wrote.")],
    reference: GelReference = None,
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path("depth-maps"),
    as_json: AsJson = False,
) -> None:
    """Write depth maps in mm with their uncertainty: NPY (depth and sd), TIFF of floats, PLY points, and a picture."""
    chosen = chosen_sensor(sensor)
    parse = tsis.imaging.depth.parse_depth_calibration
    document = tsis.files.reading.read_object(calibration, values=MOST_WEIGHTS)
    mapper = tsis.imaging.depth.DepthMapper(parse(document), chosen, required_reference(chosen, reference))
    files: dict[str, bytes] = {}
    rows: list[tuple[str, float, float]] = []
    paths = gel_frame_paths(frames)
    with progress_bar("mapping depth") as advance:
        for number, path in enumerate(paths):
            result = mapper.map(read_gel_frame(path), name=path.name)
            files |= {f"{path.stem}{ending}": content(result) for ending, content in FORMS.items()}
            rows.append((path.name, float(result.depth_mm.max()), _sd(result)))
            advance(number + 1, len(paths))
    folder = tsis.files.result_folder.write_folder(tsis.files.result_folder.free_folder(out), files)
    if as_json:
        maps = [dict(zip(("frame", "deepest_mm", "sd_mm"), row, strict=True)) for row in rows]
        print_json(tsis.present.document.envelope("depth map", sensor=chosen.name, maps=maps, folder=str(folder)))
        return
    depths = (Column(label="deepest", unit="mm", form=".3f"), Column(label="sd there", unit="mm", form=".3f"))
    table = Table(title="Depth maps", columns=("frame", *depths), values=tuple(rows))
    print_tables([table], [], where=f"Maps: {folder}")


def required_reference(sensor: GelSensor, reference: Path | None) -> NDArray[Any]:
    levels = read_gel_reference(sensor, reference)
    if levels is None:
        raise InputError("a depth map needs a frame of the untouched sensor; give it as --reference")
    return levels


def _sd(result: DepthMap) -> float:
    return float(result.sd_mm.ravel()[int(result.depth_mm.argmax())])


def _npy(values: NDArray[Any]) -> bytes:
    import numpy as np

    buffer = io.BytesIO()
    np.save(buffer, values.astype(np.float32))
    return buffer.getvalue()


def _tiff(result: DepthMap) -> bytes:
    import numpy as np
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(result.depth_mm.astype(np.float32)).save(buffer, format="TIFF")
    return buffer.getvalue()


def _png(result: DepthMap) -> bytes:
    from matplotlib.figure import Figure

    figure, buffer = Figure(figsize=(6, 4), layout="constrained"), io.BytesIO()
    tsis.present.figures.gel_depth(
        result.depth_mm, figure.subplots(), mm_per_pixel=result.mm_per_pixel, label="depth / mm"
    )
    figure.savefig(buffer, format="png", dpi=120)
    return buffer.getvalue()


FORMS: dict[str, Callable[[DepthMap], bytes]] = {
    ".npy": lambda result: _npy(result.depth_mm),
    "-sd.npy": lambda result: _npy(result.sd_mm),
    ".tiff": _tiff,
    ".ply": lambda result: result.ply_bytes(),
    ".png": _png,
}
