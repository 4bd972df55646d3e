"""How long a camera that runs may be silent before it is taken for lost: one rule for every source."""

SILENT_S = 1.0
LATE_FRAMES = 3.0  # of a camera whose frames take longer
