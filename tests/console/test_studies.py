"""One thing at a time is done with a study of a console, and nothing of it by a path."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.console.services.instruments import FixedGauge
from tests.waiting import HANGS_S

from tsis.console.services.jobs import Jobs
from tsis.console.statuses import AbsentError
from tsis.console.studies import StudyRepository, begin_publishing, begin_reading, job_of, reading_title, report_bytes
from tsis.errors import ControlError, InputError, RecordsError
from tsis.study.folder import Study, printed_targets
from tsis.study.readings import import_table

if TYPE_CHECKING:
    from pathlib import Path

HEADINGS = b"code,score,operator,repeat,diameter_mm,depth_mm,young_kpa\n"


def read_by_palpation(repository: StudyRepository, study: Study, count: int) -> None:
    rows = [f"{code},{at},Ben,1,,,".encode() for at, code in enumerate(study.plan.codes[:count])]
    import_table(repository.study("trial"), HEADINGS + b"\n".join(rows), "r.csv", device="palpation", actor="Ben")


def test_a_second_run_is_refused_while_the_first_is_under_way(tmp_path: Path) -> None:
    repository, jobs, owned = StudyRepository(tmp_path), Jobs(), FixedGauge()
    repository.make("trial", printed_targets(1, 1), actor="Ada")
    running = jobs.begin(reading_title("trial"), owned)
    with pytest.raises(ControlError, match="readings of study trial is running"):
        begin_reading(jobs, repository, "trial", operator="Ada")
    with pytest.raises(ControlError, match="only one operation"):
        begin_publishing(jobs, repository, "trial", by="Ada")
    owned.over.set()
    assert running.wait(HANGS_S)
    state = job_of(jobs, "trial")
    assert state is not None
    assert not state.running
    jobs.close()


def test_a_study_is_unblinded_whole_or_although(tmp_path: Path) -> None:
    repository, jobs = StudyRepository(tmp_path), Jobs()
    study = repository.make("trial", printed_targets(2, 0), actor="Ada")
    with pytest.raises(RecordsError, match="must have a reading"):
        begin_publishing(jobs, repository, "trial", by="Ada", although_incomplete=True)
    read_by_palpation(repository, study, 1)
    with pytest.raises(InputError, match="'palpation' lacks 1 of 2"):
        begin_publishing(jobs, repository, "trial", by="Ada")
    with pytest.raises(AbsentError, match="must be analysed before"):
        report_bytes(repository.study("trial"), "html")
    assert begin_publishing(jobs, repository, "trial", by="Eve", although_incomplete=True).wait(HANGS_S)
    after = repository.study("trial")
    assert after.unblinded is not None
    assert after.unblinded.actor == "Eve"
    assert report_bytes(after, "pdf").startswith(b"%PDF")
    with pytest.raises(RecordsError, match="this one is"):
        begin_reading(jobs, repository, "trial", operator="Ada")
    jobs.close()


@pytest.mark.parametrize("name", ["..", "../up", "/etc", "a/b", "a\\b", "", ".", "é", "a" * 61, "a\n", "a\0"])
def test_a_name_is_no_path(tmp_path: Path, name: str) -> None:
    repository = StudyRepository(tmp_path)
    for call in (repository.path, lambda item: repository.make(item, printed_targets(1, 1))):
        with pytest.raises(InputError, match="letters, digits, dashes and underscores"):
            call(name)
    assert list(tmp_path.iterdir()) == []
