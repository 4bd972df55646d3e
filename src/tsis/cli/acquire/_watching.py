"""The press guard and gel sensors, live: flags of the newest frame, or its contact, depth and force."""

from __future__ import annotations

import signal
import time
from collections import Counter
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.markup import escape

import tsis
from tsis.cli._contacts import MOST_GEL_FRAMES, MOST_WEIGHTS, chosen_sensor, required_reference
from tsis.cli._groups import ended_by
from tsis.cli._output import print_json, print_notice, print_watched
from tsis.errors import InputError, TsisError, import_extra

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.calibration import UsableCalibration
    from tsis.calibration.guard import GuardFlag, PressWatch, WatchState
    from tsis.imaging.depth import DepthMapper
    from tsis.instrument.acquisition import Acquisition, ReceivedFrame
    from tsis.instrument.gauge import ForceLog
    from tsis.model import GelSensor


WAIT_S = 0.2
FORCE_HOLDS_S = 1.0  # an older reading is not used
VIRTUAL_PRESSES, VIRTUAL_BALL_MM = 6, 6.0  # of the virtual gel sensor, which presses them again and again


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
    state, position, begun_s = tsis.calibration.guard.WatchState(), 0, time.monotonic()
    troubles = _Troubles(console)
    with ended_by(signal.SIGINT) as ended, Live(console=console, transient=True, auto_refresh=False) as live:
        while not ended.is_set() and not (seconds is not None and time.monotonic() - begun_s >= seconds):
            arrivals, position = _newest(acquisition, position)
            troubles.report("camera", str(acquisition.failure or "") if acquisition.lost or acquisition.ended else "")
            troubles.report("gauge", "" if log is None else log.state().error)
            if not arrivals and acquisition.ring.closed:
                break
            for received in arrivals:
                watch = watch or tsis.calibration.guard.press_watch(received.frame, calibration)
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
        made = tsis.virtual.rendered_series(
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
        calibration = tsis.imaging.depth.parse_depth_calibration(tsis.files.read_object(depth, values=MOST_WEIGHTS))
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
    (contact,) = tsis.imaging.contacts([frame], sensor=sensor, reference=reference)
    if not contact.good:
        return "no good contact: " + ", ".join(contact.reasons), contact.reasons
    text = "contact at {:.1f}, {:.1f} px".format(*contact.centre_px)
    text += f", radius {contact.radius_mm:.3f} mm" if contact.radius_mm else f", radius {contact.radius_px:.1f} px"
    if mapper is not None:
        depth = mapper.map(frame)
        force = tsis.mechanics.gel.gel_force(depth.depth_mm, sensor=sensor, sd_mm=depth.sd_mm, draws=20)
        low, high = force.interval_n()
        text += f", deepest {force.deepest_mm:.3f} mm, {force.force_n:.3g} N ({low:.3g} to {high:.3g})"
        text += "".join(f"; {problem}" for problem in force.problems)
    return text, ()


def record_gel(live: GelCamera, out: Path, *, frames: int | None, seconds: float | None, as_json: bool) -> None:
    """Record at most 2000 frames in colour, as PNG files with an index of times, for ``tsis contacts FOLDER``."""
    sensor, folder = chosen_sensor(live.sensor), tsis.report.free_folder(out)
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
            files[name] = tsis.files.encode_picture(np.ascontiguousarray(frame), level=tsis.files.QUICK_PNG)
            rows.append(f"{number},{name},0,{number},{passed:.6f},{passed:.6f}")
    if not files:
        raise InputError(f"--camera must deliver frames; {live.camera} gave none")
    index = {tsis.instrument.recording.RECORDING_INDEX: ("\n".join(rows) + "\n").encode()}
    written = tsis.report.write_folder(folder, files | index)
    if as_json:
        print_json(tsis.report.envelope("acquire", "gel", sensor=sensor.name, frames=len(files), folder=str(written)))
        return
    console = Console(highlight=False)
    console.print(f"{len(files)} frames in colour\nFolder: {written}", markup=False, soft_wrap=True)
    print_notice(console)
