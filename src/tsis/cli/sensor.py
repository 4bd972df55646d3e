"""``tsis sensor``: files of gel sensors, and their frames."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.cli.options import AsJson, ScaleMm, scale_of
from tsis.cli.output import RESULT, print_json, result_bytes
from tsis.errors import FileInputError, InputError
from tsis.present.page import Table
from tsis.present.terminal import print_tables

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.calibration.foreign_folder import GuessedFrame
    from tsis.model.gel_sensor import GelSensor


SensorOption = Annotated[
    str,
    typer.Option(
        "--sensor",
        help="Gel sensor: a name (tsis sensor show lists them) or a file of your own, as mine.toml, which "
        "tsis sensor new makes.",
    ),
]

MOST_GEL_FRAMES = 2000
SAME_SIZE = 0.02  # relative difference of frames that one scale may have
GelFrames = Annotated[
    list[Path],
    typer.Argument(help="Frames of the sensor, or a folder that tsis acquire recorded or tsis session described."),
]
GelReference = Annotated[
    Path | None,
    typer.Option(
        "--reference",
        help="Frame of the untouched sensor; left out: that of the sensor's file, or the median of many frames.",
    ),
]


def chosen_sensor(sensor: str) -> GelSensor:
    """The sensor that ``--sensor`` names; without one, a sentence on which file and how to make it."""
    if not sensor:
        raise InputError(
            "frames of a gel sensor need its file: give --sensor gelsight-mini, or another that tsis sensor show "
            "lists, or a file of your own that tsis sensor new makes"
        )
    return tsis.catalog.load_sensor(sensor)


def gel_frame_paths(frames: Sequence[Path]) -> list[Path]:
    """Files of the frames; those of a recorded folder in the order of time, of a session folder the pressed ones."""
    if len(frames) == 1 and frames[0].is_dir():
        frames = _folder_frames(frames[0])
    frames = [part for path in frames for part in (_video_frames(path) if _is_video(path) else [path])]
    if len(frames) > MOST_GEL_FRAMES:
        raise InputError(
            f"frames must be at most {MOST_GEL_FRAMES}; got {len(frames)}: give every second one, or fewer"
        )
    return list(frames)


def _folder_frames(folder: Path) -> list[Path]:
    if (folder / tsis.instrument.recording.RECORDING_INDEX).is_file():
        return [path for path, _ in tsis.instrument.recording.read_recording_index(folder)]
    frames = session_frames(folder)
    if not frames:
        raise tsis.files.reading.file_error(
            folder, "must be a folder that tsis acquire recorded, or a session folder: make it one by tsis session"
        )
    pressed = [frame for frame in frames if frame.role != tsis.calibration.frames.UNTOUCHED]
    return [tsis.files.reading.own_file(folder, frame.file) for frame in pressed]


def session_frames(folder: Path) -> tuple[GuessedFrame, ...]:
    """Frames of a session folder; none of another."""
    if not (folder / tsis.calibration.frames.PRESSES_FILE).is_file():
        return ()
    return tsis.calibration.foreign_folder.read_session(folder)


def gel_frame_forces(paths: Sequence[Path]) -> list[tuple[float | None, float | None]]:
    """Forces of frames in newtons and their sd, by the JSON files beside them, or by presses.csv of their folder."""
    folders = {path.parent for path in paths}
    told = {folder / frame.file: frame.force_n for folder in folders for frame in session_frames(folder)}
    return [_sidecar_force(path) or (told.get(path), None) for path in paths]


def _sidecar_force(frame: Path) -> tuple[float, float | None] | None:
    beside = frame.with_suffix(".json")
    force = tsis.files.reading.read_object(beside).get("force") if beside.is_file() else None
    if not isinstance(force, dict):
        return None
    newtons, sd = force.get("force_n"), force.get("force_sd_n")
    name = f"force_n of {beside.name}"
    newtons = tsis.model.require.require_number(name, newtons, -1000.0, 1000.0, hint="newtons")
    return newtons, None if sd is None else tsis.model.require.require_number(
        f"sd of {name}", sd, 0.0, 1000.0, hint="newtons"
    )


def read_gel_frame(path: Path) -> NDArray[Any]:
    """Levels of a frame as stored, in colour where the file has colour; of a video its first frame."""
    if _is_video(path):
        return tsis.instrument.video.opened_video(path).levels(0)
    if _is_video(path.parent) and path.parent.is_file():
        return tsis.instrument.video.opened_video(path.parent).levels(int(path.stem.rpartition("-")[2]))
    return tsis.instrument.image_files.read_levels(path)


MOST_VIDEO_FRAMES = 200  # evenly over the video


def _is_video(path: Path) -> bool:
    from tsis.instrument.drivers.files import VIDEO_ENDINGS

    return path.suffix.lower() in VIDEO_ENDINGS


def _video_frames(path: Path) -> list[Path]:
    """Names of the frames of a video, evenly over it, as files in a folder of the video's name."""
    count = tsis.instrument.video.Video(path).count
    step = max(1, -(-count // MOST_VIDEO_FRAMES))
    if count < 1:
        raise FileInputError(f"{path.name} must be a video with frames; got none that can be decoded")
    return [path / f"frame-{number:06d}" for number in range(0, count, step)]


def gel_frame_times(paths: Sequence[Path]) -> list[float] | None:
    """Seconds of the frames of one video from its start; None for other frames."""
    videos = {path.parent for path in paths}
    if len(videos) != 1 or not (_is_video(video := videos.pop()) and video.is_file()):
        return None
    rate = tsis.instrument.video.opened_video(video).rate_hz
    return [int(path.stem.rpartition("-")[2]) / rate for path in paths]


def untouched_of(frames: Sequence[Path]) -> Path | None:
    """What shows the untouched sensor: a video's first frame, or that of a session folder; else None."""
    if len(frames) != 1:
        return None
    if _is_video(frames[0]):
        return frames[0]
    files = [frame.file for frame in session_frames(frames[0]) if frame.role == tsis.calibration.frames.UNTOUCHED]
    return tsis.files.reading.own_file(frames[0], files[0]) if files else None


def read_gel_reference(sensor: GelSensor, reference: Path | None) -> NDArray[Any] | None:
    """Levels of the given reference, or of the one that the sensor's file names; None without either."""
    if reference is None and sensor.reference_file is not None:
        reference = Path(sensor.reference_file)
    return None if reference is None else read_gel_frame(reference)


def required_reference(sensor: GelSensor, reference: Path | None) -> NDArray[Any]:
    """Levels of the untouched sensor, without which there is no depth map."""
    levels = read_gel_reference(sensor, reference)
    if levels is None:
        raise InputError("a depth map needs a frame of the untouched sensor; give it as --reference")
    return levels


app = typer.Typer(
    name="sensor",
    no_args_is_help=True,
)


@app.command("new", epilog="Example: tsis sensor new my-gel --like gelsight-mini --scale-mm 0.0634 --out my-gel.toml")
def new(
    name: Annotated[str, typer.Argument(help="Name of the new sensor.")],
    *,
    like: Annotated[str, typer.Option(help="Sensor of the catalog to start from.")] = "gelsight-mini",
    scale_mm: ScaleMm = None,
    image_px: Annotated[str | None, typer.Option(help="Columns and rows of that scale's frames, as 320,240.")] = None,
    thickness_mm: Annotated[float | None, typer.Option(help="Thickness of the gel in mm, where you know it.")] = None,
    young_kpa: Annotated[float | None, typer.Option(help="Young's modulus of the gel in kPa, where known.")] = None,
    young_measured: Annotated[
        bool,
        typer.Option(
            "--young-measured",
            help="That modulus was measured; else it counts as a label, true within a factor of 1.25.",
        ),
    ] = False,
    corners_px: Annotated[
        str | None,
        typer.Option(
            help="Places of the face's corners in the camera's frame, as 90,60,560,70,600,440,50,430, in the order of "
            "upper left, upper right, lower right, lower left of the upright face."
        ),
    ] = None,
    raw_px: Annotated[str | None, typer.Option(help="Columns and rows of the camera's frame, as 640,480.")] = None,
    corners_in: Annotated[
        Path | None,
        typer.Option(help="Find those corners in this frame or video of the untouched sensor, before a dark surround."),
    ] = None,
    bits: Annotated[int | None, typer.Option(help="Bits of a level in files of 16 bits, as 12.")] = None,
    marker_pitch_mm: Annotated[
        float | None, typer.Option(help="Distance of printed markers, where the gel has them.")
    ] = None,
    reference: Annotated[str | None, typer.Option(help="Frame of the untouched sensor, beside the file.")] = None,
    out: Annotated[Path, typer.Option(help="File to write; it must not exist.")] = Path("sensor.toml"),
    as_json: AsJson = False,
) -> None:
    """Write the file of your own gel sensor, from one of the catalog and what you know better."""
    from tsis.present.gel_sensor import sensor_document, sensor_notes, sensor_table

    if name in tsis.catalog.sensors.list_sensors():
        raise InputError(f"the name {name!r} is that of a sensor of the catalog; choose another, as my-{name}")
    start = tsis.catalog.load_sensor(like)
    if young_measured and young_kpa is None:
        raise InputError("--young-measured must be given with --young-kpa, the modulus that was measured; add it")
    changes: dict[str, Any] = {"name": name}
    if scale_mm is not None:
        changes["mm_per_pixel"] = scale_of(scale_mm)
    if image_px is not None:
        changes["image_px"] = _pixels(image_px)
        if scale_mm is None:
            _require_frames_of_scale(changes["image_px"], start)
    if corners_in is not None:
        if corners_px is not None or raw_px is not None:
            raise InputError("--corners-in must stand without --corners-px and --raw-px: it finds both")
        untouched = read_gel_frame(corners_in)
        changes["corners_px"] = tsis.imaging.face_corners.find_face_corners(untouched)
        changes["raw_px"] = untouched.shape[1::-1]
    if corners_px is not None or raw_px is not None:
        changes["corners_px"] = None if corners_px is None else _corners(corners_px)
        changes["raw_px"] = None if raw_px is None else _pixels(raw_px, "--raw-px")
    for key, value in (("thickness_mm", thickness_mm), ("young_kpa", young_kpa)):
        if value is not None:
            changes[key] = tsis.model.gel_sensor.BoundedValue(value=value)
    changes |= {
        key: value
        for key, value in (("reference_file", reference), ("marker_pitch_mm", marker_pitch_mm), ("bits", bits))
        if value is not None
    }
    changed = {key for key in changes if key in start.sources}
    changes["sources"] = {key: "given by the user" if key in changed else text for key, text in start.sources.items()}
    if young_kpa is not None:
        changes["sources"]["young_kpa"] = "measured by the user" if young_measured else "given by the user"
    sensor = replace(start, **changes)
    tsis.files.result_folder.require_absent(out)
    tsis.files.atomic.write_durably(out, tsis.catalog.sensors.sensor_toml(sensor).encode())
    if as_json:
        print_json(tsis.present.document.envelope("sensor new", sensor=sensor_document(sensor), file=str(out)))
        return
    found = [] if corners_in is None or sensor.corners_px is None else [_corners_note(sensor.corners_px)]
    print_tables([sensor_table(sensor)], (*sensor_notes(sensor), *found), where=f"File: {out}")


def _require_frames_of_scale(image_px: tuple[int, int], start: GelSensor) -> None:
    """`InputError` where frames of another size would keep the scale, and the face would become another one."""
    if start.mm_per_pixel is not None and any(
        abs(given - known) > SAME_SIZE * known for given, known in zip(image_px, start.image_px, strict=True)
    ):
        raise InputError(
            f"--image-px must be given with --scale-mm, the scale of its frames; {start.name} has "
            f"{start.mm_per_pixel[0]:g} mm per pixel in frames of {start.image_px[0]} x {start.image_px[1]}, got "
            f"{image_px[0]} x {image_px[1]}"
        )


def _corners_note(corners: Sequence[tuple[float, float]]) -> str:
    places = ", ".join(f"{x:.0f},{y:.0f}" for x, y in corners)
    return (
        f"Corners found: {places}, from the upper left clockwise as the frame shows them: look at a warped frame, and "
        "give them in another order with --corners-px where the face is turned or mirrored."
    )


def _corners(text: str) -> tuple[tuple[float, float], ...]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 8:
        raise InputError(f"--corners-px must be eight numbers, x and y of four corners; got {text!r:.60}")
    return tuple(zip(numbers[::2], numbers[1::2], strict=True))


def _pixels(text: str, option: str = "--image-px") -> tuple[int, int]:
    parts = text.split(",")
    if len(parts) != 2 or not all(part.strip().isdigit() for part in parts):
        raise InputError(f"{option} must be columns and rows, as 320,240; got {text!r:.40}")
    return int(parts[0]), int(parts[1])


@app.command("check", epilog="Example: tsis sensor check my-gel.toml")
def check(
    sensor: Annotated[str, typer.Argument(help="File of the sensor, or a name of the catalog.")],
    frames: Annotated[list[Path] | None, typer.Argument(help="Frames that should belong to it.")] = None,
    *,
    as_json: AsJson = False,
) -> None:
    """Check the file of a sensor, and that frames have its size; say what is still unknown."""
    from tsis.present.gel_sensor import sensor_document, sensor_notes, sensor_table

    loaded = tsis.catalog.load_sensor(sensor)
    for path in frames or []:
        rows, columns = tsis.imaging.gel_change.face_view(read_gel_frame(path), loaded).shape[:2]
        loaded.require_frame(columns, rows)
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "sensor check",
                sensor=sensor_document(loaded),
                frames=len(frames or []),
                notes=sensor_notes(loaded),
            )
        )
        return
    count = len(frames or [])
    where = f"{count} frames belong to it" if count > 1 else "1 frame belongs to it" if count else ""
    print_tables([sensor_table(loaded)], sensor_notes(loaded), where=where)


@app.command("show", epilog="Example: tsis sensor show gelsight-mini")
def show(
    sensor: Annotated[str | None, typer.Argument(help="Name or file of the sensor; all names when left out.")] = None,
    *,
    as_json: AsJson = False,
) -> None:
    """Show a sensor with the source of each value, or the names of all."""
    from tsis.present.gel_sensor import sensor_document, sensor_notes, sensor_table

    loaded = None if sensor is None else tsis.catalog.load_sensor(sensor)
    names = tsis.catalog.sensors.list_sensors() if loaded is None else (loaded.name,)
    if as_json:
        shown = {} if loaded is None else {"sensor": sensor_document(loaded)}
        print_json(tsis.present.document.envelope("sensor show", names=list(names), **shown))
        return
    if loaded is None:
        print_tables([], names)
        return
    sources = Table(title="Sources", columns=("value", "source"), values=tuple(loaded.sources.items()))
    print_tables([sensor_table(loaded), sources], sensor_notes(loaded))


@app.command("frames", epilog="Example: tsis sensor frames gelsight-mini --out gel-frames --seed 3")
def frames(
    sensor: Annotated[str, typer.Argument(help="Name or file of the sensor.")],
    *,
    presses: Annotated[int, typer.Option(help="Number of presses.")] = 4,
    ball_mm: Annotated[float, typer.Option(help="Diameter of the ball in mm.")] = 6.0,
    seed: Annotated[int, typer.Option(help="Seed of lamps, places, depths and noise.")] = 1,
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path("gel-frames"),
    as_json: AsJson = False,
) -> None:
    """Render frames of a sensor pressed by a ball, with their truth, to try the commands without a sensor."""
    loaded = tsis.catalog.load_sensor(sensor)
    tsis.model.require.require_integer("--presses", presses, 1, 100)
    tsis.model.require.require_number("--ball-mm", ball_mm, 1.0, 40.0, hint="millimetres")
    made = tsis.virtual.gel_frames.rendered_series(loaded, presses, ball_radius_mm=ball_mm / 2, seed=seed)
    files = {"untouched.png": tsis.files.images.encode_picture(made[0].reference)}
    truth = []
    for number, press in enumerate(made, start=1):
        files[f"press-{number}.png"] = tsis.files.images.encode_picture(press.frame)
        truth.append({"frame": f"press-{number}.png", "centre_px": list(press.centre_px), "radius_px": press.radius_px})
    document = tsis.present.document.envelope(
        "sensor frames", sensor=loaded.name, ball_mm=ball_mm, seed=seed, truth=truth
    )
    folder = tsis.files.result_folder.write_folder(
        tsis.files.result_folder.free_folder(out), {**files, RESULT: result_bytes(document)}
    )
    if as_json:
        print_json({**document, "folder": str(folder)})
        return
    print_tables([], [f"{presses} presses of a ball of {ball_mm:g} mm, rendered"], where=f"Frames: {folder}")
