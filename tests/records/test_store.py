"""A store gives back what was put in, in either database: edited, archived, deleted, backed up, and private."""

from __future__ import annotations

import getpass
import os
import sqlite3
import stat
import subprocess
import sys
import threading
import warnings
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from sqlalchemy import insert, select, text
from tests.records.sample import WHEN, levels, sample_calibration, sample_estimate, sample_record

from tsis.calibration.file import calibration_sha256
from tsis.errors import FileInputError, InputError, RecordsError, RecordsWarning, StaleRecordError
from tsis.model.image import TactileImage
from tsis.present.html import html_bytes
from tsis.present.target import target_page
from tsis.records import database as engines
from tsis.records import reader as _reader
from tsis.records import schema as tables
from tsis.records.provenance import environment
from tsis.records.reader import ARCHIVED, DELETED, target_summaries
from tsis.records.store import UNDO_DAYS, Store, back_up_store, open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray
    from sqlalchemy import Connection
    from tests.records.conftest import Place

    from tsis.records.reader import TargetSummary
    from tsis.records.store import Store


HOUR = timedelta(hours=1)


def image(seed: int = 0, *, full_scale: float = 255.0) -> TactileImage:
    return TactileImage(
        grey=levels(seed, full_scale=full_scale),
        full_scale=full_scale,
        mm_per_pixel=(0.11, 0.13),
        force_n=0.7,
        name="press.png",
        settings={"exposure_ms": 10.0, "roi": (0, 8)},
    )


def small_image(**values: Any) -> TactileImage:
    return TactileImage(grey=levels(0)[:8, :10], full_scale=255.0, **values)


def test_a_press_comes_back_after_reopening(place: Place) -> None:
    known = sample_calibration()
    with place.open() as store:
        target = store.add_target(name="size-10", truth={"diameter_mm": 10.0})
        kept = store.add_press(
            target, image(full_scale=4095.0), taken=WHEN, calibration=known, flags=("moving",), note="first"
        )
    with place.open(create=False) as store:
        (press,) = store.presses(store.target(1))
        assert press == kept
        np.testing.assert_array_equal(store.levels(press.frame), levels(0, full_scale=4095.0))
        assert calibration_sha256(store.calibration(press.calibration or "")) == calibration_sha256(known)
        assert store.target(1) == target
        assert verify_store(store).sound


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    pixels=arrays.arrays(
        st.sampled_from([np.uint8, np.uint16]), arrays.array_shapes(min_dims=2, max_dims=2, max_side=40)
    )
)
def test_any_frame_comes_back_bit_for_bit(store: Store, pixels: NDArray[np.uint8 | np.uint16]) -> None:
    scale = float(np.iinfo(pixels.dtype).max)
    press = store.add_press(store.add_target(), TactileImage(grey=pixels.astype(float), full_scale=scale), taken=WHEN)
    found = store.levels(press.frame)
    np.testing.assert_array_equal(found, pixels)
    assert found.dtype == pixels.dtype


def test_an_estimate_comes_back_with_every_sample(store: Store) -> None:
    target, known, made = store.add_target(), sample_calibration(), sample_estimate()
    presses = [store.add_press(target, image(seed), taken=WHEN + timedelta(seconds=seed)) for seed in range(3)]
    first = store.add_estimate(
        target, made, kind="inclusion", presses=presses, probe="tsis-2011", calibration=known, environment=environment()
    )
    again = store.add_estimate(
        target, made, kind="inclusion", presses=presses, probe="tsis-2011", calibration=known, supersedes=first
    )
    found = store.record(target)
    assert [each.id for each in found.estimates] == [first.id, again.id]
    assert found.estimates[1].supersedes == first.id
    assert found.estimates[0].presses == tuple(press.id for press in presses)
    assert found.estimates[0].environment == environment()
    for name, values in made.samples.items():
        np.testing.assert_array_equal(found.estimates[0].estimate.samples[name], values)
    assert list(found.calibrations) == [calibration_sha256(known)]
    assert found.image(found.presses[1]).force_n == 0.7


def test_presses_are_listed_in_the_order_in_which_they_were_taken(store: Store) -> None:
    target = store.add_target()
    for seconds in (3, 0, 2, 1):
        store.add_press(target, image(seconds), taken=WHEN + timedelta(seconds=seconds, milliseconds=seconds))
    assert [press.taken.second for press in store.presses(target)] == [0, 1, 2, 3]
    assert [press.taken.second for press in store.presses(target, limit=2, offset=1)] == [1, 2]
    (summary,) = store.targets()
    assert (summary.presses, summary.estimates, summary.last) == (4, 0, WHEN + timedelta(seconds=3, milliseconds=3))


def test_the_first_entries_of_the_audit_say_who_began_the_store(place: Place) -> None:
    for actor in ("", "x" * 500, "two\nlines", "\x1b[31mred"):
        with pytest.raises(InputError, match="actor must be 1 to 200 printable characters"):
            place.open(actor=actor)
        assert not place.folder.exists()
    place.open().close()
    with place.open(actor="ñ") as store:
        store.add_target()
        with store.database.reading() as connection:
            actors = list(
                connection.execute(select(tables.audit_table.c.actor).order_by(tables.audit_table.c.number)).scalars()
            )
    assert set(actors[:-1]) == {getpass.getuser()}
    assert actors[-1] == "ñ"


def test_two_that_write_at_once_both_keep_everything(place: Place) -> None:
    place.open().close()

    def work(seed: int) -> None:
        with place.open() as store:
            target = store.add_target()
            for i in range(8):
                store.add_press(target, image(100 * seed + i), taken=WHEN)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    with place.open() as store:
        assert [each.presses for each in store.targets()] == [8, 8, 8]
        assert verify_store(store).sound


def test_a_number_is_taken_once(store: Store) -> None:
    assert store.add_target(number=7).number == 7
    assert store.add_target().number == 8
    with pytest.raises(InputError, match="7 is taken"):
        store.add_target(number=7)


def test_after_the_largest_number_one_must_be_given(store: Store) -> None:
    for number in (1, 2, 99_999):
        store.add_target(number=number)
    with pytest.raises(InputError, match=r"holds target 99999, after which there is none.*give one that is free, as 3"):
        store.add_target()
    given = sample_record()
    assert store.import_target(replace(given, target=replace(given.target, number=2))).target.number == 3
    assert store.add_target(number=4).number == 4


def test_stores_of_phantoms_and_of_subjects_are_kept_apart(place: Place) -> None:
    place.open(kind="subject").close()
    with pytest.raises(RecordsError, match="it is one of subjects"):
        place.open(kind="phantom")
    with place.open(kind="subject") as store, pytest.raises(InputError, match="truth must be empty"):
        store.add_target(truth={"diameter_mm": 10.0})


def test_what_is_not_there_is_not_made(tmp_path: Path) -> None:
    with pytest.raises(RecordsError, match="there is none"):
        open_store(tmp_path / "none", create=False)
    assert not (tmp_path / "none").exists()


def test_a_file_that_is_no_database_is_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "records.sqlite3").write_bytes(b"not a database, but something that somebody needs" * 100)
    before = (tmp_path / "records.sqlite3").read_bytes()
    with pytest.raises(RecordsError, match="file is not a database"):
        open_store(tmp_path)
    assert (tmp_path / "records.sqlite3").read_bytes() == before


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"taken": datetime(2026, 11, 22)}, "taken must have a time zone"),
        ({"role": "lump"}, "no role is called 'lump'"),
        ({"note": "\x1b[2J"}, "note must be printable"),
        ({"flags": ("a\x00b",)}, "flag must be printable"),
    ],
)
def test_what_a_press_cannot_be_is_refused_and_nothing_is_stored(
    store: Store, values: dict[str, object], sentence: str
) -> None:
    target = store.add_target()
    with pytest.raises(InputError, match=sentence):
        store.add_press(target, image(), **{"taken": datetime.now(UTC), **values})  # type: ignore[arg-type]
    assert store.presses(target) == ()


FLOATS = st.floats(allow_nan=False, allow_infinity=False)
TEXTS = st.text(st.characters(categories=("L", "M", "N", "P", "S")), max_size=30)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    note=TEXTS,
    force=st.floats(0, 1000),
    axis=st.tuples(FLOATS, FLOATS),
    free=st.dictionaries(st.text(max_size=5).filter(lambda name: name != "$number"), FLOATS | st.text(), max_size=3),
)
def test_text_and_numbers_come_back_exactly(
    store: Store, note: str, force: float, axis: tuple[float, float], free: dict[str, Any]
) -> None:
    target = store.add_target(note=note)
    assert store.target(target.number) == target
    try:
        taken_in = small_image(force_n=force, axis_px=axis, settings=free)
    except InputError:
        return  # no such image
    kept = store.add_press(target, taken_in, taken=WHEN, note=note)
    (found,) = store.presses(target)
    assert found == kept
    assert (found.force_n, found.axis_px, found.note, dict(found.settings)) == (force, axis, note, free)
    assert verify_store(store).sound


def test_what_a_database_cannot_hold_is_one_sentence_and_nothing_is_stored(store: Store) -> None:
    target = store.add_target()
    for values in ({"probe": "a\0b"}, {"note": "a\0b"}, {"flags": ("a\udcffb",)}):
        with pytest.raises(InputError, match="must be printable"):
            store.add_press(target, small_image(), taken=WHEN, **values)
    assert store.presses(target) == ()
    assert verify_store(store).sound


@pytest.mark.parametrize("name", ["half a letter \udcff", "a\0b"])
def test_an_estimate_of_an_unspeakable_probe_is_one_sentence(store: Store, name: str) -> None:
    target = store.add_target()
    press = store.add_press(target, small_image(), taken=WHEN)
    made = {"kind": "inclusion", "presses": [press], "calibration": sample_calibration()}
    with pytest.raises(InputError, match="probe must be printable"):
        store.add_estimate(target, sample_estimate(), probe=name, **made)  # type: ignore[arg-type]
    with pytest.raises(RecordsError) as caught, store.database.writing() as connection:
        connection.execute(
            insert(tables.store_table).values(name=name, value=b"\xff".decode("utf-8", "surrogateescape"))
        )
    assert "\n" not in str(caught.value)
    assert store.estimates(target) == ()
    assert verify_store(store).sound


def test_huge_settings_come_back(store: Store) -> None:
    target = store.add_target()
    free = {"map": [0.1 * i for i in range(200_000)], "text": "é" * 1_000_000, "\0": "\0"}
    store.add_press(target, small_image(settings=free), taken=WHEN)
    (found,) = store.presses(target)
    assert found.settings == free
    assert verify_store(store).sound


@pytest.mark.parametrize(
    "taken", [datetime.max.replace(tzinfo=timezone(-HOUR)), datetime.min.replace(tzinfo=timezone(HOUR))]
)
def test_a_time_that_utc_has_not_is_refused(store: Store, taken: datetime) -> None:
    with pytest.raises(InputError, match="taken must be a time that UTC has as well"):
        store.add_press(store.add_target(), small_image(), taken=taken)


def test_a_folder_that_cannot_be_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("somebody's")
    for folder in ("a\0b", tmp_path / "file" / "store", tmp_path / ("x" * 300)):
        with pytest.raises(RecordsError, match="must be a folder that can be made"):
            open_store(folder)


def test_two_who_begin_a_file_at_the_same_moment_wait_for_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """SQLite refuses one of them at once; seen in about 1 of 150 openings by four programs at the same moment."""
    waited: list[float] = []
    monkeypatch.setattr("tsis.records.database.time.sleep", waited.append)

    class Locked:
        def execute(self, statement: str) -> None:
            if len(waited) < 3:
                error = sqlite3.OperationalError("database is locked")
                error.sqlite_errorcode = sqlite3.SQLITE_BUSY
                raise error
            assert statement == "PRAGMA journal_mode=WAL"

    engines.use_write_ahead_log(Locked())  # type: ignore[arg-type]
    assert len(waited) == 3


def test_a_closed_store_says_so(tmp_path: Path) -> None:
    with open_store(tmp_path) as store:
        target = store.add_target()
    with pytest.raises(RecordsError, match="they were closed"):
        store.presses(target)
    with pytest.raises(RecordsError, match="they were closed"):
        store.add_target()


def test_what_is_no_press_is_refused_in_a_sentence(store: Store) -> None:
    target = store.add_target()
    with pytest.raises(InputError, match="target must be a Target"):
        store.add_press("x", small_image(), taken=WHEN)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="image must be a TactileImage"):
        store.add_press(target, None, taken=WHEN)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="calibration must be a ProbeCalibration"):
        store.add_press(target, small_image(), taken=WHEN, calibration="x")  # type: ignore[arg-type]


@pytest.mark.parametrize("ending", ["samples", "json"])
def test_a_damaged_file_hides_nothing_else_of_a_target(tmp_path: Path, ending: str) -> None:
    known = sample_calibration()
    with open_store(tmp_path) as store:
        target = store.add_target()
        press = store.add_press(target, small_image(), taken=WHEN)
        store.add_estimate(
            target, sample_estimate(), kind="inclusion", presses=[press], probe="tsis-2011", calibration=known
        )
        (file,) = tmp_path.glob(f"files/*/*.{ending}")
        file.write_bytes(file.read_bytes() + b"x")
        found = store.record(target)
        assert found.presses == (press,)
        np.testing.assert_array_equal(found.levels(press), store.levels(press.frame))
        assert (len(found.estimates), len(found.calibrations)) == ((0, 1) if ending == "samples" else (1, 0))
        assert len(found.damaged) == 1
        assert "must be as it was stored" in found.damaged[0]
        with pytest.raises(RecordsError, match="must be as it was stored"):
            found.require_whole()
        for kind in ("phantom", "subject"):
            page = target_page(replace(found, target=replace(target, kind=kind)))
            result = [note for note in page.notes if note.startswith("Left out: ")]
            assert len(result) == 1
            assert (tmp_path.name in result[0]) is (kind == "phantom")
            assert html_bytes(page)


def test_a_list_counts_anew_only_what_another_program_changed(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    counted: list[object] = []

    def spy(connection: Connection, some: set[str] | None = None) -> dict[str, TargetSummary]:
        counted.append(some)
        return target_summaries(connection, some)

    monkeypatch.setattr(_reader, "target_summaries", spy)
    with place.open() as store, place.open() as other:
        first, second = store.add_target(), store.add_target()
        assert [item.presses for item in store.targets()] == [0, 0]
        assert store.targets() == store.targets()
        other.add_press(second, image(1), taken=WHEN)
        other.add_press(second, image(2), taken=WHEN)
        assert [item.presses for item in store.targets()] == [0, 2]
        assert counted == [None, {second.id}]
        other.set_state(first, DELETED)
        assert store.targets() == other.targets()
        other.erase_expired(now=datetime.now(UTC) + timedelta(days=UNDO_DAYS, hours=1))
        assert [item.target for item in store.targets(hidden=True)] == [second]


def edited_image() -> TactileImage:
    return TactileImage(grey=levels(0)[:8, :10], full_scale=255.0, force_n=0.7, settings={"roi": (0, 8)})


def test_an_edit_of_what_somebody_else_has_changed_is_refused(store: Store) -> None:
    read_by_both = store.add_target(name="a")
    press = store.add_press(read_by_both, edited_image(), taken=WHEN)
    store.edit_target(read_by_both, name="b")
    with pytest.raises(StaleRecordError, match="somebody else has changed it since version 1"):
        store.edit_target(read_by_both, name="c")
    assert store.target(1).name == "b"
    edited = store.edit_press(press, force_n=1.0, flags=("moving",))
    with pytest.raises(StaleRecordError):
        store.edit_press(press, note="late")
    assert store.presses(read_by_both) == (edited,)
    assert verify_store(store).sound


def test_what_may_not_be_changed_is_not(store: Store) -> None:
    press = store.add_press(store.add_target(), edited_image(), taken=WHEN)
    with pytest.raises(InputError, match="no field of a press that may be changed is called 'frame'"):
        store.edit_press(press, frame="0" * 64)


def test_only_what_was_named_is_changed(store: Store) -> None:
    """Whatever else the record that is handed in says."""
    target = store.add_target(name="a", note="n")
    press = store.add_press(target, edited_image(), taken=WHEN)
    forged = replace(press, taken=WHEN - HOUR, name="other", full_scale=4095.0, probe="p", force_n=3.0)
    edited = store.edit_press(forged, note="x")
    assert edited == replace(press, note="x", version=2) == store.presses(target)[0]
    renamed = store.edit_target(replace(target, number=77, note="other"), name="b")
    assert renamed == replace(target, name="b", version=2) == store.target(1)
    for edit in (lambda: store.edit_target(renamed), lambda: store.edit_press(edited)):
        with pytest.raises(InputError, match="must change something; got nothing"):
            edit()
    assert store.target(1).version == 2
    assert verify_store(store).sound


@pytest.mark.parametrize(
    "truth",
    [
        {"diameter_mm": -1.0},
        {"depth_mm": 0.0},
        {"young_kpa": 2e6},
        {"diameter_mm": 10.0, "depth_mm": float("inf")},
    ],
)
def test_no_target_is_entered_with_what_no_inclusion_has(store: Store, truth: dict[str, float]) -> None:
    with pytest.raises(InputError, match=r"truth\['\w+'\] must lie in"):
        store.add_target(truth=truth)
    target = store.add_target(truth={"diameter_mm": 0.1, "offset_x_mm": -3.0})
    with pytest.raises(InputError, match=r"truth\['\w+'\] must lie in"):
        store.edit_target(target, truth=truth)
    assert store.target(target.number) == target


def test_names_are_one_line_and_notes_may_be_more(store: Store) -> None:
    with pytest.raises(InputError, match="name must be one line"):
        store.add_target(name="two\nlines")
    target = store.add_target(name="one line", note="two\nlines")
    with pytest.raises(InputError, match="name must be one line"):
        store.edit_target(target, name="two\nlines")
    assert store.edit_target(target, note="three\nof\nthem").name == "one line"


LATER = timedelta(days=UNDO_DAYS, hours=1)


def removed_image(seed: int) -> TactileImage:
    return TactileImage(grey=levels(seed)[:8, :10], full_scale=255.0, force_n=0.7)


def numbers(store: Store) -> list[int]:
    return [item.target.number for item in store.targets()]


def made_long_ago(store: Store) -> None:
    """Files that nobody is about to cite again."""
    for name, ending in store.blobs.names():
        os.utime(store.blobs.path(name, ending), (1e9, 1e9))


def test_an_archived_target_is_hidden_and_can_be_restored(store: Store) -> None:
    first, second = store.add_target(name="a"), store.add_target(name="b")
    assert store.state(first) is None
    state = store.set_state(first, ARCHIVED)
    assert state is not None
    assert (state.name, store.state(first)) == (ARCHIVED, state)
    assert numbers(store) == [second.number]
    assert [item.target.number for item in store.targets(hidden=True)] == [1, 2]
    store.add_press(first, removed_image(1), taken=WHEN)  # an archive may grow
    assert store.set_state(first, "") is None
    assert numbers(store) == [1, 2]
    assert verify_store(store).sound
    with pytest.raises(InputError, match="state of a target"):
        store.set_state(first, "burnt")


def test_a_deleted_target_takes_no_press_until_it_is_restored(store: Store) -> None:
    target = store.add_target()
    store.set_state(target, DELETED)
    assert numbers(store) == []
    with pytest.raises(RecordsError, match=r"target 1 must not be deleted to be added to; it was deleted on .* \(rest"):
        store.add_press(target, removed_image(1), taken=WHEN)
    assert store.erase_expired() == 0  # within the time of undo
    store.set_state(target, "")
    store.add_press(target, removed_image(1), taken=WHEN)
    assert numbers(store) == [1]
    assert store.add_target().number == 2


def test_what_was_deleted_long_ago_is_erased_and_what_others_cite_stays(store: Store) -> None:
    erased = store.import_target(sample_record()).target
    stays = store.add_target(name="stays")
    shared = store.add_press(erased, removed_image(1), taken=WHEN)
    press = store.add_press(stays, removed_image(1), taken=WHEN)  # of the same frame
    assert shared.frame == press.frame
    before = {name for name, _ in store.blobs.names()}
    count = store.press_count(erased)
    made_long_ago(store)
    store.set_state(erased, DELETED)
    assert store.erase_expired(now=datetime.now(UTC) + LATER) == 1
    assert [item.target.number for item in store.targets(hidden=True)] == [stays.number]
    assert store.presses(stays) == (press,)
    assert store.levels(press.frame).shape == (8, 10)
    verification = verify_store(store)
    assert (verification.faults, verification.unnamed) == ((), 0)
    assert len(before) - len({name for name, _ in store.blobs.names()}) == count - 1 + 1  # its frames, its samples
    with store.database.reading() as connection:
        tombstone = connection.execute(text("SELECT value FROM store WHERE name LIKE 'state of target %'")).scalar_one()
        actions = set(connection.execute(text("SELECT action FROM audit WHERE kind = 'targets'")).scalars())
    assert f'"number": {erased.number}, "presses": {count}' in tombstone
    assert "erase" in actions
    assert store.erase_expired(now=datetime.now(UTC) + LATER) == 0


def test_an_erased_target_that_is_put_back_behind_the_programs_back_is_a_fault(store: Store) -> None:
    target = store.add_target()
    store.set_state(target, DELETED)
    with store.database.reading() as connection:
        row = connection.execute(text("SELECT * FROM targets")).one()._asdict()
    store.erase_expired(now=datetime.now(UTC) + LATER)
    with store.database.writing() as connection:
        names = ", ".join(row)
        connection.execute(text(f"INSERT INTO targets ({names}) VALUES ({', '.join(f':{name}' for name in row)})"), row)
    assert verify_store(store).faults == (f"targets {target.id}: this row is not as it was stored",)


def test_a_file_that_was_saved_again_this_moment_stays(store: Store) -> None:
    target = store.add_target()
    press = store.add_press(target, removed_image(1), taken=WHEN)
    made_long_ago(store)
    store.blobs.put(store.blobs.get(press.frame, "png"), "png")  # by another program, whose row comes next
    store.set_state(target, DELETED)
    store.erase_expired(now=datetime.now(UTC) + LATER)
    assert [name for name, _ in store.blobs.names()] == [press.frame]


def test_a_target_that_is_unknown_has_no_state(store: Store) -> None:
    target = store.add_target()
    with pytest.raises(RecordsError):
        store.set_state(replace(target, id="0" * 32), DELETED)


@pytest.fixture
def filled(tmp_path: Path) -> Iterator[Store]:
    with open_store(tmp_path / "store") as store:
        store.import_target(sample_record())
        yield store


def contents(store: Store) -> list[object]:
    return [(item, store.presses(item.target), store.estimates(item.target)) for item in store.targets()]


def test_a_backup_holds_what_the_store_held(filled: Store, tmp_path: Path) -> None:
    counts: list[tuple[int, int]] = []
    before = str(contents(filled))
    result = back_up_store(filled, tmp_path / "backup", progress=lambda done, total: counts.append((done, total)))
    assert result.sound
    assert counts[-1] == (2 * result.files, 2 * result.files)
    filled.add_target(name="later")
    with open_store(tmp_path / "backup", create=False) as copy:
        assert str(contents(copy)) == before
        assert copy.identity == filled.identity
        assert verify_store(copy).sound
        back_up_store(copy, tmp_path / "restored")  # to restore is the same the other way round
    with open_store(tmp_path / "restored", create=False) as restored:
        assert str(contents(restored)) == before
        restored.add_target()
        assert verify_store(restored).sound
    for path in (tmp_path / "backup").rglob("*"):
        assert stat.S_IMODE(path.stat().st_mode) & 0o077 == 0, path


def test_what_is_added_meanwhile_does_not_spoil_it(filled: Store, tmp_path: Path) -> None:
    image = TactileImage(grey=levels(7)[:8, :10], full_scale=255.0, force_n=0.7)

    def add(done: int, _: int) -> None:
        if done == 1:
            filled.add_press(filled.targets()[0].target, image, taken=WHEN)

    result = back_up_store(filled, tmp_path / "backup", progress=add)
    assert (result.sound, result.unanchored, result.unnamed) == (True, 0, 0)
    assert verify_store(filled).files == result.files + 1


def test_a_damaged_store_gives_no_backup_that_looks_sound(filled: Store, tmp_path: Path) -> None:
    name, ending = next(iter(filled.blobs.names()))
    filled.blobs.path(name, ending).write_bytes(b"other")
    with pytest.raises(RecordsError, match="must be as it was stored"):
        back_up_store(filled, tmp_path / "backup")
    assert [path.name for path in tmp_path.iterdir()] == ["store"]


def test_a_row_that_was_changed_beside_the_audit_is_named(filled: Store, tmp_path: Path) -> None:
    with filled.database.writing() as connection:
        connection.exec_driver_sql("UPDATE targets SET name = 'other'")
    with pytest.raises(RecordsError, match=r"must be as its audit says; .*: this row is not as it was stored"):
        back_up_store(filled, tmp_path / "backup")
    assert [path.name for path in tmp_path.iterdir()] == ["store"]


def test_a_name_that_is_taken_is_refused(filled: Store, tmp_path: Path) -> None:
    (tmp_path / "backup").mkdir()
    with pytest.raises(FileInputError, match="must be a new folder"):
        back_up_store(filled, tmp_path / "backup")


on_posix = pytest.mark.skipif(os.name != "posix", reason="modes of files say something on POSIX systems only")


@pytest.fixture
def generous_umask() -> Iterator[None]:
    """Let new files be readable by everyone, unless the program says otherwise."""
    before = os.umask(0o022)
    yield
    os.umask(before)


def modes(folder: Path) -> dict[str, int]:
    return {
        str(path.relative_to(folder.parent)): stat.S_IMODE(path.stat().st_mode)
        for path in (folder, *sorted(folder.rglob("*")))
    }


def fill_folder(folder: Path) -> None:
    """A store with a press, the write-ahead log of its database still there."""
    with open_store(folder, kind="subject") as store:
        target = store.add_target()
        store.add_press(target, TactileImage(grey=np.full((4, 5), 7.0)), taken=datetime(2026, 1, 2, tzinfo=UTC))


@on_posix
@pytest.mark.usefixtures("generous_umask")
def test_new_store_is_readable_by_its_owner_alone(tmp_path: Path) -> None:
    folder = tmp_path / "made" / "store"
    with open_store(folder, kind="subject") as store:
        target = store.add_target()
        store.add_press(target, TactileImage(grey=np.full((4, 5), 7.0)), taken=datetime(2026, 1, 2, tzinfo=UTC))
        found = modes(tmp_path / "made")
    assert {"made/store/records.sqlite3", "made/store/records.sqlite3-wal", "made/store/audit-anchor.json"} < set(found)
    assert sum(name.endswith(".png") for name in found) == 1
    folders = {name for name in found if (tmp_path / name).is_dir()}
    assert {name: oct(mode) for name, mode in found.items() if mode != (0o700 if name in folders else 0o600)} == {}


@on_posix
@pytest.mark.usefixtures("generous_umask")
def test_new_store_warns_of_nothing(tmp_path: Path) -> None:
    fill_folder(tmp_path / "store")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        open_store(tmp_path / "store", kind="subject").close()


@pytest.mark.system
@on_posix
@pytest.mark.usefixtures("generous_umask")
def test_open_modes_of_an_old_store_are_warned_of_with_a_command_that_mends_them(tmp_path: Path) -> None:
    folder = tmp_path / "of a laboratory"
    fill_folder(folder)
    for path in (folder, *folder.rglob("*")):
        path.chmod(0o755 if path.is_dir() else 0o644)
    with pytest.warns(RecordsWarning, match="other users of this machine can read the records") as caught:
        open_store(folder, kind="subject").close()
    command = str(caught[0].message).partition("this closes the folder: ")[2].rstrip(")")
    subprocess.run(["sh", "-c", command], check=True)
    assert all(mode & 0o077 == 0 for mode in modes(folder).values())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        open_store(folder, kind="subject").close()


@on_posix
@pytest.mark.usefixtures("generous_umask")
def test_open_modes_are_warned_of_once(tmp_path: Path) -> None:
    fill_folder(tmp_path / "store")
    for folder in (tmp_path / "store", tmp_path / "store" / "files"):
        folder.chmod(0o755)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        for _ in range(3):
            open_store(tmp_path / "store", kind="subject").close()
    assert len(caught) == 1


@pytest.mark.system
@on_posix
@pytest.mark.usefixtures("generous_umask")
def test_command_line_warns_in_one_line_and_goes_on(tmp_path: Path) -> None:
    fill_folder(tmp_path / "store")
    for folder in (tmp_path / "store", tmp_path / "store" / "files"):
        folder.chmod(0o755)
    command = [
        sys.executable,
        "-c",
        "from tsis.cli import main; main()",
        "records",
        "list",
        "--store",
        str(tmp_path / "store"),
    ]
    found = subprocess.run([*command, "--kind", "subject"], capture_output=True, text=True, check=True)
    assert found.stderr.startswith("Warning: other users of this machine can read the records")
    assert found.stderr.count("\n") == 1
