"""Who else on the machine can read a store."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import warnings
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tsis.errors import RecordsWarning
from tsis.model.image import TactileImage
from tsis.records.store import open_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytestmark = pytest.mark.skipif(os.name != "posix", reason="modes of files say something on POSIX systems only")


@pytest.fixture(autouse=True)
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


def filled(folder: Path) -> None:
    """A store with a press, the write-ahead log of its database still there."""
    with open_store(folder, kind="subject") as store:
        target = store.add_target()
        store.add_press(target, TactileImage(grey=np.full((4, 5), 7.0)), taken=datetime(2026, 1, 2, tzinfo=UTC))


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


def test_new_store_warns_of_nothing(tmp_path: Path) -> None:
    filled(tmp_path / "store")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        open_store(tmp_path / "store", kind="subject").close()


@pytest.mark.system
def test_open_modes_of_an_old_store_are_warned_of_with_a_command_that_mends_them(tmp_path: Path) -> None:
    folder = tmp_path / "of a laboratory"
    filled(folder)
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


def test_open_modes_are_warned_of_once(tmp_path: Path) -> None:
    filled(tmp_path / "store")
    for folder in (tmp_path / "store", tmp_path / "store" / "files"):
        folder.chmod(0o755)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        for _ in range(3):
            open_store(tmp_path / "store", kind="subject").close()
    assert len(caught) == 1


@pytest.mark.system
def test_command_line_warns_in_one_line_and_goes_on(tmp_path: Path) -> None:
    filled(tmp_path / "store")
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
