"""Which study a command works on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

StudyFolder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the study.")]
ByName = Annotated[str, typer.Option("--operator", help="Who holds the probe.", show_default="this user")]
