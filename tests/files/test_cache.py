"""The cache gives back what was stored under the same key, or nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tsis.files.cache import cache_folder, content_key, read_cached, write_cached

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TSIS_CACHE_DIR", str(tmp_path))
    return tmp_path


def test_what_was_written_is_read(cache: Path) -> None:
    assert read_cached("kind", "key") is None
    write_cached("kind", "key", b"payload")
    assert read_cached("kind", "key") == b"payload"
    assert [path.name for path in (cache / "kind").iterdir()] == ["key"], "no temporary file is left"
    assert read_cached("other", "key") is None


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(payload=st.binary(min_size=1, max_size=200), where=st.integers(0), bit=st.integers(0, 7))
def test_one_flipped_bit_is_never_used(cache: Path, payload: bytes, where: int, bit: int) -> None:
    write_cached("kind", "key", payload)
    path = cache / "kind" / "key"
    damaged = bytearray(path.read_bytes())
    damaged[where % len(damaged)] ^= 1 << bit
    path.write_bytes(damaged)
    assert read_cached("kind", "key") is None


@pytest.mark.parametrize("kept", [0, 1, 31, 32, 35])
def test_a_truncated_file_is_never_used(cache: Path, kept: int) -> None:
    write_cached("kind", "key", b"payload")
    path = cache / "kind" / "key"
    path.write_bytes(path.read_bytes()[:kept])
    assert read_cached("kind", "key") is None


def test_a_file_of_another_key_is_never_used(cache: Path) -> None:
    write_cached("kind", "one", b"payload")
    (cache / "kind" / "one").rename(cache / "kind" / "two")
    assert read_cached("kind", "two") is None


def test_a_folder_that_cannot_be_written_is_no_error(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    taken = cache / "taken"
    taken.write_text("a file where the folder should be")
    monkeypatch.setenv("TSIS_CACHE_DIR", str(taken))
    write_cached("kind", "key", b"payload")
    assert read_cached("kind", "key") is None


def test_a_failing_disk_leaves_no_half_file(cache: Path) -> None:
    (cache / "kind" / "key").mkdir(parents=True)  # nothing can replace a folder
    write_cached("kind", "key", b"payload")
    assert [path.name for path in (cache / "kind").iterdir()] == ["key"]
    assert read_cached("kind", "key") is None


def test_an_interruption_leaves_no_half_file(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(_: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("tsis.files.atomic._sync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_cached("kind", "key", b"payload")
    assert list((cache / "kind").iterdir()) == []


def test_the_platforms_folder_is_used_when_nothing_is_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TSIS_CACHE_DIR")
    assert cache_folder().name == "tsis"


def test_keys_follow_content_and_not_order() -> None:
    assert content_key({"a": 1.0, "b": [2]}) == content_key({"b": [2], "a": 1.0})
    assert content_key({"a": 1.0}) != content_key({"a": 1.5})
