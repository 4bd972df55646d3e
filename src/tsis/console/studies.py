"""Blinded studies of a console, below its workspace."""

from __future__ import annotations

import hashlib
import re
import threading
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from tsis.console.statuses import AbsentError
from tsis.errors import ControlError, InputError, RecordsError, TsisError
from tsis.files.reading import one_line, read_bytes
from tsis.present.study import PAGE, PAPER, publish_study
from tsis.study.folder import ANALYSED, PLAN, is_file_name, new_study, open_study
from tsis.study.log import LOG_FILE
from tsis.study.plan import require_short_name
from tsis.study.readings import press_study

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path
    from typing import Any

    from tsis.console.services.jobs import Job, Jobs, JobState
    from tsis.study.folder import Study
    from tsis.study.plan import TargetTruth


FORMS = {"html": PAGE, "pdf": PAPER}
LARGEST_BYTES = 128 * 2**20


def has_report(study: Study) -> bool:
    """Whether a report of it was written into its folder."""
    return _newest(study) is not None


def report_bytes(study: Study, form: str) -> bytes:
    """A file of the newest report, in a form of `FORMS`.

    Raises `AbsentError` without a report, `RecordsError` when the file was changed since, and `FileInputError` when it
    cannot be read.
    """
    newest = _newest(study)
    if newest is None:
        raise AbsentError(f"study {study.plan.name} must be analysed before it has a report; it is not")
    folder, hashes = newest
    content = read_bytes(study.folder / folder / FORMS[form], most=LARGEST_BYTES)
    if hashes.get(FORMS[form]) != hashlib.sha256(content).hexdigest():
        raise RecordsError(
            f"{FORMS[form]} must be as it was written; it was changed (verify the study, and analyse it again)"
        )
    return content


def _newest(study: Study) -> tuple[str, dict[str, str]] | None:
    """Folder below the study's, and hashes of its files by their names."""
    if study.unblinded is None:
        return None
    for entry in reversed(study.chain.entries):
        folder, files = entry.content.get("folder"), entry.content.get("files")
        if entry.action == ANALYSED and is_file_name(folder) and isinstance(files, dict):
            return folder, files
    return None


FOLDER = "studies"
NAME = re.compile(r"[A-Za-z0-9_-]{1,60}", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class StudySummary:
    """A study in a list."""

    name: str  # of its folder
    targets: int = 0
    readings: int = 0
    unblinded: str = ""  # when and by whom; empty while it is blind
    trouble: str = ""  # why it cannot be read; empty where it can


class StudyRepository:
    """The studies below a console's workspace."""

    def __init__(self, workspace: Path) -> None:
        self._folder = workspace / FOLDER

    def names(self) -> tuple[str, ...]:
        """Of the studies that are there, in the order of the alphabet."""
        try:
            folders = sorted(path.name for path in self._folder.iterdir() if (path / PLAN).is_file())
        except FileNotFoundError:
            return ()
        except OSError as error:
            raise RecordsError(f"the folder of studies must be readable; got: {error.strerror or error}") from error
        return tuple(name for name in folders if NAME.fullmatch(name))

    def path(self, name: str) -> Path:
        """Folder of the study of that name; `AbsentError` when there is none."""
        if not NAME.fullmatch(name):
            raise AbsentError(
                f"name of a study must be 1 to 60 letters, digits, dashes and underscores; got {name!r:.80}"
            )
        if not (self._folder / name / PLAN).is_file():
            raise AbsentError(f"study must be one of this console's; there is none of the name {name!r}")
        return self._folder / name

    def study(self, name: str) -> Study:
        """The study of that name as it is now; errors as `place` and `tsis.study.folder.open_study`."""
        return open_study(self.path(name))

    def make(
        self, name: str, targets: Sequence[TargetTruth] | Callable[[int], Sequence[TargetTruth]], **terms: Any
    ) -> Study:
        """Make a study; ``terms`` and errors as of `tsis.study.folder.new_study`."""
        if not NAME.fullmatch(name):
            requirement = "must be 1 to 60 letters, digits, dashes and underscores"
            raise InputError(name="name", requirement=requirement, value=f"{name!r:.80}")
        if (self._folder / name).exists():
            raise InputError(f"name must be a new one; there is {name!r} already (choose another)", name="name")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordsError(f"the folder of studies must be writable; got: {error.strerror or error}") from error
        return new_study(self._folder / name, targets, **terms)

    def summaries(self) -> tuple[StudySummary, ...]:
        """All studies; one that cannot be read says why."""
        return tuple(self._summary(name) for name in self.names())

    def stamp(self, name: str) -> tuple[int, int]:
        """Another pair of numbers whenever the log of a study has changed; zeros where there is none."""
        try:
            status = (self._folder / name / LOG_FILE).stat()
        except OSError:
            return 0, 0
        return status.st_mtime_ns, status.st_size

    def stamps(self) -> tuple[tuple[str, tuple[int, int]], ...]:
        """The same of all studies, by their names."""
        return tuple((name, self.stamp(name)) for name in self.names())

    def _summary(self, name: str) -> StudySummary:
        try:
            study = self.study(name)
        except TsisError as error:
            return StudySummary(name=name, trouble=one_line(error))
        return StudySummary(
            name=name, targets=len(study.plan.codes), readings=len(study.readings), unblinded=unblinded_text(study)
        )


def unblinded_text(study: Study) -> str:
    """When and by whom a study was unblinded; empty while it is blind."""
    entry = study.unblinded
    return "" if entry is None else one_line(f"{entry.moment[:16].replace('T', ' ')} UTC by {entry.actor}")


PREPARING = "Preparing the probe; this is done once."
_begin = threading.Lock()  # between the check for running jobs and the beginning of another


def reading_title(name: str) -> str:
    """What people see of a run."""
    return f"readings of study {name}"


def reading_text(done: int, total: int) -> str:
    """Which target is read now, of all of a run.

    Examples
    --------
    >>> reading_text(3, 4), reading_text(4, 4)
    ('Reading target 4 of 4.', 'Reading target 4 of 4.')
    """
    return f"Reading target {min(done + 1, total)} of {total}."


def publishing_title(name: str) -> str:
    """What people see of an analysis."""
    return f"analysis of study {name}"


def job_of(jobs: Jobs, name: str) -> JobState | None:
    """The newest job of a study, under way or over; None when there was none."""
    titles = (reading_title(name), publishing_title(name))
    return next((state for state in reversed(jobs.states()) if state.title in titles), None)


def begin_reading(jobs: Jobs, study_repository: StudyRepository, name: str, *, operator: str) -> Job:
    """Have the virtual probe read what an operator has still to read.

    Raises `InputError` without an operator's name or such a study, `RecordsError` when the study is unblinded, and
    `ControlError` while other work on it runs.
    """
    require_short_name("operator", operator)
    with _begin:
        _require_free(jobs, name)
        study = study_repository.study(name)
        if study.unblinded is not None:
            raise RecordsError("readings must be entered before a study is unblinded; this one is unblinded")
        return jobs.begin(reading_title(name), partial(_read, study.folder, operator))


def begin_publishing(
    jobs: Jobs, study_repository: StudyRepository, name: str, *, by: str, although_incomplete: bool = False
) -> Job:
    """Unblind a study where it is still blind, analyse it and write its report.

    Raises `InputError` without a name or such a study, or with unread targets unless ``although_incomplete``;
    `RecordsError` when it has no reading; `ControlError` while other work on it runs.
    """
    require_short_name("name", by)
    with _begin:
        _require_free(jobs, name)
        study = study_repository.study(name)
        _require_readings(study, although_incomplete)
        return jobs.begin(publishing_title(name), partial(_publish, study.folder, by, although_incomplete))


def _require_free(jobs: Jobs, name: str) -> None:
    now = job_of(jobs, name)
    if now is not None and now.running:
        raise ControlError(f"only one operation can run on a study; {now.title} is running (cancel it, or wait)")


def _require_readings(study: Study, although_incomplete: bool) -> None:
    if not study.readings:
        raise RecordsError("a study must have a reading before it is unblinded; this one has none")
    if study.unblinded is None and not although_incomplete:
        study.require_read("read on, or tick “even if incomplete”")


def _read(folder: Path, operator: str, job: Job) -> None:
    def preparing(done: int, total: int) -> None:
        job.say(PREPARING)
        job.advance(done, total)

    def progress(done: int, total: int) -> None:
        job.say(reading_text(done, total))
        job.report(done, total)

    job.say(PREPARING)
    done = press_study(
        open_study(folder), operator=operator, preparing=preparing, progress=progress, ended=lambda: job.ending
    )
    message = f"{done.entered} readings entered, {done.undecided} of them undecided; {done.left} left."
    job.say(f"{message} Readings are saved: run it again to continue." if done.left else message)


def _publish(folder: Path, by: str, although_incomplete: bool, job: Job) -> None:
    job.say("Comparing the readings with the truth.")
    study = open_study(folder)
    _require_readings(study, although_incomplete)  # others may have entered some while it waited
    publish_study(study, by=by, progress=job.advance)
    job.say("Analysed; the report is written.")
