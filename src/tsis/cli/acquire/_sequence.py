"""Record a sequence to the disk."""

from __future__ import annotations

import signal
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import typer

import tsis
from tsis.cli._force_gauge import force_then
from tsis.cli._groups import ended_by
from tsis.cli._output import print_json
from tsis.cli._progress import FAILED, progress_bar
from tsis.errors import CameraError, FileInputError, GaugeError
from tsis.present.terminal import people, print_notice

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tsis.calibration.frames import UsableCalibration
    from tsis.instrument.acquisition import Acquisition, ReceivedFrame
    from tsis.instrument.force_log import ForceLog
    from tsis.instrument.recording import RecordingReport


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
    _print(report, folder, acquisition, about(), as_json=as_json)
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


def _print(
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
