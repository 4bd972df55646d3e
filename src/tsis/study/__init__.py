"""Blinded studies: targets under codes, readings in a tamper-evident log, then the truth and the analysis.

`new_study` writes a folder with the plan, the sealed truth and the log. Readings come from the virtual probe
(`press_study`) or from other devices (`import_readings`). `unblind` happens once; no reading is accepted after it.
`analyse` compares the readings with the truth, and `verify_study` checks every file and the log.
"""

from tsis.study._folder import ANALYSED, PLAN, Study, enter_readings, open_study, read_seal
from tsis.study._log import LOG_FILE
from tsis.study._making import new_study, printed_targets, random_targets
from tsis.study._plan import ANALYSED_READING, TARGETS
from tsis.study._pressing import RunResult, press_study
from tsis.study._tables import (
    READING_COLUMNS,
    export_readings,
    import_readings,
    import_table,
    read_truth_table,
    readings_table,
)
from tsis.study._values import QUANTITIES, DeviceReading, TargetTruth, require_short_name
from tsis.study._verification import StudyVerification, enter_analysis, is_file_name, unblind, verify_study

__all__ = [
    "ANALYSED",
    "ANALYSED_READING",
    "LOG_FILE",
    "PLAN",
    "QUANTITIES",
    "READING_COLUMNS",
    "TARGETS",
    "DeviceReading",
    "RunResult",
    "Study",
    "StudyVerification",
    "TargetTruth",
    "enter_analysis",
    "enter_readings",
    "export_readings",
    "import_readings",
    "import_table",
    "is_file_name",
    "new_study",
    "open_study",
    "press_study",
    "printed_targets",
    "random_targets",
    "read_seal",
    "read_truth_table",
    "readings_table",
    "require_short_name",
    "unblind",
    "verify_study",
]
