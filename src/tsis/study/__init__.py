"""Blinded studies: targets under codes, readings in a tamper-evident log, then the truth and the analysis.

`new_study` writes a folder with the plan, the sealed truth and the log. Readings come from the virtual probe
(`press_study`) or from other devices (`import_readings`). `unblind` happens once; no reading is accepted after it.
`analyse` compares the readings with the truth, and `verify_study` checks every file and the log.
"""

from tsis.study._daily_check import (
    CHARTED,
    CheckLog,
    CheckPlan,
    DailyCheck,
    add_checks,
    begin_checks,
    daily_check,
    read_checks,
)
from tsis.study._drift_chart import DriftChart, drift_charts, rehearsed_checks
from tsis.study._folder import ANALYSED, PLAN, Study, enter_readings, open_study, read_seal
from tsis.study._kit import (
    KIT,
    MODULUS_COLUMNS,
    KitPhantom,
    cup,
    kit_files,
    kit_moulds,
    sphere_mould,
    stl_bytes,
    volume_mm3,
)
from tsis.study._log import LOG_FILE
from tsis.study._making import MOST_TARGETS, new_study, printed_targets, random_targets
from tsis.study._plan import ANALYSED_READING, TARGETS
from tsis.study._pressing import RunResult, StudyInstrument, press_study
from tsis.study._reference_run import REFERENCES, press_by_operators, reference_targets, rehearse_reference_run
from tsis.study._tables import (
    READING_COLUMNS,
    UNCERTAINTY_COLUMNS,
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
    "CHARTED",
    "KIT",
    "LOG_FILE",
    "MODULUS_COLUMNS",
    "MOST_TARGETS",
    "PLAN",
    "QUANTITIES",
    "READING_COLUMNS",
    "REFERENCES",
    "TARGETS",
    "UNCERTAINTY_COLUMNS",
    "CheckLog",
    "CheckPlan",
    "DailyCheck",
    "DeviceReading",
    "DriftChart",
    "KitPhantom",
    "RunResult",
    "Study",
    "StudyInstrument",
    "StudyVerification",
    "TargetTruth",
    "add_checks",
    "begin_checks",
    "cup",
    "daily_check",
    "drift_charts",
    "enter_analysis",
    "enter_readings",
    "export_readings",
    "import_readings",
    "import_table",
    "is_file_name",
    "kit_files",
    "kit_moulds",
    "new_study",
    "open_study",
    "press_by_operators",
    "press_study",
    "printed_targets",
    "random_targets",
    "read_checks",
    "read_seal",
    "read_truth_table",
    "readings_table",
    "reference_targets",
    "rehearse_reference_run",
    "rehearsed_checks",
    "require_short_name",
    "sphere_mould",
    "stl_bytes",
    "unblind",
    "verify_study",
    "volume_mm3",
]
