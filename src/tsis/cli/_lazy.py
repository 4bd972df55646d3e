"""Commands that are imported when they are called, so that ``tsis --help`` loads no numerical library."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command, get_group


@dataclass(frozen=True, slots=True)
class CommandEntry:
    """A command or group of commands that is not yet imported.

    Attributes
    ----------
    module, attribute
        Location of the command's function, or of the group's `typer.Typer`.
    summary
        Its line in ``tsis --help``: the first paragraph of its own help.
    example
        Command line at the end of a command's help; a group has its own.
    """

    module: str
    attribute: str
    summary: str
    example: str = ""


class LoadedCommands(Mapping[str, Any]):
    """Parsers of commands by name, each imported when it is looked up."""

    def __init__(self, entries: Mapping[str, CommandEntry]) -> None:
        self._entries = entries
        self._loaded = dict[str, Any]()

    def __getitem__(self, name: str) -> Any:
        if name not in self._loaded:
            self._loaded[name] = _parser(name, self._entries[name])
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)


def _parser(name: str, entry: CommandEntry) -> Any:
    result = getattr(import_module(entry.module), entry.attribute)
    if isinstance(result, typer.Typer):
        return get_group(result)
    single = typer.Typer(add_completion=False)
    single.command(name, epilog=f"Example: {entry.example}")(result)
    return get_command(single)


class LazyCommands(TyperGroup):
    """A group whose ``commands`` are imported one by one; its help shows only their summaries."""

    entries: Mapping[str, CommandEntry] = {}

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = LoadedCommands(self.entries)  # type: ignore[assignment] # read-only

    @classmethod
    def of(cls, entries: Mapping[str, CommandEntry]) -> type[LazyCommands]:
        """The group with these commands."""
        return type("LazyCommands", (cls,), {"entries": entries})

    def list_commands(self, ctx: Any) -> list[str]:
        """Names of the commands, in their order."""
        return list(self.entries)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """A command for help and completion: its name and summary."""
        entry = self.entries.get(cmd_name)
        return None if entry is None else TyperCommand(name=cmd_name, help=entry.summary)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the first argument names, imported now."""
        if args and args[0] in self.entries:
            return args[0], self.commands[args[0]], args[1:]
        return super().resolve_command(ctx, args)
