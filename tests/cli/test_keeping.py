"""``--save``: what is wrong is said before anything is computed, and what cannot be kept is not lost."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from tests.cli.kept_demo import FORCES, FRAMES, KNOWN
from tests.records.folders import save

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import RecordsError
from tsis.files.atomic import Disk
from tsis.records.store import Store, open_store, verify_store

if TYPE_CHECKING:
    from tests.cli.conftest import RunTsis


def full_disk(monkeypatch: pytest.MonkeyPatch, *, after: int) -> None:
    """A store whose disk takes only so many frames."""
    whole, written = Disk.write, list[object]()

    def write(self: Disk, file: Any, content: bytes) -> None:
        if content.startswith(b"\x89PNG") and "records" in file.name:
            written.append(file)
            if len(written) > after:
                raise OSError(28, "No space left on device")
        whole(self, file, content)

    monkeypatch.setattr(Disk, "write", write)


@pytest.mark.parametrize("after", [pytest.param(0, marks=pytest.mark.slow), 1])
def test_a_store_that_takes_nothing_loses_no_result(
    run: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, after: int
) -> None:
    store, out = ("--store", tmp_path / "records"), tmp_path / "examined"
    full_disk(monkeypatch, after=after)
    finished = run("examine", *FRAMES, *KNOWN, *FORCES, "--save", *store, "--out", out, "--json")
    assert finished.code == 1
    assert f"Error: the results are in {out}, but they could not be kept: " in finished.err
    assert "No space left on device" in finished.err
    assert finished.err.count("\n") == 1
    document = json.loads(finished.out)
    assert "kept" not in document
    assert document.pop("folder") == str(out)
    assert json.loads((out / "result.json").read_text()) == document
    with open_store(tmp_path / "records") as records:
        assert records.targets() == ()
        assert verify_store(records).sound


def test_an_estimate_that_finds_no_room_leaves_its_presses_and_says_where(
    run: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: Any, **__: Any) -> None:
        raise RecordsError("no room for it")

    monkeypatch.setattr(Store, "add_estimate", refused)
    store = ("--store", tmp_path / "records")
    finished = run("examine", *FRAMES, *KNOWN, *FORCES, "--save", *store, "--out", tmp_path / "examined")
    assert finished.code == 1
    assert "no room for it; 2 of 2 presses are stored in target 1" in finished.err
    assert RESEARCH_USE_ONLY in " ".join(finished.out.split())


def test_a_snapshot_that_is_not_kept_stays_and_is_named(
    run: RunTsis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save(tmp_path / "camera", 1)
    raw = next((tmp_path / "camera").glob("*/*-raw.*"))
    frames = tmp_path / "frames"
    frames.mkdir()
    shutil.copy(raw, frames)
    full_disk(monkeypatch, after=0)
    snapshot = ("acquire", "--camera", f"files:{frames}", "--out", tmp_path, "--json")
    finished = run(*snapshot, "--save", "--store", tmp_path / "records")
    assert finished.code == 1
    assert f"the results are in {tmp_path / 'Target1'}, but they could not be kept" in finished.err
    files = json.loads(finished.out)["files"]
    assert all(Path(file).is_file() for file in files.values())
    with open_store(tmp_path / "records") as records:
        assert records.targets() == ()


def test_a_name_that_no_store_takes_is_refused_before_anything_is_computed(run: RunTsis, tmp_path: Path) -> None:
    longest = tmp_path / f"{'a' * 205}.png"
    shutil.copy(FRAMES[0], longest)
    finished = run("examine", longest, *KNOWN, "--force-n", "1", "--save", "--store", tmp_path / "records")
    assert finished.code == 2
    assert "must have at most 200 characters, to be saved" in finished.err
    assert not (tmp_path / "records").exists()
    assert not (tmp_path / "tsis-examine").exists()


def test_colours_are_refused_before_anything_is_computed(run: RunTsis, tmp_path: Path) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (492, 768, 3)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "colour.png"), noise)
    colour = tmp_path / "colour.png"
    finished = run("examine", colour, *KNOWN, "--force-n", "1", "--save", "--store", tmp_path / "records")
    assert finished.code == 2
    assert "save it as a grey PNG file" in finished.err
    assert not (tmp_path / "records").exists()


OTHER_CODES = {"result.json": 1}  # of messages that are no wrong input


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("demo", "--store", "x"), "--store needs --save"),
        (("demo", "--target", "3"), "--target needs --save"),
        (("demo", "--save", "--target", "0"), "--target"),
        (("demo", "--save", "--store", "demo/result.json/below"), "result.json"),
        (("examine", FRAMES[0], "--save"), "an estimate needs the calibration of the probe"),
        (("hardness", "--demo", "--kind", "subject"), "--kind needs --save"),
        (("hardness", "--demo", "--save", "--kind", "person"), "no kind of store is called 'person'"),
        (("acquire", "--save", "--frames", "2"), "tsis records import"),
        (("acquire", "--save", "--role", "palin"), "did you mean 'plain'"),
        (("acquire", "--store", "x"), "--store needs --save"),
    ],
)
def test_keeping_says_what_is_wrong_before_anything_is_pressed(
    run: RunTsis, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, arguments: tuple[str, ...], sentence: str
) -> None:
    monkeypatch.setenv("TSIS_RECORDS_DIR", str(tmp_path))
    finished = run(*arguments)
    assert finished.code == next((code for text, code in OTHER_CODES.items() if text in sentence), 2)
    assert sentence in finished.err
    assert finished.err.count("\n") == 1
