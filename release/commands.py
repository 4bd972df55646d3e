"""What pages tell a reader to type: every command of ``tsis``, its options, and names that code of pages imports."""

from __future__ import annotations

import ast
import importlib
import re
import shlex
from typing import TYPE_CHECKING, Any

import typer.main
from release.links import PAGES

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

BLOCK = re.compile(r"^```(console|python)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
PROMPT = "$ "
ENDS = ("|", ">", ">>", "2>", "&&", ";", "#", "&")  # of a command in a shell's line


def faults(root: Path) -> list[str]:
    """Sentences about commands, options and names that do not exist, page by page."""
    app = typer.main.get_command(_app())
    found = []
    for pattern in PAGES:
        for page in sorted(root.glob(pattern)):
            for kind, text in BLOCK.findall(page.read_text(encoding="utf-8")):
                told = _of_console(text, app) if kind == "console" else _of_code(text)
                found += [f"{page.relative_to(root)}: {fault}" for fault in told]
    return found


def _app() -> typer.Typer:
    return importlib.import_module("tsis.cli.app").app  # type: ignore[no-any-return]


def commands(text: str) -> Iterator[list[str]]:
    """Words after ``tsis`` of each command of a console block."""
    for line in text.replace("\\\n", " ").splitlines():
        if not line.startswith(PROMPT):
            continue
        words = shlex.split(line.removeprefix(PROMPT), comments=True)
        for place, word in enumerate(words):
            if word.rsplit("/", 1)[-1] == "tsis" and (
                place == 0 or words[place - 1] in ENDS or "=" in words[place - 1]
            ):
                rest = words[place + 1 :]
                end = next((at for at, each in enumerate(rest) if each in ENDS), len(rest))
                yield rest[:end]


def _of_console(text: str, app: Any) -> Iterator[str]:
    for words in commands(text):
        fault = _fault(words, app)
        if fault:
            yield f"tsis {' '.join(words)}: {fault}"


def _fault(words: list[str], command: Any) -> str:
    """What is wrong with the words after a command; empty where nothing is."""
    below: dict[str, Any] = getattr(command, "commands", {})
    default = getattr(command, "default", "")  # of the groups of which one command may be left out
    if words and words[0] in below:
        return _fault(words[1:], below[words[0]])
    if default and words:
        return _fault(words, below[default])
    if below and words and not words[0].startswith("-"):
        return f"there is no command {words[0]!r}"
    known = {name for each in command.params for name in (*each.opts, *each.secondary_opts)} | {"--help"}
    unknown = [word for word in words if word.startswith("--") and word.partition("=")[0] not in known]
    return f"there is no option {', '.join(unknown)}" if unknown else ""


def _of_code(text: str) -> Iterator[str]:
    if ">>>" in text:  # which are run
        return
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "tsis":
            room = importlib.import_module(str(node.module))
            for name in node.names:
                if not hasattr(room, name.name) and not _is_room(f"{node.module}.{name.name}"):
                    yield f"{node.module} has no {name.name}"


def _is_room(name: str) -> bool:
    try:
        importlib.import_module(name)
    except ImportError:
        return False
    return True
