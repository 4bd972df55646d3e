"""``tsis match``: which point of one set belongs to which of another, and how well the methods find it."""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperGroup

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.cli.match.bench import bench
from tsis.cli.match.points import points

DEFAULT = "points"


class FilesWithoutACommand(TyperGroup):
    """Commands of which the default one may be left out, so that ``tsis match A B`` matches two files."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put the default command before what is neither a command nor a call for help; nothing is one, too."""
        args = args or ["--help"]
        if args[0] not in (*self.commands, "-h", "--help"):
            args = [DEFAULT, *args]
        return super().parse_args(ctx, args)


app = typer.Typer(
    name="match",
    cls=FilesWithoutACommand,
    help=(
        "Match two point files: tsis match A B. A file that is called as a command below is given as ./bench. "
        f"{RESEARCH_USE_ONLY}"
    ),
    epilog="Example: tsis match before.csv after.csv --figure match.png",
)
app.command(DEFAULT, epilog="Example: tsis match before.csv after.ply --out moved.csv --figure match.png")(points)
app.command(
    "bench",
    epilog="Example: tsis match bench --families noise,outliers --methods tprl,cpd --trials 5 --out matching",
)(bench)
