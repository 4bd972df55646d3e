"""How well inclusions are found: rates, curves and agreement, each with an interval that stays right for few targets.

A study scores targets, of which some hold an inclusion. Sensitivity and specificity count decisions (`Counts`); a curve
shows them at every threshold (`roc`); methods are compared on the same targets (`compare_detectors`,
`bootstrap_compare_detectors`). A threshold is chosen by a purpose and judged on targets that had no part in the choice
(`youden_point`, `held_out_counts`). Probabilities are set beside what came true (`brier_score`, `reliability_curve`,
`recalibration`).
The probability that an inclusion is there is read off an estimate (`presence`), and of which kind it is, named by
measured properties, off a classifier (`train_classifier`, `cross_validate`). Readings are compared between raters
(`intraclass_correlation`), between two ways to measure (`bland_altman`), within an operator (`repeatability`), between
operators (`reproducibility`) and with reference targets (`linearity`); `study_size` says how many are needed. A chart
of daily checks warns of drift (`control_chart`, `ewma_run_length`). A scan
plan says where to press to search an area, and what it cannot miss (`scan_plan`, `widest_plan`, `smallest_found_mm`).
"""

from typing import TYPE_CHECKING

import lazy_loader

from tsis.detection._bland_altman import BlandAltman, ProportionalBias, bland_altman
from tsis.detection._bootstrap import bootstrap_auc
from tsis.detection._brier import (
    BrierScore,
    ReliabilityBin,
    ReliabilityCurve,
    brier_interval,
    brier_score,
    reliability_curve,
)
from tsis.detection._comparison import Comparison, bootstrap_compare_detectors, compare_detectors
from tsis.detection._control_chart import ControlChart, control_chart, ewma_run_length, shewhart_run_length
from tsis.detection._counts import Counts
from tsis.detection._icc import IntraclassCorrelation, intraclass_correlation
from tsis.detection._inputs import Interval
from tsis.detection._linearity import Linearity, PrecisionStudySize, linearity, study_size
from tsis.detection._operating import (
    OperatingPoint,
    at_costs,
    at_sensitivity,
    at_specificity,
    held_out_counts,
    youden_point,
)
from tsis.detection._presence import PresenceProbability, presence
from tsis.detection._proportions import (
    Proportion,
    ProportionDifference,
    ProportionRatio,
    exact_interval,
    wilson_interval,
)
from tsis.detection._recalibration import FittedValue, Recalibration, recalibration
from tsis.detection._repeatability import (
    REPEATABILITY_SD,
    Repeatability,
    Reproducibility,
    repeatability,
    reproducibility,
)
from tsis.detection._roc import AucCovariance, Roc, auc_covariance, newcombe_interval, roc

__all__ = [
    "REPEATABILITY_SD",
    "AucCovariance",
    "BlandAltman",
    "BrierScore",
    "Comparison",
    "ControlChart",
    "Counts",
    "FittedValue",
    "Interval",
    "IntraclassCorrelation",
    "Linearity",
    "OperatingPoint",
    "PrecisionStudySize",
    "PresenceProbability",
    "Proportion",
    "ProportionDifference",
    "ProportionRatio",
    "ProportionalBias",
    "Recalibration",
    "ReliabilityBin",
    "ReliabilityCurve",
    "Repeatability",
    "Reproducibility",
    "Roc",
    "at_costs",
    "at_sensitivity",
    "at_specificity",
    "auc_covariance",
    "bland_altman",
    "bootstrap_auc",
    "bootstrap_compare_detectors",
    "brier_interval",
    "brier_score",
    "compare_detectors",
    "control_chart",
    "ewma_run_length",
    "exact_interval",
    "held_out_counts",
    "intraclass_correlation",
    "linearity",
    "newcombe_interval",
    "presence",
    "recalibration",
    "reliability_curve",
    "repeatability",
    "reproducibility",
    "roc",
    "shewhart_run_length",
    "study_size",
    "wilson_interval",
    "youden_point",
]

if not TYPE_CHECKING:  # subpackages load when they are first used
    __getattr__ = lazy_loader.attach(__name__, ["classify", "search"])[0]
