"""What other commands and cameras wrote, taken into a store: looked through first, then stored press by press."""

from tsis.records.importing.cited import held_calibration
from tsis.records.importing.entering import Entered, Entering, enter, require_enterable
from tsis.records.importing.found import Batch, Given, Incoming
from tsis.records.importing.places import batches

__all__ = [
    "Batch",
    "Entered",
    "Entering",
    "Given",
    "Incoming",
    "batches",
    "enter",
    "held_calibration",
    "require_enterable",
]
