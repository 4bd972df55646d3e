"""A group of commands of which one may be left out."""

from __future__ import annotations

from typing import Any

from typer.core import TyperGroup


class DefaultCommand(TyperGroup):
    """Commands of which the default one may be left out, so that ``tsis match A B`` matches two files."""

    default = ""
    alone = True  # whether nothing at all calls the default command too, and not for help

    @classmethod
    def named(cls, default: str, *, alone: bool = True) -> type[DefaultCommand]:
        """The group with that default."""
        return type("DefaultCommand", (cls,), {"default": default, "alone": alone})

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put the default command before what is neither a command nor a call for help."""
        if not args and not self.alone:
            args = ["--help"]
        if not args or args[0] not in (*self.commands, "-h", "--help"):
            args = [self.default, *args]
        return super().parse_args(ctx, args)
