"""Work in the background, however it ends."""

from __future__ import annotations

import gc
import threading
import weakref
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import pytest
from tests.console.services.instruments import FixedGauge
from tests.waiting import HANGS_S, until

from tsis.console.services.jobs import AT_ONCE, REMEMBERED, RESULTS, Job, Jobs
from tsis.errors import ControlError, InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path


@pytest.fixture
def jobs() -> Iterator[Jobs]:
    jobs = Jobs()
    yield jobs
    jobs.close()


def done(job: Job) -> str:
    assert job.wait(HANGS_S)
    return job.state().status


def test_the_result_and_what_was_told_on_the_way(jobs: Jobs) -> None:
    def work(job: Job) -> int:
        job.advance(3, 4)
        job.say("three of four")
        return 7

    job = jobs.begin("count", work)
    assert done(job) == "done"
    state = job.state()
    assert (state.title, state.done, state.total, state.sentence, job.result) == ("count", 3, 4, "three of four", 7)
    assert (state.running, state.fraction) == (False, 0.75)
    assert jobs.get(job.identity) is job


def test_a_job_tells_when_it_began_and_when_it_was_over(jobs: Jobs) -> None:
    before = datetime.now(UTC)
    gauge = FixedGauge()
    job = jobs.begin("wait", gauge)
    assert (job.state().over, job.state().began is not None) == (None, True)
    gauge.over.set()
    assert done(job) == "done"
    state = job.state()
    assert state.began is not None
    assert state.over is not None
    assert before <= state.began <= state.over <= datetime.now(UTC)
    assert (job.without_result().state().began, job.without_result().state().over) == (state.began, state.over)


def test_nobody_can_tell_the_share_of_steps_that_nobody_counted() -> None:
    uncounted = Job("look").state()
    assert (uncounted.running, uncounted.fraction) == (True, 0.0)


def test_few_at_once_and_all_of_many_in_order(jobs: Jobs) -> None:
    lock, running, most, order = threading.Lock(), [0], [0], []
    together = threading.Barrier(AT_ONCE)

    def work(number: int) -> Callable[[Job], int]:
        def do(job: Job) -> int:
            with lock:
                running[0] += 1
                most[0] = max(most[0], running[0])
                order.append(number)
            together.wait(HANGS_S)  # nobody goes on alone
            with lock:
                running[0] -= 1
            return number

        return do

    number = REMEMBERED // AT_ONCE * AT_ONCE
    begun = [jobs.begin(f"job {item}", work(item)) for item in range(number)]
    assert [done(job) for job in begun] == ["done"] * number
    assert most[0] == AT_ONCE
    assert [order[item] // AT_ONCE for item in range(number)] == [item // AT_ONCE for item in range(number)]
    assert [job.result for job in begun] == list(range(number))


def test_what_comes_after_a_job_comes_however_it_ended(jobs: Jobs) -> None:
    owned, over = [FixedGauge() for _ in range(AT_ONCE)], []
    for item in owned:
        jobs.begin("long", item, after=lambda: over.append("long"))
        assert item.begun.wait(HANGS_S)
    queued = jobs.begin("queued", lambda job: 1, after=lambda: over.append("queued"))
    queued.end()
    for item in owned:
        item.over.set()
    assert done(queued) == "ended"
    assert "queued" in over
    failing = jobs.begin("failing", lambda job: 1 // 0, after=lambda: over.append("failing"))
    assert done(failing) == "failed"
    assert "failing" in over
    assert done(jobs.begin("whole", lambda job: 1, after=lambda: 1 // 0)) == "done"


def test_what_must_begin_at_once_queues_behind_nothing(jobs: Jobs) -> None:
    owned = [FixedGauge() for _ in range(AT_ONCE)]
    for item in owned:
        jobs.begin("long", item)
        assert item.begun.wait(HANGS_S)
    queued = jobs.begin("queued", lambda job: 1)
    urgent = jobs.begin("urgent", lambda job: 2, at_once=True)
    assert done(urgent) == "done"
    assert queued.state().status == "running"
    owned[0].over.set()
    assert done(queued) == "done"
    owned[1].over.set()


def test_too_many_are_refused(jobs: Jobs) -> None:
    owned = [FixedGauge() for _ in range(REMEMBERED)]
    for item in owned:
        jobs.begin("long", item)
    with pytest.raises(ControlError, match=f"at most {REMEMBERED} jobs may wait at once"):
        jobs.begin("one more", lambda job: None)
    assert len(jobs.states()) == REMEMBERED
    assert done(jobs.begin("before the camera", lambda job: 1, at_once=True)) == "done"  # which nobody can put off


def test_one_that_is_asked_ends_at_its_next_step_and_a_waiting_one_never_begins(jobs: Jobs) -> None:
    owned = [FixedGauge() for _ in range(AT_ONCE)]
    running = [jobs.begin("long", item) for item in owned]
    begun: list[Job] = []
    waiting = jobs.begin("waiting", begun.append)
    waiting.end()
    running[0].end()
    assert done(running[0]) == "ended"
    assert running[0].state().sentence == "long: cancelled"
    assert done(waiting) == "ended"
    assert begun == []
    assert running[0].result is None


class Speechless(Exception):  # noqa: N818 - as some libraries call theirs
    def __str__(self) -> str:
        raise RuntimeError("no words")


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (InputError("depth_mm must lie in (0, 28]; got 31.0"), "depth_mm must lie in (0, 28]; got 31.0"),
        (RuntimeError(""), "odd failed: RuntimeError: no reason was given"),
        (KeyError("kind"), "odd failed: KeyError: 'kind'"),
        (Speechless(), "odd failed: Speechless: no reason was given"),
        (ValueError("first\n  second\x0bthird"), "odd failed: ValueError: first second third"),
        (SystemExit(3), "odd failed: SystemExit: 3"),
        (KeyboardInterrupt(), "odd failed: KeyboardInterrupt: no reason was given"),
        (MemoryError(), "odd failed: MemoryError: no reason was given"),
        (GeneratorExit(), "odd failed: GeneratorExit: no reason was given"),
    ],
)
def test_whatever_goes_wrong_becomes_a_sentence(jobs: Jobs, error: BaseException, message: str) -> None:
    def work(job: Job) -> None:
        raise error

    job = jobs.begin("odd", work)
    assert done(job) == "failed"
    assert job.state().sentence == message
    assert done(jobs.begin("after it", lambda job: 1)) == "done"


def test_a_long_complaint_is_cut(jobs: Jobs) -> None:
    def work(job: Job) -> None:
        raise OSError("x" * 9999)

    job = jobs.begin("odd", work)
    assert done(job) == "failed"
    assert len(job.state().sentence) < 700


class Large:
    pass


def test_of_many_results_the_last_ones_are_kept(jobs: Jobs) -> None:
    remaining: list[weakref.ref[Large]] = []

    def work(job: Job) -> Any:
        result = Large()
        remaining.append(weakref.ref(result))
        return result

    first = jobs.begin("first", work)
    assert done(first) == "done"
    identity = first.identity
    del first
    for _ in range(2 * REMEMBERED):
        assert done(jobs.begin("next", work)) == "done"
    until(lambda: gc.collect() >= 0 and sum(item() is not None for item in remaining) == RESULTS)
    assert [item() is not None for item in remaining] == [False] * (len(remaining) - RESULTS) + [True] * RESULTS
    assert len(jobs.states()) == REMEMBERED
    with pytest.raises(InputError, match=f"last {REMEMBERED}; got"):
        jobs.get(identity)


def test_what_an_old_job_returned_is_with_those_who_hold_it_alone(jobs: Jobs) -> None:
    def work(job: Job) -> str:
        job.report(3, 4)
        job.say("three of four")
        return "what it found"

    first = jobs.begin("first", work)
    assert done(first) == "done"
    for _ in range(RESULTS):
        assert done(jobs.begin("next", work)) == "done"
    until(lambda: jobs.get(first.identity).result is None)
    assert jobs.get(first.identity).state() == first.state()
    assert jobs.get(first.identity).wait(0.0)
    assert first.result == "what it found"


def test_one_that_lasted_keeps_its_result_however_many_ended_before(jobs: Jobs) -> None:
    owned = FixedGauge()
    long = jobs.begin("long", owned)
    for _ in range(2 * RESULTS):
        assert done(jobs.begin("short", lambda job: 1)) == "done"
    owned.over.set()
    assert done(long) == "done"
    assert jobs.get(long.identity).result == "ended in order"


@pytest.mark.parametrize("identity", ["", "x" * 500, "0" * 32])
def test_an_unknown_one_is_refused(jobs: Jobs, identity: str) -> None:
    with pytest.raises(InputError, match="job must be one of this console's"):
        jobs.get(identity)


def test_closing_ends_all_and_takes_no_more() -> None:
    jobs, owned = Jobs(), [FixedGauge() for _ in range(AT_ONCE + 2)]
    begun = [jobs.begin("long", item) for item in owned]
    deaf = threading.Event()
    stuck = jobs.begin("deaf", lambda job: deaf.wait(HANGS_S), at_once=True)
    jobs.close(timeout_s=0.5)
    assert [job.state().status for job in begun] == ["ended"] * len(begun)
    assert stuck.state().status == "running"  # it asks nothing, and nobody waits for it
    with pytest.raises(ControlError, match="shutting down"):
        jobs.begin("late", lambda job: None)
    deaf.set()
    jobs.close()


def test_no_thread_stays_when_nothing_is_left_to_do(jobs: Jobs) -> None:
    before = threading.active_count()
    assert done(jobs.begin("one", lambda job: 1)) == "done"
    until(lambda: threading.active_count() <= before)


def test_the_history_outlives_the_program_and_names_what_it_cut_off(tmp_path: Path) -> None:
    file = tmp_path / "workspace" / "jobs.jsonl"
    first = Jobs(file)
    assert (first.history.past, first.history.interrupted) == ((), ())
    done = first.begin("sum", lambda job: job.say("42"))
    assert done.wait(HANGS_S)
    waits = FixedGauge()
    cut = first.begin("sequence of target 3", waits, at_once=True)
    assert waits.begun.wait(HANGS_S)
    with file.open("a") as damaged:
        damaged.write('{"identity": "half')
    second = Jobs(file)  # the first was killed
    (over, interrupted) = second.history.past
    assert over == done.state()
    assert (interrupted.identity, interrupted.status) == (cut.identity, "failed")
    assert interrupted.sentence == "the console ended before the job finished; data saved until then are safe"
    assert second.history.interrupted == (interrupted,)
    third = Jobs(file)
    assert (third.history.past, third.history.interrupted) == ((over, interrupted), ())
    waits.over.set()
    assert cut.wait(HANGS_S)


def test_a_history_that_cannot_be_written_stops_no_job(tmp_path: Path) -> None:
    (tmp_path / "jobs.jsonl").mkdir()
    jobs = Jobs(tmp_path / "jobs.jsonl")
    job = jobs.begin("sum", lambda job: job.say("42"))
    assert job.wait(HANGS_S)
    assert job.state().status == "done"
