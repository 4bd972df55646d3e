"""Recording of a sequence, as a job independent of the page."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from tsis.console.services._reading import force_at, gauge_force
from tsis.errors import CameraError, FileInputError, GaugeError, InputError
from tsis.files.frame_names import target_folder
from tsis.files.result_folder import free_folder
from tsis.instrument.recording import FrameFolder, FurtherColumns, record
from tsis.model.require import require_integer, require_number

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from tsis.console.services._jobs import Job, Jobs
    from tsis.instrument.acquisition import Acquisition, ReceivedFrame
    from tsis.instrument.gauge import ForceLog


SHORTEST_SEQUENCE_S, LONGEST_SEQUENCE_S, MOST_SEQUENCE_FRAMES = 0.1, 3600.0, 200_000
TENTHS, GAUGE_WAIT_S = 10, 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class SequenceRequest:
    """A sequence of a target: its end after seconds, in [0.1, 3600], or after frames, in [1, 200000].

    Raises `InputError` when neither or both ends are given, or one lies outside its range.
    """

    target: int
    seconds: float | None = None
    frames: int | None = None

    def __post_init__(self) -> None:
        if (self.seconds is None) == (self.frames is None):
            raise InputError("a sequence must have one end: give seconds or frames")
        if self.seconds is not None:
            require_number("seconds", self.seconds, SHORTEST_SEQUENCE_S, LONGEST_SEQUENCE_S, hint="seconds")
        if self.frames is not None:
            object.__setattr__(self, "frames", require_integer("frames", self.frames, 1, MOST_SEQUENCE_FRAMES))


def begin_sequence(
    jobs: Jobs,
    acquisition: Acquisition | None,
    terms: SequenceRequest,
    *,
    workspace: Path,
    gauge: ForceLog | None,
    typed_n: Callable[[], float | None],
    about: Callable[[], Mapping[str, Any]],
) -> Job:
    """Begin to record into a new folder of the target; the job's result maps ``folder`` and the recording's ``report``.

    The index gives the force of each frame where known: of the gauge, the virtual probe, or as typed.

    Parameters
    ----------
    gauge, typed_n
        As of `force_at`; the typed force is read at each frame, since it may change meanwhile.
    about
        Read at the beginning for further entries of the report's file, and again at the end: what differs then, as a
        calibration that another setting has deactivated, is entered as ``..._at_end``.

    Raises
    ------
    CameraError
        When the camera does not run.
    FileInputError
        When the folder cannot be created.
    """
    if acquisition is None or acquisition.lost:
        at_fault = "it is stopped (start it)" if acquisition is None else "it is away (wait until it is back)"
        raise CameraError(f"the camera must run to record a sequence; {at_fault}")
    begun = about()
    folder = _new_folder(workspace / target_folder(terms.target) / "sequence")
    forces = _Forces(gauge, typed_n)

    def about_all() -> dict[str, Any]:
        of_gauge = {"gauge": {"frames_without_force": forces.without, **asdict(gauge.state())}} if gauge else {}
        differing = {f"{name}_at_end": value for name, value in about().items() if value != begun[name]}
        return {"target": terms.target, **begun, **differing, **of_gauge}

    def work(job: Job) -> dict[str, Any]:
        report = record(
            acquisition,
            FrameFolder(folder),
            folder,
            frames=terms.frames,
            seconds=terms.seconds,
            stopped=lambda: job.ending,
            progress=partial(_report, job, terms),
            beside=FurtherColumns(names=forces.NAMES, of=forces.of),
            about=about_all,
        )
        if report.kept == 0:
            raise CameraError(f"nothing was recorded: {report.ended_by or 'no frame came'}")
        lost = f"{report.missed} lost on the way, {report.overrun} not written in time"
        early = f"; ended early: {report.ended_by}" if report.ended_by else ""
        job.say(f"{report.kept} frames in {report.seconds:.1f} s; {lost}{early}: {folder}")
        return {"folder": str(folder.resolve()), "report": asdict(report)}

    return jobs.begin(f"sequence of target {terms.target}", work, at_once=True)


class _Forces:
    """Force at each frame, newtons, and its source; empty where unknown."""

    NAMES = ("force_n", "force_source")

    def __init__(self, gauge: ForceLog | None, typed_n: Callable[[], float | None]) -> None:
        self._gauge, self._typed_n = gauge, typed_n
        self._wait_s, self.without = GAUGE_WAIT_S, 0

    def of(self, frame: ReceivedFrame) -> tuple[str, str]:
        """The columns of a frame."""
        if self._gauge is None:
            observed = force_at(frame, None, self._typed_n())
            return ("", "") if observed is None else (f"{observed.value_n:.6f}", observed.source)
        try:
            result = gauge_force(self._gauge, frame, wait_s=self._wait_s)
        except GaugeError:
            self._wait_s = 0.0  # a gauge that is silent must not hold up the frames
            self.without += 1
            return "", ""
        self._wait_s = GAUGE_WAIT_S
        return f"{result.value_n:.6f}", result.source


def _new_folder(requested: Path) -> Path:
    folder = free_folder(requested)
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        need = "must be a folder that can be made; got"
        raise FileInputError(f"{str(folder)!r:.120} {need}: {error.strerror or error} (free some space)") from error
    return folder


def _report(job: Job, terms: SequenceRequest, saved: int, passed_s: float) -> None:
    if terms.seconds is None:
        job.report(saved, terms.frames or saved)
    else:
        job.report(int(TENTHS * min(passed_s, terms.seconds)), int(TENTHS * terms.seconds))
