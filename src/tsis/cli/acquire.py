"""``tsis acquire``: frames of any camera, shown, watched and saved.

A force gauge can be read beside the camera; `live_connector` and `gauge_log` serve other commands too.
"""

from __future__ import annotations

import signal
import time
from collections import Counter
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from datetime import datetime
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.live import Live
from rich.markup import escape

import tsis
from tsis.__about__ import LARGEST_SEED, LARGEST_TARGET
from tsis.cli.depth import MOST_WEIGHTS
from tsis.cli.options import AsJson, ForceN, PhantomName, ProbeName, typed_options
from tsis.cli.output import print_json, print_watched
from tsis.cli.progress import FAILED, ended_by, progress_bar, waiting
from tsis.cli.saving import KindOption, StoreOption, chosen_destination, stop_not_saved
from tsis.cli.sensor import MOST_GEL_FRAMES, GelReference, chosen_sensor, required_reference
from tsis.errors import CameraError, FileInputError, GaugeError, InputError, TsisError, import_extra
from tsis.present.page import Column, Table
from tsis.present.terminal import people, print_notice, rich_table

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from tsis.calibration.frames import UsableCalibration
    from tsis.calibration.guard.limits import GuardFlag
    from tsis.calibration.guard.watch import PressWatch, WatchState
    from tsis.cli.saving import Destination
    from tsis.imaging.depth import DepthMapper
    from tsis.instrument.acquisition import Acquisition, ReceivedFrame
    from tsis.instrument.camera import Camera, Frame, Setting
    from tsis.instrument.force_log import ForceLog
    from tsis.instrument.gauge import ForceAtTime
    from tsis.instrument.recording import RecordingReport
    from tsis.instrument.snapshot import Snapshot
    from tsis.model.gel_sensor import GelSensor


VIRTUAL_NOTE = "no hardware: the virtual probe"


def list_cameras(*, as_json: bool) -> None:
    """Print every camera that responds, and what the other drivers lack."""
    with waiting("searching for cameras"):
        findings = tsis.instrument.discovery.find_cameras()
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "acquire", "list", found=[asdict(item) for item in findings.cameras], missing=dict(findings.missing)
            )
        )
        return
    console = people()
    rows = tuple((item.spec, item.maker, item.model, item.note) for item in findings.cameras)
    columns = ("--camera", "maker", "model", "note")
    console.print(
        rich_table(Table(title="Cameras", columns=columns, values=(("virtual", "", "", VIRTUAL_NOTE), *rows)))
    )
    if findings.missing:
        console.print("Not looked for:")
    for message in findings.missing.values():
        console.print(f"- {message}", markup=False, soft_wrap=True)
    print_notice(console)


def show_camera(connect_camera: Callable[[], Camera], *, as_json: bool) -> None:
    """Print a camera's modes and settings."""
    camera = connect_camera()
    camera.open()
    try:
        name, modes, settings = camera.name, camera.modes(), camera.settings()
    finally:
        camera.stop()
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "acquire",
                "describe",
                camera=name,
                modes=[{"mode": mode.label, **asdict(mode)} for mode in modes],
                settings=[
                    {"name": setting.name, "value": setting.value, "unit": setting.unit, **_finite_range(setting)}
                    for setting in settings
                ],
            )
        )
        return
    console = people()
    console.print("Modes, the default first: " + ", ".join(mode.label for mode in modes), markup=False)
    table = Table(
        title=name,
        columns=("setting", *(Column(label=label) for label in ("now", "lowest", "highest")), "unit"),
        values=tuple(
            (setting.name, setting.value, _bound(setting.low), _bound(setting.high), setting.unit)
            for setting in settings
        ),
    )
    console.print(rich_table(table) if settings else "It has no settings.")
    print_notice(console)


def _finite_range(setting: Setting) -> dict[str, float | None]:
    import numpy as np

    return {
        "low": setting.low if np.isfinite(setting.low) else None,
        "high": setting.high if np.isfinite(setting.high) else None,
    }


def _bound(value: float) -> str:
    import numpy as np

    return f"{value:g}" if np.isfinite(value) else "not told"


WAIT_S = 0.2
FORCE_HOLDS_S = 1.0  # an older reading is not used


@dataclass(frozen=True, slots=True, kw_only=True)
class _Observation:
    """Flags and force of one frame."""

    flags: tuple[GuardFlag, ...]
    force_n: float | None
    state: WatchState


def watch_presses(
    acquisition: Acquisition,
    *,
    seconds: float | None,
    calibration: UsableCalibration | None,
    log: ForceLog | None,
    as_json: bool,
) -> None:
    """Print flags as they appear and disappear, until Ctrl-C or the given seconds have passed."""
    console = Console(stderr=as_json, highlight=False)
    frames: Counter[str] = Counter()
    watch: PressWatch | None = None
    state, position, begun_s = tsis.calibration.guard.watch.WatchState(), 0, time.monotonic()
    troubles = _Troubles(console)
    with ended_by(signal.SIGINT) as ended, Live(console=console, transient=True, auto_refresh=False) as live:
        while not ended.is_set() and not (seconds is not None and time.monotonic() - begun_s >= seconds):
            arrivals, position = _newest(acquisition, position)
            troubles.report("camera", str(acquisition.failure or "") if acquisition.lost or acquisition.ended else "")
            troubles.report("gauge", "" if log is None else log.state().error)
            if not arrivals and acquisition.ring.closed:
                break
            for received in arrivals:
                watch = watch or tsis.calibration.guard.watch.press_watch(received.frame, calibration)
                observed = _observe(watch, state, received, log)
                _report(console.print, state.raised, observed.flags)
                state = observed.state
                frames.update(["frames", *(flag.name for flag in observed.flags)])
                live.update(_line(acquisition, observed), refresh=console.is_terminal)
    if as_json:
        print_watched(frames)
        return
    print_notice(console)


def _newest(acquisition: Acquisition, index: int) -> tuple[tuple[ReceivedFrame, ...], int]:
    """The newest frame of a camera, or every stored frame; and the next index."""
    acquisition.ring.wait(index, WAIT_S)
    arrivals, index, _ = acquisition.ring.read(index)
    return arrivals if acquisition.ring.patient else arrivals[-1:], index


class _Troubles:
    """Trouble of an instrument, printed once when it begins and once when it ends."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._reported: dict[str, str] = {}

    def report(self, what: str, trouble: str) -> None:
        if bool(trouble) != bool(self._reported.get(what)):
            self._reported[what] = trouble
            self._console.print(f"! {what}: {trouble or 'is back'}", markup=False, soft_wrap=True)


def _observe(watch: PressWatch, state: WatchState, received: ReceivedFrame, log: ForceLog | None) -> _Observation:
    # The newest reading: the reading at the frame's time would have to wait for the next one.
    readings = () if log is None else log.readings(since_s=received.arrived_s - FORCE_HOLDS_S)
    force = max(0.0, readings[-1].force_n) if readings else None
    flags, after = watch.step(state, received.frame, force)
    return _Observation(flags=flags, force_n=force, state=after)


def _report(say: Callable[..., None], before: frozenset[str], flags: tuple[GuardFlag, ...]) -> None:
    for flag in flags:
        if flag.name not in before:
            say(f"+ {flag.name}: {flag.advice}", markup=False, soft_wrap=True)
    for name in sorted(before - {flag.name for flag in flags}):
        say(f"- {name}", markup=False)


def _line(acquisition: Acquisition, observation: _Observation) -> str:
    account = acquisition.account()
    force = "" if observation.force_n is None else f", {observation.force_n:.2f} N"
    still = "" if observation.state.settling is None else f", {observation.state.settling.text}"
    names = ", ".join(flag.name for flag in observation.flags) or "no flags"
    return escape(f"{account.frames_per_s:.1f} frames/s, {account.missed} lost{force}{still}: {names}")


GaugePort = Annotated[
    str | None,
    typer.Option("--gauge", help="Serial port of a force gauge, e.g. /dev/ttyUSB0.", rich_help_panel="Gauge"),
]
GaugeUnit = Annotated[
    str | None,
    typer.Option("--gauge-unit", help="Unit of its display, when it sends none.", rich_help_panel="Gauge"),
]
GaugeBaud = Annotated[
    int | None,
    typer.Option("--gauge-baud", help="Its baud rate, bits per second.", show_default="9600", rich_help_panel="Gauge"),
]
GaugeSends = Annotated[
    bool,
    typer.Option("--gauge-sends", help="It sends by itself, without requests.", rich_help_panel="Gauge"),
]
GaugeLatency = Annotated[
    float,
    typer.Option("--gauge-latency-ms", help="Delay of its reading after the frame.", rich_help_panel="Gauge"),
]


@contextmanager
def gauge_log(
    port: str | None, *, unit: str | None, baud: int | None, sends: bool, latency_ms: float
) -> Iterator[ForceLog | None]:
    """Readings of the gauge at a serial port, after the first have arrived; None without a port."""
    if port is None:
        if unit is not None or sends or baud is not None or latency_ms != 0:
            raise InputError(
                "--gauge-unit, --gauge-baud, --gauge-sends and --gauge-latency-ms need --gauge, the port of the gauge"
            )
        yield None
        return
    log = tsis.instrument.force_log.connected_gauge(
        port, unit=unit, baud=baud or tsis.instrument.force_log.BAUD, sends=sends, latency_s=latency_ms / 1000
    )
    try:
        yield log
    finally:
        log.stop()


def force_then(log: ForceLog, time_s: float) -> ForceAtTime:
    """The force at a time, after the next reading has arrived; `GaugeError` when none arrives."""
    log.wait_until(time_s, timeout_s=1.0)
    return log.at(time_s)


def take_sequence(
    acquisition: Acquisition,
    requested: Path,
    *,
    frames: int | None,
    seconds: float | None,
    video: bool,
    calibration: UsableCalibration | None,
    log: ForceLog | None,
    as_json: bool,
) -> None:
    """Record into a new folder until the given frames or seconds, the end of the source, or Ctrl-C."""
    folder = tsis.files.result_folder.free_folder(requested)
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        reason = error.strerror or error
        raise FileInputError(f"{str(folder)!r:.120} must be a folder that can be created; got: {reason}") from error
    rate = None if acquisition.mode is None else acquisition.mode.frames_per_s
    sink = (
        tsis.instrument.recording.LosslessVideo(folder, frames_per_s=rate)
        if video
        else tsis.instrument.recording.FrameFolder(folder)
    )
    gauge = None if log is None else GaugeColumns(log)

    def about() -> dict[str, Any]:
        return {
            "calibration": None if calibration is None else calibration.citation(),
            "gauge": None if gauge is None else gauge.account(),
        }

    with progress_bar("recording; Ctrl-C ends it") as advance, ended_by(signal.SIGINT) as ended:
        report = tsis.instrument.recording.record(
            acquisition,
            sink,
            folder,
            frames=frames,
            seconds=seconds,
            stopped=ended.is_set,
            progress=lambda saved, passed: _advance(advance, saved, passed, frames, seconds),
            beside=None
            if gauge is None
            else tsis.instrument.recording.FurtherColumns(names=GaugeColumns.NAMES, of=gauge.of),
            about=about,
        )
    _print_recording(report, folder, acquisition, about(), as_json=as_json)
    if report.kept == 0:
        raise CameraError(f"nothing was recorded: {report.ended_by or 'no frame arrived'}")
    if report.ended_by:
        raise typer.Exit(FAILED)


def _advance(
    advance: Callable[[int, int], None], kept: int, passed: float, frames: int | None, seconds: float | None
) -> None:
    if frames is not None:
        advance(kept, frames)
    elif seconds is not None:
        advance(int(10 * min(passed, seconds)), int(10 * seconds))
    else:
        advance(kept, max(kept, 1))


class GaugeColumns:
    """Force and its error at each frame, newtons; empty where the gauge had none."""

    NAMES = ("force_n", "force_error_n")

    def __init__(self, log: ForceLog) -> None:
        self._log, self._without = log, 0

    def of(self, received: ReceivedFrame) -> tuple[str, str]:
        """The columns of a frame."""
        try:
            result = force_then(self._log, received.arrived_s)
        except GaugeError:
            self._without += 1
            return "", ""
        return f"{result.force_n:.6f}", f"{result.error_n:.6f}"

    def account(self) -> dict[str, Any]:
        """State of the gauge."""
        return {"frames_without_force": self._without, **asdict(self._log.state())}


def _print_recording(
    report: RecordingReport, folder: Path, acquisition: Acquisition, about: dict[str, Any], *, as_json: bool
) -> None:
    if as_json:
        document = {"folder": str(folder.resolve()), "camera": acquisition.name, "recording": asdict(report)}
        print_json(tsis.present.document.envelope("acquire", "record", **document, **about))
        return
    console = people()
    console.print(
        f"{report.kept} frames in {report.seconds:.1f} s, {report.frames_per_s:.2f} a second; "
        f"{report.missed} lost on the way, {report.overrun} not written in time, "
        f"{report.interruptions} interruptions"
    )
    gauge = about["gauge"]
    if gauge is not None and (gauge["frames_without_force"] or gauge["error"]):
        why = gauge["error"] or "its readings were late"
        console.print(
            f"Gauge: {gauge['frames_without_force']} frames without a force; {why}", markup=False, soft_wrap=True
        )
    if report.ended_by:
        console.print(f"Ended early: {report.ended_by}", markup=False, soft_wrap=True)
    console.print(f"Folder: {folder.resolve()}", markup=False, soft_wrap=True)
    print_notice(console)


ROLES = ("target", "plain", "untouched", "ball")  # as in tsis.records, which is imported only for --save


@dataclass(frozen=True, slots=True, kw_only=True)
class SnapshotDestination:
    """Store and role of a snapshot.

    Attributes
    ----------
    destination
        The store.
    role
        What is pressed.
    probe
        Name of the probe, where no calibration gives it.
    """

    destination: Destination
    role: str
    probe: str = ""

    def save(self, sidecar: Path, calibration: UsableCalibration | None) -> dict[str, Any]:
        """Store the snapshot of a sidecar and return the entry for the result; `TsisError` when it fails."""
        from tsis.records.importing import save_snapshot_to_store  # loads the libraries of records

        with self.destination.opened() as store:
            return save_snapshot_to_store(store, sidecar, role=self.role, probe=self.probe, calibration=calibration)


FRAME_S = 10.0  # longest wait for a frame


def take_snapshot(
    acquisition: Acquisition,
    folder: Path,
    *,
    target: int,
    picture: str,
    map_name: str,
    calibration: UsableCalibration | None,
    log: ForceLog | None,
    role: str,
    probe: str,
    where: SnapshotDestination | None = None,
    as_json: bool,
) -> None:
    """Save the next frame, and print where; ``probe`` is empty where no calibration and no virtual probe names it."""
    received = _next(acquisition)
    force = None if log is None else force_then(log, received.arrived_s)
    image = received.frame.tactile_image(force_n=None if force is None else max(0.0, force.force_n))
    flags = tsis.calibration.guard.watch.check_press(
        tsis.calibration.guard.watch.with_calibrated_scale(image, calibration),
        reference=tsis.calibration.guard.watch.guard_reference(calibration),
    )
    about: dict[str, Any] = {
        "camera": acquisition.name,
        "calibration": None if calibration is None else calibration.citation(),
        "force": None if force is None else asdict(force),
        "flags": [asdict(flag) for flag in flags],
    }

    when = datetime.now().astimezone()

    def coloured(frame: Frame) -> NDArray[np.uint8]:
        return tsis.imaging.colour.colour_map(frame.tactile_image(), name=map_name)

    saved = tsis.instrument.snapshot.save_snapshot(
        received.frame,
        folder,
        target=target,
        when=when,
        colour=coloured,
        picture=picture,
        about={**about, "role": role, "probe": probe or None},
    )
    failure = None
    if where is not None:
        try:
            about["saved"] = where.save(saved.sidecar, calibration)
        except TsisError as error:  # the files stay
            failure = error
    _print_snapshot(saved, received, flags, about, as_json=as_json)
    if failure is not None:
        stop_not_saved(failure, str(saved.sidecar.parent.resolve()))


def _print_snapshot(
    saved: Snapshot, received: ReceivedFrame, flags: Sequence[GuardFlag], about: dict[str, Any], *, as_json: bool
) -> None:
    files = {name: str(path.resolve()) for name, path in asdict(saved).items()}
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "acquire", "snapshot", files=files, sequence=received.frame.sequence, **about
            )
        )
        return
    console = people()
    for name, file in files.items():
        console.print(f"{name}: {file}", markup=False, soft_wrap=True)
    if about["force"] is not None:
        console.print(f"force: {about['force']['force_n']:.3f} N within {about['force']['error_n']:.3f} N")
    for flag in flags:
        console.print(f"- {flag.name}: {flag.advice}", markup=False, soft_wrap=True)
    if "saved" in about:
        from tsis.records.importing import saved_notes  # loads the libraries of records

        for note in saved_notes(about["saved"]):
            console.print(note, markup=False, soft_wrap=True)
    print_notice(console)


def _next(acquisition: Acquisition) -> ReceivedFrame:
    """The newest frame of a camera, or the first stored frame."""
    if not acquisition.ring.wait(0, FRAME_S):
        why = f": {acquisition.failure}" if acquisition.failure is not None else ""
        raise CameraError(f"{acquisition.name} must deliver a frame within {FRAME_S:g} s; got none{why}")
    waiting, _, _ = acquisition.ring.read(0)
    return waiting[0] if acquisition.ring.patient else waiting[-1]


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


OF_VIRTUAL_PROBE, OF_GEL_SENSOR = ("probe", "phantom", "force_n", "seed"), ("reference", "depth")
OF_SNAPSHOT = ("target", "picture", "map_name", "role")


def _require_options_that_count(context: typer.Context, *, virtual: bool, sensor: bool, snapshot: bool) -> None:
    """`InputError` for an option that this camera, or what is saved, would ignore."""
    of_others = (
        (() if virtual else OF_VIRTUAL_PROBE, "the virtual probe: a real camera does not know it"),
        (() if sensor else OF_GEL_SENSOR, "a gel sensor: give --sensor too"),
        (() if snapshot else OF_SNAPSHOT, "a snapshot, and neither for a sequence nor with --watch"),
    )
    for names, what in of_others:
        for option in typed_options(context, names):
            raise InputError(f"{option} must be left out, or given for {what}")


def acquire(
    context: typer.Context,
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
    if not modes:
        virtual, snapshot = camera == VIRTUAL, not (sequence or watch)
        _require_options_that_count(context, virtual=virtual, sensor=sensor is not None, snapshot=snapshot)
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
    loaded = None if calibration is None else tsis.calibration.frames.load_calibration(calibration)
    destination = chosen_destination(save, store, kind)
    calibrated = "" if loaded is None else loaded.calibration.probe
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
        if loaded is not None:
            loaded.require_camera(acquisition, stored=stored)
        if watch:
            watch_presses(acquisition, seconds=seconds, calibration=loaded, log=log, as_json=as_json)
        elif sequence:
            take_sequence(
                acquisition,
                out or Path("tsis-sequence"),
                frames=frames,
                seconds=seconds,
                video=video,
                calibration=loaded,
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
                calibration=loaded,
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
