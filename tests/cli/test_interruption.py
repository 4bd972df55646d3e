"""Ctrl-C in every command, by an event and not by a time, and readers that close the pipe."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest
from tests.cli.example_walk import PROGRAM, WALK, Step, examples, prepare, surroundings
from tests.cli.test_program import parsers

if TYPE_CHECKING:
    from pathlib import Path

EXAMPLES = examples()
COMMANDS = {" ".join(words): words for words in parsers()}
LINE = re.compile(r"Interrupted[;.] [^\n]+\n")

# The program, which gets Ctrl-C at the first event of a kind: starts (the line), numpy (imported), file (a file or
# folder of the working folder is about to be opened for writing), name (a finished draft there is about to be named).
INTERRUPTED_AT = """
import os, signal, sys

event, folder, marker, *arguments = sys.argv[1:]
sys.argv[:] = ["tsis", *arguments]
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT
left = [True]

def interrupt():
    if left:
        left.clear()
        if marker:
            os.close(os.open(marker, os.O_CREAT | os.O_WRONLY))
        signal.raise_signal(signal.SIGINT)

def inside(path):
    return not isinstance(path, int) and os.path.abspath(os.fsdecode(path)).startswith(folder + os.sep)

def watch(name, values):
    if event == "numpy":
        if name == "import" and values[0] == "numpy":
            interrupt()
    elif event == "file":
        opened = name == "open" and values[2] is not None and values[2] & WRITING
        if (opened or name == "os.mkdir") and inside(values[0]):
            interrupt()
    elif event == "name" and name in ("os.rename", "os.link") and inside(values[0]):
        interrupt()

write = sys.stderr.write

def written(text):
    count = write(text)
    if text.rstrip().endswith(" starts"):
        interrupt()
    return count

if event == "starts":
    sys.stderr.write = written
else:
    sys.addaudithook(watch)
from tsis.cli import main
main()
"""


@dataclass(frozen=True)
class Stopped:
    """A command that was sent Ctrl-C at an event, unless it ended before."""

    code: int
    err: str
    reached: bool


def run_until(event: str, arguments: list[str], folder: Path, *, typed: str = "") -> Stopped:
    marker = folder.with_name(f"{folder.name}.reached")
    marker.unlink(missing_ok=True)
    finished = subprocess.run(
        [sys.executable, "-c", INTERRUPTED_AT, event, str(folder), str(marker), *arguments],
        cwd=folder,
        env=surroundings(folder),
        input=typed,
        capture_output=True,
        text=True,
        check=False,
    )
    return Stopped(finished.returncode, finished.stderr, marker.exists())


def faults_of(stopped: Stopped, before: str = "") -> list[str]:
    """What is wrong with the end of an interrupted command."""
    if not stopped.reached:
        return [] if stopped.code == 0 else [f"ended with {stopped.code} before the event: {stopped.err}"]
    faults = [] if stopped.code == 130 else [f"ended with {stopped.code}"]
    if not (stopped.err.startswith(before) and LINE.fullmatch(stopped.err.removeprefix(before))):
        faults.append(f"wrote {stopped.err!r}")
    return faults


def arguments_of(command: str) -> list[str]:
    """Its words, which an example leaves out where they are the default's, and its example's arguments."""
    example = EXAMPLES.get(command, f"tsis {command}").partition(" > ")[0]
    called, words = shlex.split(example)[1:], list(COMMANDS.get(command, command.split()))
    return [*words, *called[len(words) if called[: len(words)] == words else len(words) - 1 :]]


@pytest.mark.system
@pytest.mark.parametrize("commands", [pytest.param(list(COMMANDS), id=f"{len(COMMANDS)} commands")])
def test_ctrl_c_when_a_command_starts_is_one_line(commands: list[str], tmp_path: Path) -> None:
    faults = {}
    for command in commands:
        words = COMMANDS[command]
        arguments = [*words, "--verbose", *arguments_of(command)[len(words) :]]
        stopped = run_until("starts", arguments, tmp_path)
        assert stopped.reached, f"{command} did not start: {stopped.err}"
        if wrong := faults_of(stopped, f"tsis {command} starts\n"):
            faults[command] = wrong
        assert list(tmp_path.iterdir()) == [], command
    assert faults == {}


def contents(folder: Path) -> dict[str, str]:
    """Each file by a hash of its bytes, each folder by a slash."""
    return {
        str(path.relative_to(folder)): "/" if path.is_dir() else hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
    }


def changes(before: dict[str, str], after: dict[str, str]) -> dict[str, str]:
    """What appeared, changed and disappeared."""
    return {
        name: "new" if name not in before else "gone" if name not in after else "changed"
        for name in sorted(before.keys() | after.keys())
        if before.get(name) != after.get(name)
    }


LEFT = {  # what an interrupted command may leave, each file complete: the same command continues with it
    "calibrate guide": r"tsis-calibration-frames(/.*)?",
    "sweep run": r"data(/.*\.parquet|/manifest\.json)?",
    "login add": r"user",  # the empty folder of the user's logins
    "records import": r"records(/.*)?",
}
ENTERED = {  # what may get whole entries before the end, and the command that verifies them
    "records edit": ("records/phantoms/records.sqlite3", ["records", "verify"]),
    "records import": ("records/phantoms/records.sqlite3", ["records", "verify"]),
    "study run": ("trial/log.jsonl", ["study", "verify", "trial"]),
    "study analyse": ("trial/log.jsonl", ["study", "verify", "trial"]),
}
RECORDING = "acquire"  # Ctrl-C ends a recording, which is complete as it is
NEEDED = {  # by the commands after it
    *("demo", "acquire", "calibrate make", "detect train", "network train", "login add", "sweep example"),
    *("simulate", "sensor new", "sensor frames", "session", "depth calibrate", "records backup"),
    *("study new", "study run", "study export", "study import"),
    *("calibrate guide", "sweep run", "records import", "study analyse"),  # they continue
}


@pytest.mark.slow
@pytest.mark.parametrize("walk", [pytest.param(WALK, id=f"{len(WALK)} commands")])
def test_ctrl_c_leaves_nothing_half_written_and_the_command_can_be_repeated(
    walk: tuple[Step, ...], tmp_path: Path
) -> None:
    folder = tmp_path / "walk"
    folder.mkdir()
    prepare(folder)
    faults, events = dict[str, object](), 0
    for step in walk:
        stopped, left = None, dict[str, bytes]()
        arguments = arguments_of(step.command)
        for event in ("numpy", "file", "name") if step.command != "serve" else ("numpy",):  # which writes nothing
            before = contents(folder)
            stopped = run_until(event, arguments, folder, typed=step.typed)
            events += stopped.reached
            after = contents(folder)
            wrong: list[object] = []
            if step.command == RECORDING and stopped.reached and stopped.code == 0:
                assert json.loads((folder / "press-1" / "recording.json").read_text(encoding="utf-8"))
            else:
                wrong += faults_of(stopped)
            if stopped.code == 0:  # it is done
                break
            changed = changes(before, after)
            allowed = {name for name in changed if re.fullmatch(LEFT.get(step.command, ""), name)}
            entered, verifying = ENTERED.get(step.command, ("", []))
            if changed.get(entered) == "changed":
                assert run_until("never", verifying, folder).code == 0, f"{step.command}, {event}"
                allowed.add(entered)
            wrong += [(name, changed[name]) for name in changed.keys() - allowed]
            left |= {name: (folder / name).read_bytes() for name in allowed if (folder / name).is_file()}
            wrong += [name for name in after if name.rpartition("/")[2].startswith(".") or "unfinished" in name]
            if wrong:
                faults[f"{step.command}, {event}"] = wrong
            if resumed := re.search(r"Resume with: tsis (.*)\n", stopped.err):
                arguments = shlex.split(resumed[1])
        assert stopped is not None
        if step.command in NEEDED and (stopped.code or step.command == "sweep example"):
            finish(step, arguments, folder)
            faults |= {
                f"{step.command}, {name}": "was half-written"
                for name, content in left.items()
                if not name.startswith("records/") and not (folder / name).read_bytes().startswith(content)
            }
    assert faults == {}
    assert events >= 2 * len(walk)


def finish(step: Step, arguments: list[str], folder: Path) -> None:
    """Run a command to its end; it writes what it names."""
    finished = subprocess.run(
        [sys.executable, "-c", PROGRAM, *arguments],
        cwd=folder,
        env=surroundings(folder),
        input=step.typed,
        capture_output=True,
        text=True,
        check=False,
    )
    assert finished.returncode == 0, f"{step.command}\n{finished.stderr}"
    if file := EXAMPLES[step.command].partition(" > ")[2]:
        (folder / file).write_text(finished.stdout, encoding="utf-8")
    for pattern in step.writes:
        assert any(path.stat().st_size for path in folder.glob(pattern) if path.is_file()), f"{step.command}: {pattern}"


READERS = (
    ("records", "list", "--store", "lab-records", "--json"),
    ("simulate", "--list"),
    ("optics", "modes", "--json"),
    ("doctor", "--no-cameras"),
)
# Each page of help in a process of its own, whose standard output nobody reads; one start for all of them.
CLOSED_PIPES = """
import json, os, sys
from tsis.cli import main

for words in json.loads(sys.argv[1]):
    reader, writer = os.pipe()
    os.close(reader)
    child = os.fork()
    if not child:
        os.dup2(writer, 1)
        sys.argv[:] = ["tsis", *words, "--help"]
        main()
    os.close(writer)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.system
@pytest.mark.skipif(not hasattr(os, "fork"), reason="starts its processes by fork")
@pytest.mark.parametrize("commands", [pytest.param(list(COMMANDS.values()), id=f"{len(COMMANDS)} commands")])
def test_help_that_nobody_reads_is_no_error(commands: list[tuple[str, ...]], tmp_path: Path) -> None:
    finished = subprocess.run(
        [sys.executable, "-c", CLOSED_PIPES, json.dumps([[], *commands])],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert finished.stderr == ""
    assert finished.stdout.split() == ["1"] * (len(commands) + 1)  # as an output that cannot be written


@pytest.mark.system
@pytest.mark.parametrize("words", READERS, ids=" ".join)
def test_a_reader_of_one_line_is_no_error(words: tuple[str, ...], tmp_path: Path) -> None:
    prepare(tmp_path)
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *words],
        cwd=tmp_path,
        env=surroundings(tmp_path),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode in (0, 1)  # 0 where all was written before
