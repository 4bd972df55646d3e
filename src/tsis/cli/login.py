"""``tsis login``: who may come into a console that listens on a network."""

from __future__ import annotations

import sys
from typing import Annotated

import typer
from rich.table import Table

from tsis.cli.console_output import people, print_json, print_notice
from tsis.cli.progress import waiting
from tsis.cli.targets import AsJson
from tsis.model.errors import InputError
from tsis.report.document import envelope

LONGEST_LINE = 4096

app = typer.Typer(
    name="login", help="Names and passwords for a console that listens on a network.", no_args_is_help=True
)
Name = Annotated[str, typer.Argument(metavar="NAME", help="Shown to others while its owner holds the camera.")]


@app.command(epilog="Example: tsis login add anna")
def add(*, name: Name) -> None:
    """Add a login, or give a known one another password.

    The password is asked for, or read as one line from standard input where that is no terminal. Another password
    ends the sessions that were opened with the old one.
    """
    with waiting("loading"):
        from tsis.console import Logins
    logins = Logins()
    known = name in logins.names()
    logins.require_name(name)
    logins.add(name, _password())
    told = people()
    told.print(f"{name} has another password." if known else f"{name} may log in.", markup=False)
    print_notice(told)


@app.command(epilog="Example: tsis login remove anna")
def remove(*, name: Name) -> None:
    """Remove a login; its sessions end at once."""
    with waiting("loading"):
        from tsis.console import Logins
    Logins().remove(name)
    told = people()
    told.print(f"{name} may no longer log in.", markup=False)
    print_notice(told)


@app.command(name="list", epilog="Example: tsis login list --json")
def show(*, as_json: AsJson = False) -> None:
    """List the logins of this user's console."""
    with waiting("loading"):
        from tsis.console import Logins
    logins = Logins()
    given = {name: logins.given(name) for name in logins.names()}
    if as_json:
        print_json(envelope("logins", logins=[{"name": name, "given": when} for name, when in given.items()]))
        return
    told = people()
    table = Table("name", "password of", title="Logins of this user's console")
    for name, when in given.items():
        table.add_row(name, when)
    told.print(table if given else "Nobody may log in yet; tsis login add NAME adds a login.")
    print_notice(told)


def _password() -> str:
    if not sys.stdin.isatty():
        line = sys.stdin.readline(LONGEST_LINE)
        return line.rstrip("\r\n")
    password = typer.prompt("Password", hide_input=True)
    if typer.prompt("The same again", hide_input=True) != password:
        raise InputError("password must be the same both times; got two different ones")
    return str(password)
