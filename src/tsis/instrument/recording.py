"""Recordings of frames with an index: each is stored or counted."""

from __future__ import annotations

import csv
import io
import math
import os
import shutil
import time
from contextlib import closing, suppress
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.errors import FileInputError, InputError, TsisError
from tsis.files.atomic import write_durably
from tsis.files.canonical_json import json_bytes
from tsis.files.images import QUICK_PNG, encode_picture
from tsis.files.reading import as_path, printable_path, read_parsed
from tsis.instrument.image_files import opencv, quiet_decoders, quiet_ffmpeg, whole_levels

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from tsis.instrument.acquisition import Account, Acquisition, ReceivedFrame
    from tsis.instrument.camera import Frame


VIDEO_NAME = "frames.mkv"
ASSUMED_RATE = 30.0  # for players, of a source without a clock; the index contains the real times
SPARE_BYTES = 64 * 2**20  # the encoder does not report a full disk


class FrameSink(Protocol):
    """Storage of frames."""

    def save(self, frame: Frame, number: int) -> str:
        """Store the frame as number ``number`` from 0 and return its place; OSError when it cannot."""

    def close(self) -> None:
        """Finish; OSError when the stored frames are incomplete."""


class FrameFolder:
    """One PNG file per frame, 8 or 16 bits, in an existing folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def save(self, frame: Frame, number: int) -> str:
        """Write ``frame-000000.png`` and so on."""
        name = f"frame-{number:06d}.png"
        content = encode_picture(whole_levels(frame.pixels, frame.full_scale), level=QUICK_PNG)
        try:
            with (self._folder / name).open("xb") as file:
                file.write(content)
        except OSError:
            with suppress(OSError):
                (self._folder / name).unlink(missing_ok=True)  # half a frame would be read as a damaged one
            raise
        return name

    def close(self) -> None:
        """Every file is closed already."""


class LosslessVideo:
    """The file ``frames.mkv`` in an existing folder, in the FFV1 codec: 8 bits, lossless.

    ``frames_per_s`` is the rate for players; the index contains the real times.
    """

    def __init__(self, folder: Path, *, frames_per_s: float | None = None) -> None:
        self._file = folder / VIDEO_NAME
        self._rate = frames_per_s or ASSUMED_RATE
        self._writer: Any = None
        self._saved = 0

    def save(self, frame: Frame, number: int) -> str:
        """Append the frame."""
        pixels = whole_levels(frame.pixels, frame.full_scale)
        if frame.full_scale > 255:
            raise InputError(
                f"frames of a video must have at most 8 bits; got full scale {frame.full_scale:g} (record a folder)"
            )
        if shutil.disk_usage(self._file.parent).free < SPARE_BYTES:
            raise OSError(28, "less than 64 MiB are free on this disk, too little for a video to go on")
        if self._writer is None:
            self._writer = self._opened(pixels.shape[1], pixels.shape[0])
        self._writer.write(pixels)
        self._saved += 1
        return f"{VIDEO_NAME}#{number}"

    def close(self) -> None:
        """End the file and check its number of frames."""
        if self._writer is None:
            return
        self._writer.release()
        self._writer = None
        cv2 = opencv("video files")
        with quiet_decoders(), quiet_ffmpeg():
            written = cv2.VideoCapture(str(self._file.resolve()), cv2.CAP_FFMPEG)
            count = int(written.get(cv2.CAP_PROP_FRAME_COUNT)) if written.isOpened() else 0
            written.release()
        if abs(count - self._saved) > 1 + 0.01 * self._saved:  # this container stores only its duration
            raise OSError(5, f"the video holds {count} of {self._saved} frames")

    def _opened(self, columns: int, rows: int) -> Any:
        cv2 = opencv("video files")
        codec = cv2.VideoWriter.fourcc(*"FFV1")
        with quiet_decoders(), quiet_ffmpeg():
            writer = cv2.VideoWriter(
                str(self._file.resolve()), cv2.CAP_FFMPEG, codec, self._rate, (columns, rows), isColor=False
            )
        if not writer.isOpened():
            raise OSError(5, "OpenCV cannot write an FFV1 video here")
        return writer


RECORDING_FORMAT, RECORDING_VERSION = "tsis-recording", 1
RECORDING_INDEX, RECORDING_SUMMARY = "frames.csv", "recording.json"
RECORDING_COLUMNS = ("number", "kept_in", "connection", "sequence", "time_s", "arrived_s")
WAIT_S = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class FurtherColumns:
    """Additional columns of the index: their headings, and a function that gives their values for a frame."""

    names: tuple[str, ...]
    of: Callable[[ReceivedFrame], Sequence[Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingReport:
    """Counts of the frames of a recording: the camera sent ``kept + missed + overrun``.

    Attributes
    ----------
    kept
        Frames on the disk.
    missed
        Frames that the camera numbered and that never arrived completely.
    overrun
        Frames that arrived and were overwritten before they reached the disk.
    interruptions
        How often the camera was lost.
    seconds
        From the first stored frame to the last.
    frames_per_s
        Stored frames over that time; 0 for fewer than two.
    ended_by
        Message where the recording ended early; empty otherwise.
    """

    kept: int
    missed: int
    overrun: int
    interruptions: int
    seconds: float
    frames_per_s: float
    ended_by: str = ""


def record(
    acquisition: Acquisition,
    sink: FrameSink,
    folder: str | os.PathLike[str],
    *,
    frames: int | None = None,
    seconds: float | None = None,
    stopped: Callable[[], bool] = lambda: False,
    progress: Callable[[int, float], None] = lambda stored, seconds: None,
    beside: FurtherColumns | None = None,
    about: Callable[[], Mapping[str, Any]] = dict,
    clock: Callable[[], float] = time.monotonic,
) -> RecordingReport:
    """Record the frames that arrive from now on; of stored frames all.

    The folder also gets ``frames.csv``, a line per frame, and at the end ``recording.json`` with the report. When the
    disk fills or the program is interrupted, the stored frames stay and the report counts the others.

    ``recording.json`` contains the start twice: in UTC, and on ``clock``, which relates ``arrived_s`` to a time of day.

    Parameters
    ----------
    acquisition
        A running acquisition.
    sink
        Stores frames.
    folder
        Existing folder for index and report.
    frames, seconds
        Limits; without them a recording ends with the source or by ``stopped``.
    stopped
        Called between frames; True ends the recording.
    progress
        Called with (stored frames, seconds) after each batch.
    beside
        Additional columns of the index, e.g. the force at each frame.
    about
        Called at the end; returns further entries of ``recording.json``, e.g. the calibration.
    clock
        Seconds, monotonic: that of the acquisition.
    """
    root = as_path(folder)
    tally, end_s = _Tally(most=frames), math.inf if seconds is None else clock() + seconds
    beside = beside or FurtherColumns(names=(), of=lambda received: ())
    begun, begun_s = datetime.now(UTC), clock()

    def ended() -> bool:
        return stopped() or clock() >= end_s or tally.full

    ended_by, missed = "", 0 if acquisition.ring.patient else acquisition.account().missed
    try:
        with (root / RECORDING_INDEX).open("x", newline="", encoding="utf-8") as index, closing(sink):
            rows = csv.writer(index)
            rows.writerow((*RECORDING_COLUMNS, *beside.names))
            for batch, overrun in _batches(acquisition, ended):
                tally.overrun += overrun
                for received in batch[: tally.left]:
                    frame = received.frame
                    where, arrived = sink.save(frame, tally.kept), f"{received.arrived_s:.6f}"
                    numbers = received.connection, frame.sequence, frame.time_s, arrived
                    rows.writerow((tally.kept, where, *numbers, *beside.of(received)))
                    tally.add(received)
                index.flush()
                progress(tally.kept, clock() - begun_s)
            os.fsync(index.fileno())
        # Stored frames end without a failure, a camera that is not reconnected by its loss.
        ended_by = "" if ended() or acquisition.failure is None else str(acquisition.failure)
    except OSError as error:
        ended_by = f"{printable_path(root)} took no more frames after {tally.kept}: {error.strerror or error}"
    except TsisError as error:
        ended_by = str(error)
    account = acquisition.account()
    report = tally.report(account, begun_s, account.missed - missed, ended_by)
    started = {"begun": begun.isoformat(timespec="microseconds"), "begun_s": begun_s}
    return _with_summary(root, report, acquisition, {**started, **about()})


def _batches(acquisition: Acquisition, ended: Callable[[], bool]) -> Iterator[tuple[tuple[ReceivedFrame, ...], int]]:
    """Frames on arrival, with the number of overwritten ones; until ``ended`` or the source's end."""
    position = 0 if acquisition.ring.patient else acquisition.ring.end
    while not ended():
        acquisition.ring.wait(position, WAIT_S)
        closed = acquisition.ring.closed  # before reading, so that the last frames are included
        batch, position, overrun = acquisition.ring.read(position)
        yield batch, overrun
        if closed:
            return


@dataclass(slots=True, kw_only=True)
class _Tally:
    """Counts frames by their numbers."""

    most: int | None
    kept: int = 0
    overrun: int = 0
    first_s: float = 0.0
    last: ReceivedFrame | None = None

    @property
    def full(self) -> bool:
        return self.most is not None and self.kept >= self.most

    @property
    def left(self) -> int | None:
        return None if self.most is None else self.most - self.kept

    def add(self, frame: ReceivedFrame) -> None:
        if self.last is None:
            self.first_s = frame.arrived_s
        self.kept += 1
        self.last = frame

    def report(self, account: Account, begun_s: float, missed: int, ended_by: str) -> RecordingReport:
        seconds = 0.0 if self.last is None else self.last.arrived_s - self.first_s
        return RecordingReport(
            kept=self.kept,
            missed=missed,
            overrun=self.overrun,
            interruptions=sum(gone.at_s + gone.noticed_after_s >= begun_s for gone in account.interruptions),
            seconds=seconds,
            frames_per_s=(self.kept - 1) / seconds if seconds > 0 else 0.0,
            ended_by=ended_by,
        )


def _with_summary(
    path: Path, report: RecordingReport, acquisition: Acquisition, about: Mapping[str, Any]
) -> RecordingReport:
    """Write the report's file; the report records a failure to do so."""
    document = {
        "format": RECORDING_FORMAT,
        "version": RECORDING_VERSION,
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "camera": acquisition.name,
        "mode": None if acquisition.mode is None else asdict(acquisition.mode),
        "report": asdict(report),
        "interruptions": [asdict(gone) for gone in acquisition.account().interruptions],
        **about,
    }
    try:
        write_durably(path / RECORDING_SUMMARY, json_bytes(document))
    except OSError as error:
        unwritten = f"{RECORDING_SUMMARY} could not be written: {error.strerror or error}"
        return replace(report, ended_by="; ".join(part for part in (report.ended_by, unwritten) if part))
    return report


LARGEST_INDEX_BYTES = 64 * 2**20


def read_recording_index(folder: str | os.PathLike[str]) -> tuple[tuple[Path, float], ...]:
    """Files of the frames of a recording with their arrival times in seconds, in order.

    Raises `FileInputError` when the folder has no valid ``frames.csv``, or it lists no frame or a file elsewhere.
    """
    root = as_path(folder)
    rows = read_parsed(root / RECORDING_INDEX, _rows, most=LARGEST_INDEX_BYTES)
    for name, _ in rows:
        if not name or Path(name).name != name or name in (".", ".."):
            raise FileInputError(
                f"{printable_path(root / RECORDING_INDEX)} must name files beside it; got {name!r:.80} "
                "(a recording in a video is not read)"
            )
    return tuple((root / name, arrived_s) for name, arrived_s in rows)


def _rows(text: str) -> list[tuple[str, float]]:
    try:
        lines = list(csv.DictReader(io.StringIO(text)))
        rows = [(line["kept_in"], float(line["arrived_s"])) for line in lines]
    except (csv.Error, KeyError, TypeError, ValueError) as error:
        raise InputError(f"it must have the columns {', '.join(RECORDING_COLUMNS)}; it has not") from error
    if not rows or not np.isfinite([time for _, time in rows]).all():
        raise InputError("it must list at least one frame with the time of its arrival; it does not")
    return rows
