"""``tsis sweep``: many presses as one data set."""

from __future__ import annotations

import shlex
import sys
from dataclasses import asdict
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import tsis
from tsis.cli.options import AsJson
from tsis.cli.output import leave, print_json
from tsis.cli.progress import progress_bar, stop_interrupted
from tsis.present.page import Column, Table
from tsis.present.terminal import people, print_notice, print_tables

if TYPE_CHECKING:
    from tsis.sweep.plan import Plan


app = typer.Typer(
    name="sweep",
    epilog="Start with: tsis sweep example > plan.toml",
    invoke_without_command=True,
    pretty_exceptions_enable=False,
)

PlanFile = Annotated[Path, typer.Argument(metavar="PLAN.toml", help="The plan; tsis sweep example prints one.")]
DataFolder = Annotated[Path, typer.Argument(metavar="DIR", help="Folder that tsis sweep run wrote.")]


@app.callback()
def sweep(context: typer.Context) -> None:
    """Show the help where no command follows."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@app.command(epilog="Example: tsis sweep run plan.toml --out data --workers 2")
def run(
    *,
    plan: PlanFile,
    out: Annotated[Path, typer.Option(help="Folder of the data set: new, or of a sweep to resume.")] = Path(
        "tsis-sweep"
    ),
    workers: Annotated[
        int | None, typer.Option(help="Processes on this machine; one per processor by default.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler to use instead, tcp://host:port.")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the amount of work, and stop.")] = False,
    as_json: AsJson = False,
) -> None:
    """Compute a data set, or resume an interrupted one.

    Workers and this program may be killed at any time: repeat the command. Complete files stay, and
    the data set has the same bytes as without an interruption. Exit code 3 means that every press was refused.
    """
    chosen = tsis.sweep.plan.load_plan(plan)
    count = tsis.sweep.run.worker_count(workers)
    if dry_run:
        _say_how_much(chosen, count if scheduler is None else None, as_json=as_json)
        return
    try:
        with progress_bar("Pressing") as advance:
            done = tsis.sweep.run.run_sweep(chosen, out, workers=workers, scheduler=scheduler, progress=advance)
    except KeyboardInterrupt:
        again = " ".join(["tsis", *map(shlex.quote, sys.argv[1:])])
        stop_interrupted(f"; finished files stay. Resume with: {again}")
    if as_json:
        print_json(tsis.present.document.envelope("sweep run", **asdict(done)))
        leave(trusted=done.refused < done.presses)
        return
    console = people()
    console.print(
        f"{done.presses} presses in {done.shards} files, {done.computed} computed now, {done.kept} already present."
    )
    if done.refused:
        console.print(
            f"- {done.refused} presses were refused: their rows contain NaN, and the column error gives the reason."
        )
    if done.repaired:
        names = tsis.sweep.data_set.first_few(done.repaired)
        console.print(f"- {len(done.repaired)} damaged or foreign, computed again: {names}", markup=False)
    if done.lost:
        console.print(f"- {done.lost} batches lost their worker and went to another one.")
    console.print(f"Data set: {done.folder}", soft_wrap=True, markup=False)
    print_notice(console)
    leave(trusted=done.refused < done.presses)


@app.command("verify", epilog="Example: tsis sweep verify data")
def verify_folder(*, folder: DataFolder, as_json: AsJson = False) -> None:
    """Check every file of a data set against the SHA-256 in its manifest."""
    manifest = tsis.sweep.data_set.verify_data_set(folder)
    results = {key: manifest[key] for key in ("data_set", "plan_sha256", "presses", "refused")}
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "sweep verify", folder=str(folder.resolve()), shards=len(manifest["shards"]), **results
            )
        )
        return
    console = people()
    console.print(f"{results['presses']} presses in {len(manifest['shards'])} files are as they were written.")
    console.print(f"- {results['refused']} presses were refused by the model.")
    print_notice(console)


@app.command(epilog="Example: tsis sweep example > plan.toml")
def example() -> None:
    """Print a plan to start from."""
    typer.echo(tsis.sweep.plan.EXAMPLE, nl=False)


def _say_how_much(plan: Plan, workers: int | None, *, as_json: bool) -> None:
    per_press = tsis.sweep.run.seconds_per_press(plan)
    seconds = None if workers is None else per_press * plan.presses / workers
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "sweep run",
                "plan",
                dry_run=True,
                phantoms=plan.samples,
                presses=plan.presses,
                shards=plan.shards,
                seconds_per_press=per_press,
                workers=workers,
                estimated_seconds=seconds,
            )
        )
        return
    rows = [
        ("phantoms", str(plan.samples)),
        ("presses", str(plan.presses)),
        ("files", str(plan.shards)),
        ("time of a press on one processor", f"{1000 * per_press:.1f} ms"),
    ]
    if seconds is not None:
        rows.append((f"time with {workers} workers, about (h:min:s)", str(timedelta(seconds=round(seconds)))))
    title = "Nothing was computed or written"
    print_tables((Table(title=title, columns=("of this plan", Column(label="")), values=tuple(rows)),))
