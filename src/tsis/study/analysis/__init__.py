"""Analysis of a study: readings against the truth, for each device."""

from tsis.study.analysis._agreement import Agreement, AgreementValue
from tsis.study.analysis._analysis import DeviceComparison, StudyAnalysis, analyse, results_table
from tsis.study.analysis._card import CardCheck, PerformanceCard, performance_card
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
from tsis.study.analysis._score import BenchModulus, QuantityScore, ValidationScore, bench_moduli, score_validation

__all__ = [
    "FEW",
    "OPERATORS",
    "PROBES",
    "Agreement",
    "AgreementValue",
    "BenchModulus",
    "CardCheck",
    "DeviceAnalysis",
    "DeviceComparison",
    "DeviceResults",
    "PerformanceCard",
    "Precision",
    "PrecisionAnalysis",
    "QuantityScore",
    "SizeErrors",
    "StudyAnalysis",
    "TargetResult",
    "ValidationScore",
    "analyse",
    "analyse_precision",
    "bench_moduli",
    "performance_card",
    "results_table",
    "score_validation",
]
