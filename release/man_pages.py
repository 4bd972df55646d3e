"""Man pages of the program and of each command, made from their help: ``python -m release.man_pages build/man``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer.main

from tsis.__about__ import __version__
from tsis.cli.app import HELP, app

if TYPE_CHECKING:
    from collections.abc import Iterator


def pages() -> Iterator[tuple[str, str]]:
    """File name and content of each page."""
    program: Any = typer.main.get_command(app)
    yield "tsis.1", _page(["tsis"], "open software for optical tactile imaging", _plain(HELP), [])
    for name in program.commands:
        yield from _of_command(["tsis", name], program.commands[name])


def _of_command(words: list[str], command: Any) -> Iterator[tuple[str, str]]:
    example, _, text = (command.help or "").partition("\n\n")
    if not text:
        example, text = "", example
    title = (command.short_help or text).split("\n\n")[0]
    options = [option for option in command.params if not getattr(option, "hidden", False)]
    yield f"{'-'.join(words)}.1", _page(words, title, [*_plain(text), ".SH EXAMPLE", *_plain(example)], options)
    for name, part in getattr(command, "commands", {}).items():
        yield from _of_command([*words, name], part)


def _page(words: list[str], title: str, body: list[str], options: list[Any]) -> str:
    """A page in roff."""
    name = "-".join(words)
    lines = [f'.TH {name.upper()} 1 "" "tsis {__version__}"', ".SH NAME", f"{name} \\- {_escaped(title)}"]
    lines += [".SH SYNOPSIS", f".B {' '.join(words)}", "[OPTIONS] [ARGUMENTS]", ".SH DESCRIPTION", *body]
    if options:
        lines.append(".SH OPTIONS")
    for option in options:
        lines += [".TP", f"\\fB{_escaped(', '.join(option.opts))}\\fR", *_plain(getattr(option, "help", "") or "")]
    return "\n".join(lines) + "\n"


def _plain(text: str) -> list[str]:
    """Lines of text, with its paragraphs kept."""
    return [".PP" if not line.strip() else _escaped(line.strip()) for line in text.strip().splitlines()]


def _escaped(text: str) -> str:
    escaped = " ".join(text.split()).replace("\\", "\\e").replace("-", "\\-")
    return f"\\&{escaped}" if escaped.startswith((".", "'")) else escaped


def main(folder: Path) -> None:
    """Write the pages below ``folder / "man1"``."""
    target = folder / "man1"
    target.mkdir(parents=True, exist_ok=True)
    count = 0
    for name, content in pages():
        (target / name).write_text(content, encoding="utf-8")
        count += 1
    print(f"{target}: {count} pages")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
