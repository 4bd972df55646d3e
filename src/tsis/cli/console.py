"""``tsis console``, ``tsis login``, ``tsis serve``: servers.

The console is imported by name when a command runs: the two user interfaces do not depend on each other.
"""

from __future__ import annotations

import gc
import signal
import sys
from contextlib import ExitStack, closing, contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.__about__ import LARGEST_SEED
from tsis.cli.options import AsJson, DepthMm, DiameterMm, ForceN, PhantomName, ProbeName, YoungKpa
from tsis.cli.output import print_json
from tsis.cli.progress import ended_by, waiting
from tsis.cli.saving import PHANTOM, StoreDatabase, StoreFolder, StoreKind
from tsis.errors import CameraError, InputError
from tsis.present.page import Table
from tsis.present.terminal import people, print_notice, rich_table

if TYPE_CHECKING:
    from collections.abc import Iterator


LONGEST_LINE = 4096

login = typer.Typer(name="login", no_args_is_help=True)
Name = Annotated[str, typer.Argument(metavar="NAME", help="Login name; others see who controls the camera.")]


def console(
    *,
    camera: Annotated[
        str, typer.Option(help="virtual, or SOURCE:ID as tsis acquire --list shows it; the page can change it.")
    ] = "virtual",
    probe: ProbeName = "tsis-domed",
    phantom: PhantomName = "hardness-100",
    seed: Annotated[int, typer.Option(help="Seed of the virtual probe's errors.", min=0, max=LARGEST_SEED)] = 4,
    calibration: Annotated[
        Path | None, typer.Option(help="Active calibration file.", show_default="the virtual probe's own")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of snapshots and sequences; created when missing.")] = Path(
        "tsis-console"
    ),
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    host: Annotated[
        str, typer.Option(help="Address to listen on; an address open to others needs a certificate and a login.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port to listen on; 0 is any free one.", min=0, max=65535)] = 8642,
    certificate: Annotated[Path | None, typer.Option(help="Certificate of this machine (PEM), with its chain.")] = None,
    key: Annotated[Path | None, typer.Option(help="Private key of the certificate (PEM).")] = None,
    allow_host: Annotated[
        list[str] | None,
        typer.Option("--allow-host", metavar="NAME", help="Host name that is accepted; repeatable."),
    ] = None,
    new_token: Annotated[
        bool, typer.Option("--new-token", help="Create a new key: open pages and scripts need the new address.")
    ] = False,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")] = True,
    as_json: AsJson = False,
) -> None:
    """Open the console: show a camera or the virtual probe, save presses, estimate, calibrate, report.

    It listens on this machine only, unless --host is given. The printed address contains the access key.
    Ctrl-C ends it.
    """
    if (certificate is None) != (key is None):
        raise InputError("certificate and key must be given together; got one of them (--certificate FILE --key FILE)")
    with ExitStack() as preparing, ExitStack() as ending:
        preparing.enter_context(waiting("preparing the console"))
        preparing.enter_context(loading())
        solver = ending.enter_context(closing(import_module("tsis.console.worker").solving_process()))
        if camera == "virtual":
            solver.begin()  # it loads beside this program
        choice, serving, app = (import_module(f"tsis.console.{name}") for name in ("services.choice", "serving", "app"))
        terms = serving.ConsoleSettings(
            instrument=choice.InstrumentSettings(
                workspace=out,
                store=store,
                kind=kind,
                database=database,
                camera=camera,
                probe=probe,
                phantom=phantom,
                seed=seed,
                calibration=calibration,
            ),
            host=host,
            port=port,
            certificate=None if certificate is None or key is None else serving.Certificate(chain=certificate, key=key),
            names=tuple(allow_host or ()),
            new_token=new_token,
        )

        def ready(address: str) -> None:
            preparing.close()
            if as_json:
                print_json(tsis.present.document.envelope("console", address=address))
            else:
                terminal = people()
                terminal.print(f"Open {address}", markup=False, soft_wrap=True)
                terminal.print("Ctrl-C ends it; saved data stay.", markup=False)
                print_notice(terminal)
            if browser and not as_json:
                ending.enter_context(app.opened_in_browser(address))

        serving.serve_console(terms, ready=ready, solver=solver)
    if not as_json:
        people().print("Ended; saved data are in the store.")
    gc.freeze()  # the process ends now; a last collection would take a second


@contextmanager
def loading() -> Iterator[None]:
    """Collect no garbage while libraries load, a sixth of the time; what they leave is excluded from then on."""
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


@login.command(epilog="Example: tsis login add anna")
def add(*, name: Name) -> None:
    """Add a login, or change the password of an existing one.

    The password comes from a prompt, or from one line of standard input where that is no terminal. A new password
    ends the sessions opened with the old one.
    """
    logins = _logins()
    known = name in logins.names()
    logins.require_name(name)
    logins.add(name, _password())
    terminal = people()
    terminal.print(f"{name} has a new password." if known else f"{name} may log in.", markup=False)
    print_notice(terminal)


@login.command(epilog="Example: tsis login remove anna")
def remove(*, name: Name) -> None:
    """Remove a login; its sessions end at once."""
    _logins().remove(name)
    terminal = people()
    terminal.print(f"{name} may no longer log in.", markup=False)
    print_notice(terminal)


@login.command(name="list", epilog="Example: tsis login list --json")
def list_logins(*, as_json: AsJson = False) -> None:
    """List the logins of this user's console."""
    logins = _logins()
    created = {name: logins.created(name) for name in logins.names()}
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "logins", logins=[{"name": name, "given": when} for name, when in created.items()]
            )
        )
        return
    terminal = people()
    table = Table(title="Logins of this user's console", columns=("name", "password of"), values=tuple(created.items()))
    terminal.print(rich_table(table) if created else "No logins yet; tsis login add NAME adds one.")
    print_notice(terminal)


def _password() -> str:
    if not sys.stdin.isatty():
        line = sys.stdin.readline(LONGEST_LINE)
        return line.rstrip("\r\n")
    password = typer.prompt("Password", hide_input=True)
    if typer.prompt("Repeat it", hide_input=True) != password:
        raise InputError("password must be the same both times; got two different ones")
    return str(password)


def _logins() -> Any:
    with waiting("loading"):
        return import_module("tsis.console.auth").Logins()


SLOWEST = 0.1  # frames/s: allows the longest exposure of the simulated camera
POLL_S = 0.5


def serve(
    *,
    phantom: PhantomName = "hardness-100",
    probe: ProbeName = "tsis-2011",
    force_n: ForceN = 1.0,
    diameter_mm: DiameterMm = None,
    depth_mm: DepthMm = None,
    young_kpa: YoungKpa = None,
    interface: Annotated[str, typer.Option(help="Address of this machine to listen on.")] = "127.0.0.1",
    serial: Annotated[str, typer.Option(help="Serial number of the camera.")] = "TSIS01",
    frames_per_s: Annotated[float, typer.Option(help="Frames a second until a program sets another rate.")] = 30.0,
    seed: Annotated[int, typer.Option(help="Seed of every random error.", min=0, max=LARGEST_SEED)] = 4,
) -> None:
    """Serve the virtual probe's frames as a GigE Vision camera, until Ctrl-C.

    Any GigE Vision program can read it; its exposure and gain change the image.
    """
    import numpy as np

    rng = np.random.default_rng(seed)
    target = tsis.catalog.phantoms.phantom_variant(phantom, diameter_mm, depth_mm, young_kpa)
    with waiting("tracing the light of the lamps"):
        rig = tsis.virtual.VirtualProbe(tsis.catalog.load_probe(probe), rng=rng, strain="small")  # a live view
    camera = tsis.virtual.camera.VirtualCamera(rig, target, rng=rng, force_n=force_n, frames_per_s=SLOWEST)
    server = tsis.virtual.gige.GigEServer(camera, interface=interface, serial=serial, frames_per_s=frames_per_s)
    console = people()
    with ended_by(signal.SIGINT, signal.SIGTERM) as ended, server:
        serving = f"Serving {camera.name} at {force_n:g} N as {server.identity} on {interface}; Ctrl-C ends it."
        console.print(serving, markup=False, soft_wrap=True)
        console.print("List it with: tsis acquire --list", markup=False)
        console.print(f"Read it with: tsis acquire --camera aravis:{server.identity}", markup=False, soft_wrap=True)
        print_notice(console)
        console.file.flush()
        while server.failure is None and not ended.wait(POLL_S):
            pass
    if server.failure is not None:
        raise CameraError(f"serving ended: {server.failure}") from server.failure
    console.print(f"Ended; {server.sent} frames were sent.")
