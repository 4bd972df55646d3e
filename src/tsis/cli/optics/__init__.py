"""``tsis optics``: light in the probe."""

from __future__ import annotations

import typer

from tsis.__about__ import RESEARCH_USE_ONLY

app = typer.Typer(name="optics", help=f"Light in the probe. {RESEARCH_USE_ONLY}", no_args_is_help=True)
