"""How the commands are found, imported when they are called."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import KW_ONLY, dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command, get_group

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.cli.progress import verbosity

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass(frozen=True, slots=True)
class CommandEntry:
    """A command or group of commands that is not yet imported.

    Attributes
    ----------
    module, attribute
        Location of the command's function, or of the group's `typer.Typer`.
    summary
        Help of a group; that of a command is the docstring of its function.
    example
        Command line at the start of a command's help; the commands of a group have theirs.
    """

    module: str
    attribute: str
    _: KW_ONLY
    summary: str = ""
    example: str = ""

    def short_help(self) -> str:
        """The summary, or the first paragraph of the docstring, read without importing the module."""
        if self.summary:
            return self.summary
        spec = find_spec(self.module)
        source = "" if spec is None or spec.origin is None else Path(spec.origin).read_text(encoding="utf-8")
        found = re.search(rf'^def {self.attribute}\(.*?^    """(.+?)(?:\n\n|""")', source, re.DOTALL | re.MULTILINE)
        return "" if found is None else " ".join(found[1].split())


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
        group = get_group(result)
        group.help = f"{entry.summary} {RESEARCH_USE_ONLY}"
        return _finished(group)
    single = typer.Typer(add_completion=False)
    single.command(name, epilog=f"Example: {entry.example}")(result)
    return _finished(get_command(single))


def _finished(command: Any) -> Any:
    """The command and its commands: the help begins with the example, and all have the common options."""
    for part in getattr(command, "commands", {}).values():
        _finished(part)
    if command.epilog:
        command.short_help = (command.help or "").split("\n\n")[0]
        command.help, command.epilog = f"{command.epilog}\n\n{command.help or ''}", None
    if not hasattr(command, "commands"):
        command.params += common_options()
    return command


class LazyCommands(TyperGroup):
    """A group whose ``commands`` are imported one by one; its help is a text that imports none."""

    entries: Mapping[str, CommandEntry] = {}
    text = ""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = LoadedCommands(self.entries)  # type: ignore[assignment] # read-only

    @classmethod
    def of(cls, entries: Mapping[str, CommandEntry], text: str) -> type[LazyCommands]:
        """The group with these commands and this help."""
        return type("LazyCommands", (cls,), {"entries": entries, "text": text})

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help of the program."""
        formatter.write(self.text)

    def list_commands(self, ctx: Any) -> list[str]:
        """Names of the commands, in their order."""
        return list(self.entries)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """A command for help and completion: its name and summary."""
        entry = self.entries.get(cmd_name)
        return None if entry is None else TyperCommand(name=cmd_name, help=entry.short_help())

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the first argument names, imported now."""
        if args and args[0] in self.entries:
            return args[0], self.commands[args[0]], args[1:]
        return super().resolve_command(ctx, args)


def common_options() -> list[Any]:
    """The options ``--quiet`` and ``--verbose``, which every command has."""
    template = typer.Typer(add_completion=False)
    template.command()(_common)
    return list(get_command(template).params)


def _be_quiet(requested: bool) -> None:
    verbosity.quiet |= requested


def _be_verbose(context: typer.Context, requested: bool) -> None:
    verbosity.verbose |= requested
    if requested:
        typer.echo(f"{context.command_path} starts", err=True)


def _common(
    *,
    _quiet: Annotated[
        bool,
        typer.Option("--quiet", "-q", help="Show no progress and no warnings.", callback=_be_quiet, expose_value=False),
    ] = False,
    _verbose: Annotated[
        bool,
        typer.Option(
            "--verbose",
            "-v",
            help="Say on standard error what starts, and where an error arose.",
            callback=_be_verbose,
            expose_value=False,
        ),
    ] = False,
) -> None:
    """Hold the options."""


class DefaultCommand(TyperGroup):
    """Commands with a default: ``tsis match A B`` runs ``tsis match points A B``."""

    default = ""
    is_default = True  # whether an empty command line runs it, instead of showing help

    @classmethod
    def named(cls, default: str, *, is_default: bool = True) -> type[DefaultCommand]:
        """The group with that default."""
        return type("DefaultCommand", (cls,), {"default": default, "is_default": is_default})

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Insert the default command before arguments that begin with no command."""
        if not args and not self.is_default:
            args = ["--help"]
        if not args or args[0] not in (*self.commands, "-h", "--help"):
            args = [self.default, *args]
        return super().parse_args(ctx, args)
