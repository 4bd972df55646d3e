"""The command line: wiring only, no science."""

from __future__ import annotations

import sys

from tsis.cli.progress import INTERRUPTED


def main() -> None:
    """Run the program; an interruption while it loads shows no traceback either."""
    try:
        from tsis.cli.app import run  # slow; Ctrl-C works meanwhile

        run()
    except KeyboardInterrupt:
        sys.stderr.write("Interrupted; no incomplete file remains.\n")
        sys.exit(INTERRUPTED)
