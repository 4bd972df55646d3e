"""The force line: which force makes which sum of grey levels, and how that is measured."""

from tsis.calibration.force.fit import fit_force_line
from tsis.calibration.force.line import ForceLine, ForceLineDiagnostics
from tsis.calibration.force.loading import TIPS_MM, Loading, loading_forces
from tsis.calibration.force.reading import LoadingFrame, read_loading_frame, total_grey

__all__ = [
    "TIPS_MM",
    "ForceLine",
    "ForceLineDiagnostics",
    "Loading",
    "LoadingFrame",
    "fit_force_line",
    "loading_forces",
    "read_loading_frame",
    "total_grey",
]
