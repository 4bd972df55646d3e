"""The version, and the sentence that every output carries."""

__version__ = "0.1.0"

RESEARCH_USE_ONLY = "Research use only. Not reviewed or approved by any regulator. Not for patient care."
