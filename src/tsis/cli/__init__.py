"""The command line: wiring only, no science."""

from tsis.cli.app import main

__all__ = ["main"]
