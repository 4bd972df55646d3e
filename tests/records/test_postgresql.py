"""A store in a real PostgreSQL: servers that die, refuse or forget, and what its text and numbers come back as."""

from __future__ import annotations

import subprocess
import sys
import threading
from contextlib import ExitStack, suppress
from datetime import timedelta
from typing import TYPE_CHECKING, Any

import psycopg
import pytest
from sqlalchemy import make_url
from tests.records import postgres_server
from tests.records.conftest import Place
from tests.records.sample import WHEN, levels

from tsis.errors import MissingExtraError, RecordsError
from tsis.model.image import TactileImage
from tsis.records import database as engines
from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tests.records.postgres_server import Server

    from tsis.records.store import Store

pytestmark = pytest.mark.system
PRESSES = 12


@pytest.fixture
def database(postgres: Server) -> str:
    return postgres.new_database()


@pytest.fixture
def in_postgres(tmp_path: Path, database: str) -> Iterator[Store]:
    with open_store(tmp_path / "files", database=database) as opened:
        yield opened


def image(seed: int = 0, **values: Any) -> TactileImage:
    return TactileImage(grey=levels(seed)[:8, :10], full_scale=255.0, **values)


def refused(*arguments: Any, **options: Any) -> str:
    """The one sentence in which opening is refused."""
    with pytest.raises(RecordsError) as caught:
        open_store(*arguments, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_server_that_is_killed_while_saving_has_lost_nothing_that_was_acknowledged(tmp_path: Path) -> None:
    if why := postgres_server.missing():
        pytest.skip(why)
    with postgres_server.server() as own:
        place = Place(tmp_path / "files", own.new_database())
        assert place.database is not None
        place.open().close()
        command = [sys.executable, "-m", "tests.records.writer", str(place.folder), place.database, "1", "100000"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
            assert writer.stdout is not None
            try:
                lines = [writer.stdout.readline() for _ in range(PRESSES)]
                own.kill()
                lines += writer.stdout.read().splitlines()
            finally:
                writer.kill()
        *said, last = (line.strip().split(" ", 1) for line in lines)
        assert last[0] == "refused"
        assert own.password not in last[1]
        own.start()
        acknowledged = {rest for what, rest in said if what == "press"}
        with place.open(create=False) as store:
            stored = {press.id for press in store.presses(store.target(1))}
            assert acknowledged <= stored
            assert len(stored - acknowledged) <= 1
            assert verify_store(store).sound


def test_a_server_that_stops_is_one_sentence_and_the_store_goes_on_when_it_is_back(tmp_path: Path) -> None:
    if why := postgres_server.missing():
        pytest.skip(why)
    with postgres_server.server() as own:
        place = Place(tmp_path / "files", own.new_database())
        with place.open() as store:
            target = store.add_target()
            own.stop()
            with pytest.raises(RecordsError, match="must be open to reading and writing") as caught:
                store.add_press(target, image(), taken=WHEN)
            assert "\n" not in str(caught.value)
            with pytest.raises(RecordsError, match="must be open to reading and writing"):
                store.targets()
            assert "Connection refused" in refused(place.folder, database=place.database)
            own.start()
            kept = store.add_press(target, image(), taken=WHEN)
            assert store.presses(target) == (kept,)
            assert verify_store(store).sound


def test_a_server_out_of_connections_is_one_sentence_and_an_open_store_goes_on(tmp_path: Path) -> None:
    if why := postgres_server.missing():
        pytest.skip(why)
    with postgres_server.server(max_connections="12") as own, ExitStack() as others:
        place = Place(tmp_path / "files", own.new_database())
        with place.open() as store:
            target = store.add_target()
            with suppress(psycopg.OperationalError):  # until none is left
                while True:
                    others.enter_context(own.connect())
            sentence = refused(place.folder, database=place.database)
            assert "too many clients" in sentence
            assert own.password not in sentence
            kept = store.add_press(target, image(), taken=WHEN)
            others.close()
            with place.open(create=False) as second:
                assert second.presses(second.target(1)) == (kept,)
                assert verify_store(second).sound


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"password": "not-the-secret"}, "password authentication failed"),
        ({"database": "nobody_made_it"}, 'database "nobody_made_it" does not exist'),
        ({"host": "name.invalid"}, "name.invalid"),
        ({"username": "nobody"}, "password authentication failed"),
        ({"port": 1}, "Connection refused"),
    ],
)
def test_a_server_that_lets_nobody_in_is_one_sentence_without_the_password(
    tmp_path: Path, postgres: Server, database: str, change: dict[str, Any], said: str
) -> None:
    url = make_url(database).set(**change)
    sentence = refused(tmp_path, database=url.render_as_string(hide_password=False))
    assert said in sentence
    for secret in (postgres.password, "not-the-secret"):
        assert secret not in sentence


@pytest.mark.parametrize(
    "url",
    [
        "postgresql://me:hush-hush@127.0.0.1:port/name",
        "postgresql://127.0.0.1:1/name?password=hush-hush&user=me",
        "postgresql://me:hush-hush@127.0.0.1:1/name?nonsense=hush-hush",
        "mysql://me:hush-hush@127.0.0.1/name",
        "hush-hush",
        "",
    ],
)
def test_no_message_repeats_a_password(tmp_path: Path, url: str) -> None:
    assert "hush-hush" not in refused(tmp_path, database=url)


def test_the_name_of_the_database_holds_no_password(in_postgres: Store, postgres: Server) -> None:
    assert postgres.password not in in_postgres.database.name
    assert "127.0.0.1" in in_postgres.database.name


@pytest.mark.parametrize("setting", ["fsync", "synchronous_commit"])
def test_a_server_that_does_not_sync_is_refused(tmp_path: Path, postgres: Server, setting: str) -> None:
    if setting == "synchronous_commit":
        url = postgres.new_database()
        with postgres.connect() as connection:
            connection.execute(f"ALTER DATABASE {make_url(url).database} SET synchronous_commit = off")
        assert "synchronous_commit = off" in refused(tmp_path, database=url)
    else:
        with postgres_server.server(fsync="off") as careless:
            assert "fsync = off" in refused(tmp_path, database=careless.new_database())


def test_a_database_that_cannot_hold_any_text_is_refused(tmp_path: Path, postgres: Server) -> None:
    url = postgres.new_database("ENCODING 'SQL_ASCII' TEMPLATE template0")
    assert "must be a database in UTF8" in refused(tmp_path, database=url)


def test_a_server_whose_defaults_differ_is_written_to_all_the_same(tmp_path: Path, postgres: Server) -> None:
    place = Place(tmp_path, postgres.new_database())
    defaults = {
        "default_transaction_isolation": "serializable",
        "extra_float_digits": "-15",
        "datestyle": "'German'",
        "client_encoding": "latin1",
        "standard_conforming_strings": "off",
    }
    with postgres.connect() as connection:
        for name, value in defaults.items():
            connection.execute(f"ALTER DATABASE {make_url(str(place.database)).database} SET {name} = {value}")

    def work(seed: int) -> None:
        with place.open() as store:
            target = store.add_target(name="c:\\новый 'ñ'")
            for i in range(5):
                store.add_press(target, image(10 * seed + i, force_n=1 / 3), taken=WHEN)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    with place.open() as store:
        assert [each.presses for each in store.targets()] == [5, 5, 5]
        assert {press.force_n for each in store.targets() for press in store.presses(each.target)} == {1 / 3}
        assert store.target(1).name == "c:\\новый 'ñ'"
        assert verify_store(store).sound


def test_one_who_waits_too_long_for_another_is_told(
    tmp_path: Path, database: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engines, "SESSION", ("SET lock_timeout = '200ms'",))
    with open_store(tmp_path, database=database) as store, psycopg.connect(database) as other:
        other.execute("SELECT * FROM audit_head FOR UPDATE")
        with pytest.raises(RecordsError, match="lock timeout"):
            store.add_target()
        other.rollback()
        assert store.add_target().number == 1


def test_a_folder_without_the_files_of_the_database_is_refused(tmp_path: Path, database: str) -> None:
    with open_store(tmp_path / "files", database=database) as store:
        store.add_press(store.add_target(), image(), taken=WHEN)
    assert "the folder of the store" in refused(tmp_path / "elsewhere", database=database)
    open_store(tmp_path / "files", database=database).close()


def test_nobody_waits_or_sleeps_for_ever(in_postgres: Store) -> None:
    with in_postgres.database.reading() as connection:
        for name in ("lock_timeout", "idle_in_transaction_session_timeout"):
            (value,) = connection.exec_driver_sql(f"SHOW {name}").one()
            assert value in ("30s", "1min")


@pytest.mark.parametrize("options", ["LOCALE 'en_US.utf8'", "LOCALE_PROVIDER icu ICU_LOCALE 'en-US' LOCALE 'C'"])
def test_presses_keep_their_order_whatever_the_collation(tmp_path: Path, postgres: Server, options: str) -> None:
    try:
        url = postgres.new_database(f"{options} TEMPLATE template0")
    except psycopg.Error as error:
        pytest.skip(f"this server has no such collation: {error}")
    offsets = [3600, -7200, 0, 1, -1, 86400, 2]
    listed = []
    for place in (Place(tmp_path / "a", url), Place(tmp_path / "b")):
        with place.open() as store:
            target = store.add_target()
            for seconds in offsets:
                store.add_press(target, image(), taken=WHEN + timedelta(seconds=seconds, microseconds=seconds % 7))
            listed.append([press.taken for press in store.presses(target)])
            assert verify_store(store).sound
    assert listed[0] == listed[1] == sorted(listed[0])


def test_without_its_driver_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(MissingExtraError, match=r'pip install "tsis\[postgres\]"'):
        open_store(tmp_path, database="postgresql://me@127.0.0.1/name")


@pytest.mark.parametrize("statement", ["UPDATE audit SET actor = 'x'", "DELETE FROM audit", "TRUNCATE audit"])
def test_the_audit_is_append_only(in_postgres: Store, database: str, statement: str) -> None:
    in_postgres.add_target()
    with psycopg.connect(database) as other, pytest.raises(psycopg.errors.RaiseException, match="append-only"):
        other.execute(statement)
    assert verify_store(in_postgres).sound
