"""How well inclusions are found: rates, curves and agreement, each with an interval that stays right for few targets.

A study scores targets, of which some hold an inclusion. Sensitivity and specificity count decisions (`Counts`); a curve
shows them at every threshold (`roc`); methods are compared on the same targets (`compare_detectors`, `bootstrap_compare_detectors`). A
threshold is chosen by a purpose and judged on targets that had no part in the choice (`youden_point`,
`held_out_counts`). Probabilities are set beside what came true (`brier_score`, `reliability_curve`, `recalibration`).
The probability that an inclusion is there is read off an estimate (`presence`), and of which kind it is, named by
measured properties, off a classifier (`train_classifier`, `cross_validate`). Readings are compared between raters
(`intraclass_correlation`), between two ways to measure (`bland_altman`), within an operator (`repeatability`) and
between operators (`reproducibility`). A scan plan says where to press to search an area, and what it cannot miss
(`scan_plan`, `widest_plan`, `smallest_found_mm`).
"""

from tsis.detection.auc import newcombe_interval
from tsis.detection.bland_altman import BlandAltman, ProportionalBias, bland_altman
from tsis.detection.bootstrap import bootstrap_auc
from tsis.detection.brier import BrierScore, brier_interval, brier_score
from tsis.detection.classify import Classified, Classifier, ClassifierSettings, train_classifier
from tsis.detection.classify_classes import ClassSplit
from tsis.detection.classify_file import read_classifier, write_classifier
from tsis.detection.classify_readings import TargetEvidence, TrainingSet, target_evidence
from tsis.detection.classify_validation import Validation, cross_validate
from tsis.detection.comparison import Comparison, bootstrap_compare_detectors, compare_detectors
from tsis.detection.counts import Counts
from tsis.detection.delong import AucCovariance, auc_covariance
from tsis.detection.icc import IntraclassCorrelation, intraclass_correlation
from tsis.detection.interval import Interval
from tsis.detection.operating import (
    OperatingPoint,
    at_costs,
    at_sensitivity,
    at_specificity,
    held_out_counts,
    youden_point,
)
from tsis.detection.presence import PresenceProbability, presence
from tsis.detection.proportion import Proportion, exact_interval, wilson_interval
from tsis.detection.recalibration import FittedValue, Recalibration, recalibration
from tsis.detection.reliability import ReliabilityBin, ReliabilityCurve, reliability_curve
from tsis.detection.repeatability import Repeatability, repeatability
from tsis.detection.reproducibility import Reproducibility, reproducibility
from tsis.detection.roc import Roc, roc
from tsis.detection.search import ScanPlan, scan_plan, widest_plan
from tsis.detection.search_limits import smallest_found_mm, widest_spacing_mm
from tsis.detection.search_reach import ReachTable, measured_reach, reach_of_trials, read_reach
from tsis.detection.two_proportions import ProportionDifference, ProportionRatio

__all__ = [
    "AucCovariance",
    "BlandAltman",
    "BrierScore",
    "ClassSplit",
    "Classified",
    "Classifier",
    "ClassifierSettings",
    "Comparison",
    "Counts",
    "FittedValue",
    "Interval",
    "IntraclassCorrelation",
    "OperatingPoint",
    "PresenceProbability",
    "Proportion",
    "ProportionDifference",
    "ProportionRatio",
    "ProportionalBias",
    "ReachTable",
    "Recalibration",
    "ReliabilityBin",
    "ReliabilityCurve",
    "Repeatability",
    "Reproducibility",
    "Roc",
    "ScanPlan",
    "TargetEvidence",
    "TrainingSet",
    "Validation",
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
    "cross_validate",
    "exact_interval",
    "held_out_counts",
    "intraclass_correlation",
    "measured_reach",
    "newcombe_interval",
    "presence",
    "reach_of_trials",
    "read_classifier",
    "read_reach",
    "recalibration",
    "reliability_curve",
    "repeatability",
    "reproducibility",
    "roc",
    "scan_plan",
    "smallest_found_mm",
    "target_evidence",
    "train_classifier",
    "widest_plan",
    "widest_spacing_mm",
    "wilson_interval",
    "write_classifier",
    "youden_point",
]
