"""Analysis of a study: readings against the truth, for each device."""

from tsis.study.analysis._agreement import Agreement, AgreementValue
from tsis.study.analysis._analysis import DeviceComparison, StudyAnalysis, analyse, results_table
from tsis.study.analysis._device import FEW, DeviceAnalysis, SizeErrors
from tsis.study.analysis._precision import (
    OPERATORS,
    PROBES,
    DeviceResults,
    Precision,
    PrecisionAnalysis,
    TargetResult,
    analyse_precision,
)

__all__ = [
    "FEW",
    "OPERATORS",
    "PROBES",
    "Agreement",
    "AgreementValue",
    "DeviceAnalysis",
    "DeviceComparison",
    "DeviceResults",
    "Precision",
    "PrecisionAnalysis",
    "SizeErrors",
    "StudyAnalysis",
    "TargetResult",
    "analyse",
    "analyse_precision",
    "results_table",
]
