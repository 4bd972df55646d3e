"""The command line: wiring only, no science."""

from __future__ import annotations

import sys

from tsis.cli.exit_codes import INTERRUPTED


def main() -> None:
    """Run the program; whoever interrupts it while it still loads sees no traceback either."""
    try:
        from tsis.cli.app import run  # seconds, in which somebody may change their mind

        run()
    except KeyboardInterrupt:
        sys.stderr.write("Interrupted; nothing half-written is left.\n")
        sys.exit(INTERRUPTED)


__all__ = ["main"]
