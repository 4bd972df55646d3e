"""Long work on a study, one at a time: reading by the virtual probe, or unblinding with analysis."""

from __future__ import annotations

import threading
from functools import partial
from typing import TYPE_CHECKING

from tsis.errors import ControlError, InputError, RecordsError
from tsis.present.study import publish_study
from tsis.study.folder import open_study
from tsis.study.plan import require_short_name
from tsis.study.readings import press_study

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.console.services import Job, Jobs, JobState
    from tsis.console.studies._library import StudyRepository
    from tsis.study.folder import Study


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


def unread(study: Study) -> tuple[tuple[str, int], ...]:
    """Devices that have read some targets and not all, with the number of those they lack."""
    results = []
    for device in study.devices:
        read = {reading.code for reading in study.readings if reading.device == device}
        results.append((device, len(study.plan.codes) - len(read)))
    return tuple((device, left) for device, left in results if left)


def _require_free(jobs: Jobs, name: str) -> None:
    now = job_of(jobs, name)
    if now is not None and now.running:
        raise ControlError(f"only one operation can run on a study; {now.title} is running (cancel it, or wait)")


def _require_readings(study: Study, although_incomplete: bool) -> None:
    if not study.readings:
        raise RecordsError("a study must have a reading before it is unblinded; this one has none")
    if study.unblinded is None and not although_incomplete:
        for device, left in unread(study):
            raise InputError(
                f"every target must be read before a study is unblinded; {device!r:.60} lacks {left} of "
                f"{len(study.plan.codes)} (read on, or tick “even if incomplete”)"
            )


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
