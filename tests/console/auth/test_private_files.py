"""Secrets in files: nobody else reads them, whatever happens while they are written."""

from __future__ import annotations

import errno
import os
import stat
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import pytest

from tsis.console.auth import FOLDER, TOKEN_FILE, console_folder, read_private, saved_token, write_private
from tsis.errors import FileInputError

if TYPE_CHECKING:
    from pathlib import Path

posix = pytest.mark.skipif(os.name != "posix", reason="modes of files say nothing here")


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


@posix
def test_a_secret_is_its_owners_alone_whatever_the_mask(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        write_private(tmp_path / "new" / "secret", b"hush")
    finally:
        os.umask(before)
    assert mode(tmp_path / "new") == 0o700
    assert mode(tmp_path / "new" / "secret") == 0o600
    assert read_private(tmp_path / "new" / "secret") == b"hush"


@posix
@pytest.mark.parametrize("bits", [0o640, 0o604, 0o620, 0o602, 0o777])
def test_a_secret_that_others_could_read_or_write_is_refused_with_a_cure(tmp_path: Path, bits: int) -> None:
    path = tmp_path / "secret"
    write_private(path, b"hush")
    path.chmod(bits)
    with pytest.raises(FileInputError, match=rf"owner alone; got mode {bits:04o} \(chmod 600"):
        read_private(path)


@posix
def test_links_and_folders_are_no_secrets(tmp_path: Path) -> None:
    write_private(tmp_path / "secret", b"hush")
    (tmp_path / "link").symlink_to(tmp_path / "secret")
    (tmp_path / "folder").mkdir()
    for name in ("link", "folder"):
        with pytest.raises(FileInputError, match="must be a"):
            read_private(tmp_path / name)


def test_a_disk_that_fails_while_a_secret_is_read_is_said_in_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(*_: object) -> bytes:
        raise OSError(errno.EIO, "Input/output error")

    write_private(tmp_path / "secret", b"hush")
    monkeypatch.setattr(os, "read", failing)
    with pytest.raises(FileInputError, match="secret must be a file that can be read; got: Input/output error"):
        read_private(tmp_path / "secret")


def test_what_cannot_be_written_is_said_in_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(FileInputError, match=FOLDER):
        write_private(tmp_path / "file" / "secret", b"hush")


def test_the_folder_may_be_chosen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    assert console_folder() == tmp_path
    monkeypatch.delenv(FOLDER)
    assert console_folder().name == "console"


def test_the_key_stays_until_another_is_asked_for(tmp_path: Path) -> None:
    first = saved_token(folder=tmp_path)
    assert saved_token(folder=tmp_path) == first
    assert saved_token(folder=tmp_path / "other") != first
    second = saved_token(new=True, folder=tmp_path)
    assert second != first
    assert saved_token(folder=tmp_path) == second


def test_consoles_that_start_together_have_one_key(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        tokens = set(pool.map(lambda _: saved_token(folder=tmp_path), range(32)))
    assert len(tokens) == 1


@pytest.mark.parametrize("content", [b"", b"short", b"\xff" * 43, b"x" * 44, b"x" * 5000])
def test_a_damaged_key_is_named_with_its_cure(tmp_path: Path, content: bytes) -> None:
    write_private(tmp_path / TOKEN_FILE, content)
    with pytest.raises(FileInputError, match="--new-token makes another"):
        saved_token(folder=tmp_path)
    assert saved_token(new=True, folder=tmp_path)
