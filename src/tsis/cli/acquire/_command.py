"""The camera of the command line: a connected camera, stored frames, or the virtual probe."""

from __future__ import annotations

import signal
import time
from collections import Counter
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console

import tsis
from tsis.__about__ import LARGEST_SEED, LARGEST_TARGET
from tsis.cli._contacts import MOST_GEL_FRAMES, MOST_WEIGHTS, GelReference, chosen_sensor, required_reference
from tsis.cli._force_gauge import GaugeBaud, GaugeLatency, GaugePort, GaugeSends, GaugeUnit, gauge_log
from tsis.cli._groups import ended_by
from tsis.cli._options import AsJson, ForceN, PhantomName, ProbeName
from tsis.cli._output import print_json, print_watched
from tsis.cli._progress import waiting
from tsis.cli._saving import KindOption, StoreOption, chosen_destination
from tsis.cli.acquire._listing import list_cameras, show_camera
from tsis.cli.acquire._sequence import take_sequence
from tsis.cli.acquire._snapshots import ROLES, SnapshotDestination, take_snapshot
from tsis.cli.acquire._watching import watch_presses
from tsis.errors import InputError, TsisError, import_extra
from tsis.present.terminal import print_notice

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from tsis.imaging.depth import DepthMapper
    from tsis.instrument.camera import Camera
    from tsis.model.gel_sensor import GelSensor


VIRTUAL = "virtual"


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualPress:
    """The subject of the virtual camera."""

    probe: str
    phantom: str
    force_n: float
    seed: int


def connector(spec: str, press: VirtualPress) -> Callable[[], Camera]:
    """A function that returns a new handle of the camera, not yet open."""
    if spec != VIRTUAL:
        return live_connector(spec)
    rng = np.random.default_rng(press.seed)
    probe = tsis.virtual.VirtualProbe(tsis.catalog.load_probe(press.probe), rng=rng, strain="small")  # a live view
    phantom = tsis.catalog.load_phantom(press.phantom)
    return lambda: tsis.virtual.camera.VirtualCamera(probe, phantom, rng=rng, force_n=press.force_n, paced=True)


def live_connector(spec: str) -> Callable[[], Camera]:
    """The same for a camera that is not virtual; `UnknownNameError` for an unknown source."""
    tsis.model.require.require_one_of(
        "camera source",
        spec.partition(":")[0],
        (VIRTUAL, *tsis.instrument.discovery.live_sources(), *tsis.instrument.discovery.STORED_SOURCES),
    )
    return partial(tsis.instrument.discovery.connect, spec)


def is_stored(spec: str) -> bool:
    """Whether the frames come from a disk and not from a camera."""
    return spec.partition(":")[0] in tsis.instrument.discovery.STORED_SOURCES


def requested_settings(
    connect_camera: Callable[[], Camera], name: str | None, pairs: Sequence[str]
) -> dict[str, float]:
    """Settings of a preset, overridden by those given as ``name=value``."""
    chosen: dict[str, float] = {}
    if name is not None:
        camera = connect_camera()
        camera.open()
        try:
            chosen = tsis.instrument.camera.preset(name, camera.settings())
        finally:
            camera.stop()
    return chosen | dict(_pair(text) for text in pairs)


def _pair(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    try:
        number = float(value)
    except ValueError:
        equals = ""
        number = 0.0
    if not equals or not name:
        raise InputError(f"--set must be a name and a number, as exposure_ms=10; got {text!r:.60}")
    return name, number


RING_FRAMES = 256  # eight seconds of a usual camera, for a disk that pauses
LONGEST_S = 7 * 86400.0


def acquire(
    *,
    list_found: Annotated[
        bool, typer.Option("--list", help="List cameras, and what other camera drivers lack.")
    ] = False,
    modes: Annotated[bool, typer.Option("--modes", help="Show the camera's modes and settings.")] = False,
    camera: Annotated[
        str, typer.Option(help="virtual, or SOURCE:ID as --list shows it, or files:FOLDER, or video:FILE.")
    ] = VIRTUAL,
    mode: Annotated[str | None, typer.Option(help="Mode as --modes shows it; the camera's first by default.")] = None,
    preset: Annotated[str | None, typer.Option(help="Settings: default or minimal.")] = None,
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="A setting as --modes shows it, e.g. exposure_ms=10; repeatable.")
    ] = None,
    target: Annotated[int, typer.Option(help="Number of the target of a snapshot.", min=1, max=LARGEST_TARGET)] = 1,
    picture: Annotated[
        str, typer.Option("--format", help="Colour picture of a snapshot: bmp, png or jpg; raw stays lossless.")
    ] = "bmp",
    map_name: Annotated[str, typer.Option("--map", help="Colours: cividis, inferno or viridis.")] = "viridis",
    frames: Annotated[int | None, typer.Option(help="Record a sequence of this many frames instead.", min=1)] = None,
    seconds: Annotated[float | None, typer.Option(help="Record a sequence of this many seconds instead.")] = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Save nothing; show the press guard's flags, until Ctrl-C.")
    ] = False,
    video: Annotated[bool, typer.Option("--video", help="One lossless video file for a sequence.")] = False,
    gauge: GaugePort = None,
    gauge_unit: GaugeUnit = None,
    gauge_baud: GaugeBaud = None,
    gauge_sends: GaugeSends = False,
    gauge_latency_ms: GaugeLatency = 0.0,
    sensor: Annotated[
        str | None, typer.Option(help="A gel sensor, a name or a file: frames in colour; with --watch its contact.")
    ] = None,
    reference: GelReference = None,
    depth: Annotated[
        Path | None, typer.Option(help="With --sensor: file of tsis depth calibrate; depth and force follow.")
    ] = None,
    calibration: Annotated[Path | None, typer.Option(help="Calibration file of the frames.")] = None,
    probe: ProbeName = "tsis-2011",
    phantom: PhantomName = "hardness-100",
    force_n: ForceN = 1.0,
    seed: Annotated[int, typer.Option(help="Seed of the virtual probe's errors.", min=0, max=LARGEST_SEED)] = 4,
    save: Annotated[
        bool, typer.Option("--save", help="Save the snapshot in the store of records too: tsis records list.")
    ] = False,
    role: Annotated[str, typer.Option(help=f"What is pressed (role in the store): {', '.join(ROLES)}.")] = ROLES[0],
    store: StoreOption = None,
    kind: KindOption = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder of the targets' folders, or of a sequence.", show_default="., tsis-sequence"),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Save a snapshot of a target, or record a sequence, from a camera or the virtual probe.

    A snapshot is TargetN/TargetN-MMDDYY-HHMMSS in colour, the raw frame and a JSON file of its settings.
    A sequence is a folder of PNG files (or one lossless video) with an index of every frame.
    """
    if list_found:
        list_cameras(as_json=as_json)
        return
    sequence = not watch and (frames is not None or seconds is not None)
    if video and not sequence:
        raise InputError("--video needs --seconds or --frames: a snapshot is one picture")
    if watch and (frames is not None or out is not None):
        raise InputError("--watch saves nothing: leave out --frames and --out (--seconds ends it)")
    if seconds is not None:
        tsis.model.require.require_number("--seconds", seconds, 0.01, LONGEST_S, hint="seconds")
    if save and (sequence or watch):
        raise InputError("--save works for snapshots; import a sequence into a store by tsis records import")
    if sensor is not None:
        live = GelCamera(camera=camera, sensor=sensor, reference=reference, seed=seed)
        if watch:
            watch_gel(live, depth=depth, seconds=seconds, as_json=as_json)
        elif sequence and not video:
            record_gel(live, out or Path("tsis-sequence"), frames=frames, seconds=seconds, as_json=as_json)
        else:
            raise InputError("--sensor needs --watch, or --frames or --seconds for a folder of frames in colour")
        return
    tsis.model.require.require_one_of("role", role, ROLES)
    tsis.model.require.require_one_of("picture format", picture, tsis.instrument.snapshot.FORMATS)
    tsis.model.require.require_one_of("colour map", map_name, tsis.imaging.colour.COLOUR_MAPS)
    given = None if calibration is None else tsis.calibration.frames.read_usable_calibration(calibration)
    destination = chosen_destination(save, store, kind)
    calibrated = "" if given is None else given.calibration.probe
    pressed_by = calibrated or (probe if camera == VIRTUAL else "")
    where = None
    if destination is not None:
        where = SnapshotDestination(destination=destination, role=role, probe=probe if camera == VIRTUAL else "")
    with waiting("opening the camera"):
        make = connector(camera, VirtualPress(probe=probe, phantom=phantom, force_n=force_n, seed=seed))
    if modes:
        show_camera(make, as_json=as_json)
        return
    requested = requested_settings(make, preset, setting or ())
    stored = is_stored(camera)
    acquisition = tsis.instrument.acquisition.Acquisition(
        make, mode=mode, settings=requested, ring_frames=RING_FRAMES, patient=stored, reconnect=not stored
    )
    with (
        gauge_log(gauge, unit=gauge_unit, baud=gauge_baud, sends=gauge_sends, latency_ms=gauge_latency_ms) as log,
        acquisition,
    ):
        if given is not None:
            given.require_camera(acquisition, stored=stored)
        if watch:
            watch_presses(acquisition, seconds=seconds, calibration=given, log=log, as_json=as_json)
        elif sequence:
            take_sequence(
                acquisition,
                out or Path("tsis-sequence"),
                frames=frames,
                seconds=seconds,
                video=video,
                calibration=given,
                log=log,
                as_json=as_json,
            )
        else:
            take_snapshot(
                acquisition,
                out or Path(),
                target=target,
                picture=picture,
                map_name=map_name,
                calibration=given,
                log=log,
                role=role,
                probe=pressed_by,
                where=where,
                as_json=as_json,
            )


VIRTUAL_PRESSES, VIRTUAL_BALL_MM = 6, 6.0  # of the virtual gel sensor, which presses them again and again


@dataclass(frozen=True, slots=True, kw_only=True)
class GelCamera:
    """A live gel sensor: camera, sensor, and where they are read from.

    Attributes
    ----------
    camera
        ``opencv:NUMBER``, ``video:FILE`` or ``virtual``.
    sensor
        Name or file of the sensor.
    reference
        Frame of the untouched sensor; the virtual sensor has its own.
    seed
        Of the virtual sensor.
    """

    camera: str
    sensor: str
    reference: Path | None
    seed: int

    def frames(self) -> Iterator[NDArray[Any]]:
        """The newest frame in colour, again and again; `InputError` where the camera does not open."""
        kind, _, where = self.camera.partition(":")
        if kind == "virtual":
            yield from self._virtual()
            return
        if kind not in ("opencv", "video") or not where:
            raise InputError(
                f"--sensor needs --camera virtual, opencv:NUMBER or video:FILE, which have colours; got "
                f"{self.camera!r:.80}"
            )
        cv2 = import_extra("cv2", feature="the live view of a gel sensor", extra="camera")
        capture = cv2.VideoCapture(int(where) if kind == "opencv" and where.isdigit() else where)
        if not capture.isOpened():
            raise InputError(
                f"--camera must be a camera that opens; {self.camera} does not: tsis acquire --list shows them"
            )
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)  # the newest frame, not one of a second ago
        try:
            while (read := capture.read())[0]:
                yield read[1][..., ::-1]
        finally:
            capture.release()

    def _virtual(self) -> Iterator[NDArray[Any]]:
        made = tsis.virtual.gel_frames.rendered_series(
            chosen_sensor(self.sensor), VIRTUAL_PRESSES, ball_radius_mm=VIRTUAL_BALL_MM / 2, seed=self.seed
        )
        yield made[0].reference
        for number in count():
            yield made[number % len(made)].frame

    def untouched(self) -> NDArray[Any]:
        """A frame of the untouched sensor; `InputError` where none is known."""
        if self.camera == "virtual" and self.reference is None:
            return next(self.frames())
        return required_reference(chosen_sensor(self.sensor), self.reference)


def watch_gel(live: GelCamera, *, depth: Path | None, seconds: float | None, as_json: bool) -> None:
    """Contact, and with a depth calibration depth and force, of each newest frame, until Ctrl-C or the video's end."""
    chosen, mapper, frames = chosen_sensor(live.sensor), None, live.frames()
    first = next(frames, None)  # a camera that does not open is said before anything else
    untouched = live.untouched()
    if depth is not None:
        calibration = tsis.imaging.depth.parse_depth_calibration(
            tsis.files.reading.read_object(depth, values=MOST_WEIGHTS)
        )
        mapper = tsis.imaging.depth.DepthMapper(calibration, chosen, untouched)
    console, counted, begun = Console(stderr=as_json, highlight=False), Counter[str](), time.monotonic()
    with ended_by(signal.SIGINT) as ended:
        while first is not None and not ended.is_set():
            counted["frames"] += 1
            try:
                line, reasons = _gel_line(first, chosen, untouched, mapper)
            except TsisError as error:  # a black frame, a moved lamp: the next one may be good
                line, reasons = f"! {error}", ("refused",)
            counted.update(reasons)
            console.print(line, markup=False, soft_wrap=True)
            over = seconds is not None and time.monotonic() - begun >= seconds
            first = None if over else next(frames, None)
    if as_json:
        print_watched(counted)
    else:
        print_notice(console)


def _gel_line(
    frame: NDArray[Any], sensor: GelSensor, reference: NDArray[Any], mapper: DepthMapper | None
) -> tuple[str, tuple[str, ...]]:
    """One frame as a line of text, and the reasons against its contact."""
    reading = tsis.imaging.depth.gel_reading(frame, sensor=sensor, reference=reference, mapper=mapper)
    if not reading.good or reading.centre_px is None:
        return "no good contact: " + ", ".join(reading.reasons), reading.reasons
    text = "contact at {:.1f}, {:.1f} px".format(*reading.centre_px)
    text += f", radius {reading.radius_mm:.3f} mm" if reading.radius_mm else f", radius {reading.radius_px:.1f} px"
    if reading.force_interval_n is not None:
        low, high = reading.force_interval_n
        text += f", deepest {reading.deepest_mm:.3f} mm, {reading.force_n:.3g} N ({low:.3g} to {high:.3g})"
        text += "".join(f"; {problem}" for problem in reading.problems)
    return text, ()


def record_gel(live: GelCamera, out: Path, *, frames: int | None, seconds: float | None, as_json: bool) -> None:
    """Record at most 2000 frames in colour, as PNG files with an index of times, for ``tsis contacts FOLDER``."""
    sensor, folder = chosen_sensor(live.sensor), tsis.files.result_folder.free_folder(out)
    files: dict[str, bytes] = {}
    rows = [",".join(tsis.instrument.recording.RECORDING_COLUMNS)]
    begun = time.monotonic()
    with ended_by(signal.SIGINT) as ended:
        for number, frame in enumerate(live.frames()):
            passed = time.monotonic() - begun
            if ended.is_set() or number in (frames, MOST_GEL_FRAMES) or (seconds is not None and passed >= seconds):
                break
            sensor.require_frame(frame.shape[1], frame.shape[0])
            name = f"frame-{number:06d}.png"
            files[name] = tsis.files.images.encode_picture(
                np.ascontiguousarray(frame), level=tsis.files.images.QUICK_PNG
            )
            rows.append(f"{number},{name},0,{number},{passed:.6f},{passed:.6f}")
    if not files:
        raise InputError(f"--camera must deliver frames; {live.camera} gave none")
    index = {tsis.instrument.recording.RECORDING_INDEX: ("\n".join(rows) + "\n").encode()}
    written = tsis.files.result_folder.write_folder(folder, files | index)
    if as_json:
        print_json(
            tsis.present.document.envelope("acquire", "gel", sensor=sensor.name, frames=len(files), folder=str(written))
        )
        return
    console = Console(highlight=False)
    console.print(f"{len(files)} frames in colour\nFolder: {written}", markup=False, soft_wrap=True)
    print_notice(console)
