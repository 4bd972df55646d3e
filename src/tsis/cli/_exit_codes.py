"""How the program ends, for scripts and shells."""

from __future__ import annotations

BAD_INPUT = 2  # one sentence says what was wrong
INTERRUPTED = 130  # Ctrl-C, as shells have it
