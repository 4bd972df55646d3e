"""``tsis console``: the instrument in a browser."""

from __future__ import annotations

import gc
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from tsis.cli.console_output import people, print_json, print_notice
from tsis.cli.progress import waiting
from tsis.cli.records.chosen_store import PHANTOM, StoreDatabase, StoreFolder, StoreKind
from tsis.cli.targets import AsJson, PhantomName, ProbeName
from tsis.model.check import LARGEST_SEED
from tsis.model.errors import InputError
from tsis.report.document import envelope


def console(
    *,
    camera: Annotated[
        str, typer.Option(help="virtual, or SOURCE:ID as tsis acquire --list shows it; the page can change it.")
    ] = "virtual",
    probe: ProbeName = "tsis-domed",
    phantom: PhantomName = "hardness-100",
    seed: Annotated[int, typer.Option(help="Seed of the virtual probe's errors.", min=0, max=LARGEST_SEED)] = 4,
    calibration: Annotated[
        Path | None, typer.Option(help="Calibration file in force.", show_default="the virtual probe's own")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of snapshots and sequences; made when missing.")] = Path(
        "tsis-console"
    ),
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    host: Annotated[
        str, typer.Option(help="Address to listen on; one that others can reach needs a certificate and a login.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port to listen on; 0 is any free one.", min=0, max=65535)] = 8642,
    certificate: Annotated[
        Path | None, typer.Option(help="Certificate of this machine (PEM), with those that vouch for it.")
    ] = None,
    key: Annotated[Path | None, typer.Option(help="Private key of the certificate (PEM).")] = None,
    allow_host: Annotated[
        list[str] | None,
        typer.Option("--allow-host", metavar="NAME", help="Name by which it may be called; repeatable."),
    ] = None,
    new_token: Annotated[
        bool, typer.Option("--new-token", help="Make another key: open pages and scripts need the new address.")
    ] = False,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")] = True,
    as_json: AsJson = False,
) -> None:
    """Open the console: see through a camera or the virtual probe, keep presses, estimate, calibrate, report.

    It listens on this machine alone, unless told otherwise. The address that it prints holds the key to the page.
    Ctrl-C ends it.
    """
    if (certificate is None) != (key is None):
        raise InputError("certificate and key must be given together; got one of them (--certificate FILE --key FILE)")
    preparing = ExitStack()
    preparing.enter_context(waiting("preparing the console"))
    from tsis.console import BenchTerms, Certificate, ConsoleTerms, serve_console
    from tsis.console.opening import opened_in_browser

    terms = ConsoleTerms(
        bench=BenchTerms(
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
        certificate=None if certificate is None or key is None else Certificate(chain=certificate, key=key),
        names=tuple(allow_host or ()),
        new_token=new_token,
    )

    def ready(address: str) -> None:
        preparing.close()
        if as_json:
            print_json(envelope("console", address=address))
        else:
            told = people()
            told.print(f"Open {address}", markup=False, soft_wrap=True)
            told.print("Ctrl-C ends it; what was kept stays.", markup=False)
            print_notice(told)
        if browser and not as_json:
            ending.enter_context(opened_in_browser(address))

    with preparing, ExitStack() as ending:
        serve_console(terms, ready=ready)
    if not as_json:
        people().print("Ended; what was kept is in the store.")
    gc.freeze()  # the process ends now; to look through all that it holds first would take a second
