"""Trials of matching methods: shapes, distortions, public data, runs and summaries."""

from tsis.matching.trials._distort import Distortion, Family, Trial, distort, public_distortion
from tsis.matching.trials._methods import OWN_METHODS, PEERS, RIVAL_METHODS, BenchmarkMethod
from tsis.matching.trials._runs import TRIAL_ROW_HEAD, TrialRow, read_trial_rows, run_trials
from tsis.matching.trials._shapes import SHAPES, even_texture, strokes
from tsis.matching.trials._summary import (
    FAILURE_RMS,
    ErrorRatio,
    TrialSummary,
    TrustCase,
    fit_trust,
    summarise,
    summarise_pooled,
    trust_case,
)
from tsis.matching.trials._trials import (
    FAMILIES,
    HIDDEN_FRACTIONS,
    LEVEL_LABELS,
    PUBLIC_FILE,
    SEPARATIONS,
    SEQUENCE_FILE,
    distorted_set,
    hotel_set,
    hotel_trials,
    matching_error,
    public_trials,
)

__all__ = [
    "FAILURE_RMS",
    "FAMILIES",
    "HIDDEN_FRACTIONS",
    "LEVEL_LABELS",
    "OWN_METHODS",
    "PEERS",
    "PUBLIC_FILE",
    "RIVAL_METHODS",
    "SEPARATIONS",
    "SEQUENCE_FILE",
    "SHAPES",
    "TRIAL_ROW_HEAD",
    "BenchmarkMethod",
    "Distortion",
    "ErrorRatio",
    "Family",
    "Trial",
    "TrialRow",
    "TrialSummary",
    "TrustCase",
    "distort",
    "distorted_set",
    "even_texture",
    "fit_trust",
    "hotel_set",
    "hotel_trials",
    "matching_error",
    "public_distortion",
    "public_trials",
    "read_trial_rows",
    "run_trials",
    "strokes",
    "summarise",
    "summarise_pooled",
    "trust_case",
]
