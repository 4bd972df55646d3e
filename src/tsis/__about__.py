"""The version, the sentence that every output carries, and limits that help shows before any package is loaded."""

__version__ = "0.1.0"

RESEARCH_USE_ONLY = "Research use only. Not reviewed or approved by any regulator. Not for patient care."

LARGEST_SEED = 2**63 - 1  # of random generators: the largest integer of many programs
LARGEST_TARGET = 99_999
VALID_DAYS = 180  # of a calibration, where nothing else is given
CALIBRATION_FILE = "calibration.json"  # default name
