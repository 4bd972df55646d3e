"""``tsis records``: list, show, verify, back up, restore, import, recompute, edit and export targets.

The store's own libraries are imported when a command runs, so that the program starts quickly.
"""

from __future__ import annotations

import typer

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.cli.records._backup import backup, restore
from tsis.cli.records._edit import edit
from tsis.cli.records._export import export
from tsis.cli.records._import import import_
from tsis.cli.records._recompute import recompute, verify
from tsis.cli.records._show import list_targets, show

app = typer.Typer(
    name="records",
    help=f"Targets with their presses and estimates: list, verify, back up, recompute, export. {RESEARCH_USE_ONLY}",
    epilog="Start with: tsis demo --save, then tsis records list",
    no_args_is_help=True,
)
app.command("list", epilog="Example: tsis records list")(list_targets)
app.command("show", epilog="Example: tsis records show 1 --limit 20")(show)
app.command("verify", epilog="Example: tsis records verify")(verify)
app.command("backup", epilog="Example: tsis records backup records-backup")(backup)
app.command("restore", epilog="Example: tsis records restore records-backup --store restored-records")(restore)
app.command("import", epilog="Example: tsis records import first-press")(import_)
app.command("recompute", epilog="Example: tsis records recompute --all --dry-run")(recompute)
app.command("edit", epilog="Example: tsis records edit 1 --name 'soft, 8 mm' --note 'second row, left'")(edit)
app.command("export", epilog="Example: tsis records export 1 --format pdf --format csv --out target-1")(export)
