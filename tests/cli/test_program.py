from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from functools import cache
from typing import TYPE_CHECKING, Any

import pytest
import typer.main

import tsis
from tsis.cli.app import COMMANDS, app
from tsis.records.store import open_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tests.cli.conftest import RunTsis


@pytest.mark.parametrize("command", ["demo", "examine", "simulate"])
def test_help_shows_an_example(run_tsis: RunTsis, command: str) -> None:
    finished = run_tsis(command, "--help")
    assert finished.code == 0
    assert f"Example: tsis {command}" in " ".join(finished.out.split())
    assert "--json" in finished.out


def test_version(run_tsis: RunTsis) -> None:
    assert run_tsis("--version").out.strip() == f"tsis {tsis.__version__}"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["demo", "--dept-mm", "3"], "No such option: --dept-mm"),
        (["demo", "--seed", "-1"], "--seed"),
        (["demo", "--force-n", "abc"], "--force-n"),
        (["examine"], "FRAME"),
        (["press"], "No such command 'press'"),
    ],
)
def test_a_wrong_option_is_one_sentence(run_tsis: RunTsis, arguments: list[str], sentence: str) -> None:
    finished = run_tsis(*arguments)
    assert finished.code == 2
    assert finished.err.startswith("Error: ")
    assert sentence in finished.err
    assert finished.err.count("\n") == 1


def test_an_interrupt_is_said(run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("tsis.inclusion.estimate", interrupted)
    finished = run_tsis("demo", "--strain", "small")
    assert finished.code == 130
    assert finished.err == "Interrupted; no incomplete file remains.\n"
    assert list(tmp_path.iterdir()) == []


def leaves(parser: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Each command by the words that call it."""
    if hasattr(parser, "commands"):
        for name in parser.commands:
            yield from leaves(parser.commands[name], (*words, name))
    else:
        yield words, parser


@cache
def parsers() -> dict[tuple[str, ...], Any]:
    return dict(leaves(typer.main.get_command(app)))


def test_the_help_of_the_program_is_one_page_with_each_command_once(run_tsis: RunTsis) -> None:
    text = run_tsis("--help").out
    assert len(text.splitlines()) <= 20
    rows = [line[13:].split(", ") for line in text.splitlines() if re.match(r"  [a-z]+ +[a-z]+(, |$)", line)]
    assert sorted(name for row in rows for name in row) == sorted(COMMANDS)
    headings = [line.split()[0] for line in text.splitlines() if re.match(r"  [a-z]", line)]
    assert headings == ["measure", "calibrate", "simulate", "records", "console"]
    assert text.count("Research use only") == 1


@pytest.mark.parametrize("words", sorted(parsers()), ids=" ".join)
def test_the_help_of_each_command_starts_with_an_example_that_parses(words: tuple[str, ...]) -> None:
    parser = parsers()[words]
    example, _, text = parser.help.partition("\n\n")
    assert text.strip()
    assert example.startswith("Example: tsis ")
    called = shlex.split(example.removeprefix("Example: tsis ").partition(" > ")[0])
    named = words if called[: len(words)] == list(words) else words[:-1]  # the default command needs no name
    assert called[: len(named)] == list(named)
    parser.make_context("tsis", called[len(named) :])  # which raises where an option is unknown or absent


@pytest.mark.parametrize("words", sorted(parsers()), ids=" ".join)
def test_options_are_named_alike(words: tuple[str, ...]) -> None:
    options = {name for parameter in parsers()[words].params for name in parameter.opts if name.startswith("--")}
    assert {"--quiet", "--verbose"} <= options
    assert options.isdisjoint({"--output", "--folder", "--keep", "--force", "--newton", "--random-seed", "--silent"})


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_completion_shows_the_first_sentence_of_the_help(name: str) -> None:
    parser: Any = typer.main.get_command(app)
    own = parser.commands[name]
    assert own.name == name
    summary = parser.get_command(None, name).help
    assert len(summary) > 10
    assert summary in " ".join(own.help.split())


HEAVY = (
    "numba",
    "cv2",
    "scipy",
    "sqlalchemy",
    "nicegui",
    "matplotlib",
    "skimage",
    "sklearn",
    "statsmodels",
    "pandas",
    "xarray",
)


@pytest.mark.system
@pytest.mark.parametrize(
    "code",
    ["import tsis", "main('--version')", "main('--help')", "main()", "[main(*words, '--help') for words in COMMANDS]"],
)
def test_a_start_imports_no_numerical_library(code: str) -> None:
    program = f"""
import sys

COMMANDS = {list(parsers())}

def main(*arguments):
    from tsis.cli import main
    sys.argv = ["tsis", *arguments]
    try:
        main()
    except SystemExit as stop:
        assert not stop.code

{code}
print([name for name in {HEAVY} if name in sys.modules])
"""
    finished = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert finished.stdout.splitlines()[-1] == "[]"


def test_without_a_command_help_is_shown(run_tsis: RunTsis) -> None:
    finished = run_tsis()
    assert finished.code == 0
    assert "tsis demo" in finished.out


@pytest.mark.system
def test_the_installed_program_prints_no_traceback(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tsis", "contacts", "absent.png"]
    finished = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert finished.returncode == 2
    assert "Traceback" not in finished.stderr
    assert "absent.png" in finished.stderr


@pytest.mark.system
def test_importing_loads_no_room_and_touches_nothing(tmp_path: Path) -> None:
    code = "import sys, tsis; print(sorted(name for name in sys.modules if name.startswith(('cv2', 'matplotlib'))))"
    finished = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=60
    )
    assert finished.stdout.strip() == "[]"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.system
@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_a_terminal_of_few_letters_shows_the_others_by_their_number(tmp_path: Path, encoding: str) -> None:
    with open_store(tmp_path) as store:
        store.add_target(name="Größe 😀")
    program = "from tsis.cli import main; main()"
    finished = subprocess.run(
        [sys.executable, "-c", program, "records", "list", "--store", str(tmp_path)],
        env={**os.environ, "PYTHONIOENCODING": encoding},
        capture_output=True,
        check=False,
    )
    assert finished.returncode == 0, finished.stderr
    assert rb"\U0001f600" in finished.stdout


@pytest.mark.system
def test_an_interruption_while_the_program_loads_is_one_sentence() -> None:
    program = "import signal, sys; from tsis.cli import main; sys.meta_path.insert(0, I()); main()"
    interrupt = "class I:\n def find_spec(self, name, *_):\n  if name == 'typer': signal.raise_signal(signal.SIGINT)\n"
    finished = subprocess.run([sys.executable, "-c", interrupt + program], capture_output=True, text=True, check=False)
    assert (finished.returncode, finished.stderr) == (130, "Interrupted; no incomplete file remains.\n")
