"""Blinded studies: targets under codes, readings in a log that shows every change, then the truth and what it says.

`new_study` writes a folder with the plan, the sealed truth and the log. Readings come from the virtual probe
(`press_study`) or from other devices (`import_readings`). `unblind` is entered once; after it no reading is taken.
`analyse` sets the readings beside the truth, and `verify_study` says whether all of it is as it was written.
"""

from tsis.study.analysis import StudyAnalysis, analyse
from tsis.study.folder import Study, enter_readings, open_study
from tsis.study.making import new_study
from tsis.study.pressing import RunResult, press_study
from tsis.study.reading import DeviceReading
from tsis.study.table import export_readings, import_readings
from tsis.study.targets import printed_targets, random_targets
from tsis.study.truth import TargetTruth
from tsis.study.truth_table import read_truth_table
from tsis.study.unblinding import enter_analysis, unblind
from tsis.study.verification import StudyVerification, verify_study

__all__ = [
    "DeviceReading",
    "RunResult",
    "Study",
    "StudyAnalysis",
    "StudyVerification",
    "TargetTruth",
    "analyse",
    "enter_analysis",
    "enter_readings",
    "export_readings",
    "import_readings",
    "new_study",
    "open_study",
    "press_study",
    "printed_targets",
    "random_targets",
    "read_truth_table",
    "unblind",
    "verify_study",
]
