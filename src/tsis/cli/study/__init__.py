"""``tsis study``: blinded studies from the list of targets to the report.

The package of studies is imported when a command runs, so that the program starts quickly.
"""

from __future__ import annotations

import typer

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.cli.study._analyse import analyse
from tsis.cli.study._card import card, check
from tsis.cli.study._kit import kit, score
from tsis.cli.study._new import new
from tsis.cli.study._plan import plan
from tsis.cli.study._precision import repeatability, size
from tsis.cli.study._run import export, import_, run
from tsis.cli.study._verify import show, verify

app = typer.Typer(
    name="study",
    help=f"Blinded studies, performance cards, daily checks, validation; scan plans. {RESEARCH_USE_ONLY}",
    epilog="Start with: tsis study new trial, tsis study run trial, tsis study analyse trial --by NAME",
    no_args_is_help=True,
)
app.command(epilog="Example: tsis study new trial --present 3 --blank 1 --repeats 2 --seed 1 --like random")(new)
app.command(epilog="Example: tsis study show trial")(show)
app.command(epilog="Example: tsis study run trial --operator Ada")(run)
app.command("import", epilog="Example: tsis study import trial readings.csv --device palpation")(import_)
app.command(epilog="Example: tsis study export trial readings.csv")(export)
app.command(epilog="Example: tsis study analyse trial --by Ada --yes")(analyse)
app.command(epilog="Example: tsis study verify trial")(verify)
app.command(epilog="Example: tsis study repeatability trial --out trial-repeatability")(repeatability)
app.command(epilog="Example: tsis study size --width 0.2")(size)
app.command(epilog="Example: tsis study card trial --out trial-card")(card)
app.command(epilog="Example: tsis study check checks --rehearse 10 --baseline 8 --seed 2 --out checks-chart")(check)
app.command(epilog="Example: tsis study kit kit")(kit)
app.command(epilog="Example: tsis study score bench --study trial --out trial-score")(score)
app.command(epilog="Example: tsis study plan --width-mm 90 --height-mm 60 --overlap 0.5 --out plan")(plan)
