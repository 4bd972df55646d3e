"""What a user without the makers' libraries, or without their drivers, is told."""

from __future__ import annotations

import os
import signal
import sys
from typing import TYPE_CHECKING, Any

import pytest

from tsis.errors import MissingExtraError
from tsis.instrument.drivers import harvesters, pylon
from tsis.instrument.drivers.harvesters import Producers, interrupts_preserved, producer_files

if TYPE_CHECKING:
    from pathlib import Path

SOURCES = [
    (pylon, "pylon", "pypylon.pylon", "pypylon", pylon.PylonCamera),
    (harvesters, "genicam", "harvesters.core", "harvesters", harvesters.HarvestersCamera),
]


@pytest.mark.parametrize(("source", "name", "module", "package", "camera"), SOURCES)
def test_a_library_that_is_not_installed_is_named_with_its_cure(
    source: Any, name: str, module: str, package: str, camera: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, module, None)  # as if it were not installed
    (tmp_path / "any.cti").write_bytes(b"")
    monkeypatch.setenv("GENICAM_GENTL64_PATH", str(tmp_path))
    sentence = (
        f"the camera source {name} needs {package}, which is not installed; "
        f'install it with: python -m pip install "tsis[camera-{name}]"'
    )
    assert source.missing_requirement() == sentence
    with pytest.raises(MissingExtraError) as result:
        camera().open()
    assert str(result.value) == sentence


def test_producers_are_those_of_the_variable_in_its_order_each_once(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("b/z.cti", "b/a.cti", "b/readme.txt", "c/one.cti"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    folders = [tmp_path / "b", tmp_path / "c" / "one.cti", tmp_path / "absent", tmp_path / "c"]
    monkeypatch.setenv("GENICAM_GENTL64_PATH", os.pathsep.join([*map(str, folders), "", ""]))
    names = [str(file.relative_to(tmp_path)) for file in producer_files()]
    assert names == ["b/a.cti", "b/z.cti", "c/one.cti"]
    monkeypatch.delenv("GENICAM_GENTL64_PATH")
    assert producer_files() == ()


def test_a_producer_is_opened_once_and_closed_with_its_last_use(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    events: list[str] = []

    class Harvester:
        def __init__(self, file: Path) -> None:
            self.file = file
            events.append(f"open {file.name}")

        def reset(self) -> None:
            events.append(f"close {self.file.name}")

    monkeypatch.setattr(harvesters, "_harvester", Harvester)
    producers, one, two = Producers(), tmp_path / "1.cti", tmp_path / "2.cti"
    first = producers.take(one)
    assert producers.take(one) is first
    producers.take(two)
    producers.give_back(two)
    producers.give_back(one)
    assert events == ["open 1.cti", "open 2.cti", "close 2.cti"]
    producers.give_back(one)
    producers.take(one)
    assert events[3:] == ["close 1.cti", "open 1.cti"]


def test_a_producer_that_does_not_open_is_not_held(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    answers: list[Any] = [RuntimeError("no"), "harvester"]

    def harvester(_: Path) -> Any:
        answer = answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    monkeypatch.setattr(harvesters, "_harvester", harvester)
    producers = Producers()
    with pytest.raises(RuntimeError):
        producers.take(tmp_path)
    assert producers.take(tmp_path) == "harvester"


def test_the_programs_own_answer_to_an_interrupt_is_kept() -> None:
    before = signal.getsignal(signal.SIGINT)
    with interrupts_preserved():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    assert signal.getsignal(signal.SIGINT) is before
