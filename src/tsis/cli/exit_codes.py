"""How the program ends, for scripts and shells."""

BAD_INPUT = 2  # one sentence says what was wrong
INTERRUPTED = 130  # Ctrl-C, as shells have it
