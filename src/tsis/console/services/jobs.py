"""Background jobs: threads with progress and cancellation."""

from __future__ import annotations

import json
import logging
import threading
import time
import uuid
from collections import OrderedDict, deque
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from tsis.errors import ControlError, InputError, TsisError
from tsis.files.json_values import from_json_value, to_json_value

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


AT_ONCE, REMEMBERED = 2, 50
RESULTS = 10  # of finished jobs that stay in memory: some contain pictures and samples
CLOSE_S = 3.0  # timeout of cancelled jobs
LONGEST_SENTENCE = 600
RUNNING, DONE, FAILED, ENDED = "running", "done", "failed", "ended"
_log = logging.getLogger(__name__)


class JobCancelled(Exception):  # noqa: N818 - no error: it ends the loops of cancelled work
    """Raised inside work that was cancelled."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JobState:
    """State of a job.

    Attributes
    ----------
    identity, title
        Its own, and what people see.
    status
        ``"running"``, also while it waits for its turn, ``"done"``, ``"failed"`` or ``"ended"``.
    done, total
        Steps done, and all steps; 0 where unknown.
    sentence
        Why it failed, or its result as text.
    began, over
        When it was begun and when it was over, UTC; ``over`` is None while it runs.
    """

    identity: str
    title: str
    status: str
    done: int = 0
    total: int = 0
    sentence: str = ""
    began: datetime | None = None
    over: datetime | None = None

    @property
    def running(self) -> bool:
        """Whether it runs or waits."""
        return self.status == RUNNING

    @property
    def fraction(self) -> float:
        """Fraction of the steps done, in [0, 1]; 0 where unknown."""
        return self.done / self.total if self.total else 0.0


class Job:
    """One piece of work, running or finished; safe for several threads.

    A job that ``follows_camera`` may be ended by the camera's owner only. ``after`` is called once it is over, however
    it ended, also before its first step.
    """

    def __init__(self, title: str, *, follows_camera: bool = False, after: Callable[[], object] = lambda: None) -> None:
        self.identity, self.title, self.follows_camera = uuid.uuid4().hex, title, follows_camera
        self._after = after
        self._lock, self._finished, self._ending = threading.Lock(), threading.Event(), threading.Event()
        self._status, self._done, self._total, self._message = RUNNING, 0, 0, ""
        self._began = datetime.now(UTC)
        self._over: datetime | None = None
        self.result: Any = None  # before it is done

    def state(self) -> JobState:
        """Its state."""
        with self._lock:
            return JobState(
                identity=self.identity,
                title=self.title,
                status=self._status,
                done=self._done,
                total=self._total,
                sentence=self._message,
                began=self._began,
                over=self._over,
            )

    def without_result(self) -> Job:
        """A copy of a finished job without its result, which only the holders of this job have then."""
        job = Job(self.title, follows_camera=self.follows_camera)
        state, job.identity = self.state(), self.identity
        job._status, job._done, job._total, job._message = state.status, state.done, state.total, state.sentence
        job._began, job._over = self._began, self._over
        job._finished.set()
        return job

    @property
    def ending(self) -> bool:
        """Whether it was cancelled."""
        return self._ending.is_set()

    def end(self) -> None:
        """Cancel it; it ends at its next step."""
        self._ending.set()

    def wait(self, timeout_s: float) -> bool:
        """Wait until it is over; False when the time is."""
        return self._finished.wait(timeout_s)

    def report(self, done: int, total: int) -> None:
        """Report (steps done, all steps)."""
        with self._lock:
            self._done, self._total = done, total

    def say(self, message: str) -> None:
        """Set the message of the result."""
        with self._lock:
            self._message = message

    def advance(self, done: int, total: int) -> None:
        """Report (steps done, all steps), and raise `JobCancelled` after cancellation: the ``progress`` of calls."""
        self.report(done, total)
        if self._ending.is_set():
            raise JobCancelled

    def run(self, work: Callable[[Job], Any]) -> None:
        """Do the work, before `finish`; an error of whatever kind becomes its sentence."""
        status = DONE
        message: str | None = None
        try:
            self.advance(0, 0)
            self.result = work(self)
        except JobCancelled:
            status, message = ENDED, f"{self.title}: cancelled"
        except TsisError as error:
            status, message = FAILED, _error_text(error)
        except BaseException as error:  # nothing else would report it
            _log.exception("a job failed: %s", self.title)
            status, message = FAILED, f"{self.title} failed: {type(error).__name__}: {_error_text(error)}"
        try:
            self._after()
        except Exception:
            _log.exception("what follows a job failed: %s", self.title)
        with self._lock:
            self._over = datetime.now(UTC)
            self._status = status
            self._message = self._message if message is None else message

    def finish(self) -> None:
        """Release the waiting threads."""
        self._finished.set()


MOST_PAST, MOST_LINES = 200, 2000  # jobs of the history that are shown; lines of its file before it is made shorter
INTERRUPTED = "the console ended before the job finished; data saved until then are safe"


class JobHistory:
    """The jobs of earlier runs of the program, in a file of one line for each beginning and each end.

    ``past`` are those that are over, the newest last, and ``interrupted`` those that the last end of the program cut
    off. A line that cannot be read or written is left out.
    """

    def __init__(self, file: Path | None) -> None:
        self._file, self._lock = file, threading.Lock()
        states: dict[str, JobState] = {}
        lines = self._lines()
        for line in lines:
            try:
                state = from_json_value(JobState, json.loads(line), "job")
            except (ValueError, InputError):  # cut off, or of another release
                continue
            states[state.identity] = state
        cut = [state for state in states.values() if state.running]
        ended = {state.identity: replace(state, status=FAILED, sentence=INTERRUPTED) for state in cut}
        self.interrupted = tuple(ended.values())
        self.past = tuple((states | ended).values())[-MOST_PAST:]
        if ended or len(lines) > MOST_LINES:
            self._write("w", self.past)

    def add(self, state: JobState) -> None:
        """Enter a job that begins or is over."""
        self._write("a", (state,))

    def _lines(self) -> list[str]:
        try:
            return [] if self._file is None else self._file.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError):  # none was begun yet
            return []

    def _write(self, mode: str, states: tuple[JobState, ...]) -> None:
        if self._file is None:
            return
        try:
            with self._lock:
                self._file.parent.mkdir(parents=True, exist_ok=True)
                with self._file.open(mode, encoding="utf-8") as file:
                    file.writelines(json.dumps(to_json_value(state)) + "\n" for state in states)
        except OSError as error:
            _log.warning("the history of jobs was not written: %s", error)


class Jobs:
    """The jobs of a console: limited in number at once; the last ones and fewer results stay; safe for several threads.

    Threads of jobs do not keep the program from ending: what they store is whole or absent at any moment. ``history``
    has those of earlier runs of the program.
    """

    def __init__(self, history: Path | None = None) -> None:
        self.history = JobHistory(history)
        self._lock = threading.Lock()
        self._jobs: OrderedDict[str, Job] = OrderedDict()
        self._waiting: deque[tuple[Job, Callable[[Job], Any]]] = deque()
        self._returned: deque[str] = deque()  # identities of jobs whose results stay, in the order of their ends
        self._working = 0
        self._closed = False

    def begin(
        self,
        title: str,
        work: Callable[[Job], Any],
        *,
        at_once: bool = False,
        after: Callable[[], object] = lambda: None,
    ) -> Job:
        """Begin work: it is called with its `Job`, and its return value becomes the job's result.

        With ``at_once`` it follows the camera: it begins immediately, and belongs to the camera's owner. ``after`` is
        called once it is over, however it ended; never where it was not begun. Raises `ControlError` when too many jobs
        wait already, or the console is closing.
        """
        job = Job(title, follows_camera=at_once, after=after)
        state = job.state()
        with self._lock:
            if self._closed:
                raise ControlError("the console is shutting down and starts no jobs (start it again)")
            running = sum(job.state().running for job in self._jobs.values())
            if not at_once and running >= REMEMBERED:
                raise ControlError(f"at most {REMEMBERED} jobs may wait at once; wait until one is done")
            self.history.add(state)  # before the line of its end
            self._jobs[job.identity] = job
            self._forget()
            if at_once:
                _thread(self._run, job, work)
            else:
                self._waiting.append((job, work))
                if self._working < AT_ONCE:
                    self._working += 1
                    _thread(self._work)
        return job

    def get(self, identity: str) -> Job:
        """The job of that identity; `InputError` when there is none."""
        with self._lock:
            job = self._jobs.get(identity)
        if job is None:
            raise InputError(f"job must be one of this console's last {REMEMBERED}; got {identity!r:.40}")
        return job

    def states(self) -> tuple[JobState, ...]:
        """All that are remembered, the newest last."""
        with self._lock:
            jobs = list(self._jobs.values())
        return tuple(job.state() for job in jobs)

    def close(self, *, timeout_s: float = CLOSE_S) -> None:
        """Cancel all, accept no more, and wait for the running ones."""
        with self._lock:
            self._closed = True
            jobs = list(self._jobs.values())
            waiting, self._waiting = self._waiting, deque()
        for job in jobs:
            job.end()
        for job, work in waiting:
            self._run(job, work)  # which ends before its first step
        until_s = time.monotonic() + timeout_s
        for job in jobs:
            job.wait(max(0.0, until_s - time.monotonic()))

    def _work(self) -> None:
        """Do what waits, and go when nothing does."""
        while True:
            with self._lock:
                if not self._waiting:
                    self._working -= 1
                    return
                job, work = self._waiting.popleft()
            self._run(job, work)

    def _run(self, job: Job, work: Callable[[Job], Any]) -> None:
        job.run(work)
        self.history.add(job.state())
        if job.result is not None:
            self._save_result(job)
        job.finish()  # not before: what is begun after this one ends after it

    def _save_result(self, job: Job) -> None:
        with self._lock:
            self._returned.append(job.identity)
            while len(self._returned) > RESULTS:
                old = self._returned.popleft()
                if old in self._jobs:
                    self._jobs[old] = self._jobs[old].without_result()

    def _forget(self) -> None:
        for identity, job in list(self._jobs.items()):
            if len(self._jobs) <= REMEMBERED:
                return
            if not job.state().running:
                del self._jobs[identity]


def tissue_title(number: int) -> str:
    """Title of the job that reads the tissue of a target."""
    return f"tissue of target {number}"


def estimate_title(number: int) -> str:
    """Title of an estimate's job, by which pages find the one of their target."""
    return f"estimate of target {number}"


def _thread(target: Callable[..., None], *given: object) -> None:
    threading.Thread(target=target, args=given, name="job", daemon=True).start()


def _error_text(error: BaseException) -> str:
    """What an error says, in one line; errors of libraries may say nothing, too much, or fail to say it."""
    try:
        text = " ".join(str(error).split())
    except Exception:
        text = ""
    return text[:LONGEST_SENTENCE] or "no reason was given"
