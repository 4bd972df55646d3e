"""``tsis match``: correspondence of two point sets, and a benchmark of the methods."""

from __future__ import annotations

import typer

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.cli._groups import DefaultCommand
from tsis.cli.match._bench import benchmark
from tsis.cli.match._points import points

DEFAULT = "points"

app = typer.Typer(
    name="match",
    cls=DefaultCommand.named(DEFAULT, is_default=False),
    help=(
        "Match two point files: tsis match A B. Write ./bench for a file with the name of a command below. "
        f"{RESEARCH_USE_ONLY}"
    ),
    epilog="Example: tsis match before.csv after.csv --figure match.png",
)
app.command(DEFAULT, epilog="Example: tsis match before.csv after.ply --out moved.csv --figure moved.png")(points)
app.command(
    "bench",
    epilog="Example: tsis match bench --families noise --methods tprl,cpd --trials 1 --out matching",
)(benchmark)
