"""A sequence onto the disk, with a progress bar and an honest account."""

from __future__ import annotations

import signal
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from tsis.cli.console_output import people, print_json, print_notice, progress_bar
from tsis.cli.force_gauge import force_then
from tsis.cli.interrupt import ended_by
from tsis.instrument.recording import FrameFolder, FurtherColumns, LosslessVideo, RecordingReport, record
from tsis.model.errors import CameraError, FileInputError, GaugeError
from tsis.report import free_folder
from tsis.report.document import envelope

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tsis.cli.cited_calibration import CitedCalibration
    from tsis.instrument.acquisition import Acquisition, Arrival
    from tsis.instrument.gauge import ForceLog


def take_sequence(
    acquisition: Acquisition,
    wanted: Path,
    *,
    frames: int | None,
    seconds: float | None,
    video: bool,
    calibration: CitedCalibration | None,
    log: ForceLog | None,
    as_json: bool,
) -> None:
    """Record into a new folder until so many frames or seconds have passed, the source ends, or Ctrl-C."""
    folder = free_folder(wanted)
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        reason = error.strerror or error
        raise FileInputError(f"{str(folder)!r:.120} must be a folder that can be made; got: {reason}") from error
    rate = None if acquisition.mode is None else acquisition.mode.frames_per_s
    sink = LosslessVideo(folder, frames_per_s=rate) if video else FrameFolder(folder)
    about = {"calibration": None if calibration is None else calibration.citation()}
    with progress_bar("recording; Ctrl-C ends it") as advance, ended_by(signal.SIGINT) as ended:
        report = record(
            acquisition,
            sink,
            folder,
            frames=frames,
            seconds=seconds,
            stopped=ended.is_set,
            progress=lambda kept, passed: _advance(advance, kept, passed, frames, seconds),
            beside=None if log is None else _force_columns(log),
            about=about,
        )
    _print(report, folder, acquisition, about, as_json=as_json)
    if report.kept == 0:
        raise CameraError(f"nothing was recorded: {report.ended_by or 'no frame came'}")


def _advance(
    advance: Callable[[int, int], None], kept: int, passed: float, frames: int | None, seconds: float | None
) -> None:
    if frames is not None:
        advance(kept, frames)
    elif seconds is not None:
        advance(int(10 * min(passed, seconds)), int(10 * seconds))
    else:
        advance(kept, max(kept, 1))


def _force_columns(log: ForceLog) -> FurtherColumns:
    """Force and its error at each frame, newtons; empty where the gauge had none."""

    def force(arrival: Arrival) -> tuple[str, str]:
        try:
            found = force_then(log, arrival.arrived_s)
        except GaugeError:
            return "", ""
        return f"{found.force_n:.6f}", f"{found.error_n:.6f}"

    return FurtherColumns(names=("force_n", "force_error_n"), of=force)


def _print(
    report: RecordingReport, folder: Path, acquisition: Acquisition, about: dict[str, Any], *, as_json: bool
) -> None:
    if as_json:
        document = {"folder": str(folder.resolve()), "camera": acquisition.name, "recording": asdict(report)}
        print_json(envelope("acquire", **document, **about))
        return
    console = people()
    console.print(
        f"{report.kept} frames in {report.seconds:.1f} s, {report.frames_per_s:.2f} a second; "
        f"{report.missed} lost on the way, {report.overrun} that the disk did not take, "
        f"{report.interruptions} interruptions"
    )
    if report.ended_by:
        console.print(f"Ended early: {report.ended_by}", markup=False, soft_wrap=True)
    console.print(f"Folder: {folder.resolve()}", markup=False, soft_wrap=True)
    print_notice(console)
