"""Flags of a match of point sets: each is declared once, with its sentence, threshold and cure."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tsis.matching.methods import SAMPLE
from tsis.model.flag import Flag, declared, withholding

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.matching.methods import Floats
    from tsis.model.flag import Finding


FEW = {2: 9, 3: 16}  # points, by dimension, below which a bent map fits unrelated sets
FEW_POINTS = Flag(
    name="few_points",
    means="so few points fit almost any others",
    cure="give more points of either shape",
    raised=f"fewer than {FEW[2]} points of the plane or {FEW[3]} of space",
    says="so few points fit almost any others; the confidence means little",
)
SAMPLED = Flag(
    name="sampled",
    means="samples of large sets were matched",
    cure="thin the points out, where each match counts",
    raised=f"more pairs than tables hold; {SAMPLE:,} source points are drawn",
    says="{source:,} and {target:,} points are too many for tables of all pairs; {drawn:,} and {others:,} drawn from "
    "them were matched",
)

LIKELY_UNRELATED = 0.01
UNRELATED = Flag(
    name="unrelated_sets",
    means="the sets may have nothing to do with each other",
    cure="check that both show the same shape, and that most of its points are in both",
    raised=f"probability of unrelated sets above {LIKELY_UNRELATED:g}",
    withholds=True,
    says="the sets may have nothing to do with each other (probability {probability:.2g})",
)
AMBIGUOUS = Flag(
    name="several_poses",
    means="the data allow several poses, as of a symmetric or nearly symmetric shape",
    cure="state the expected rotation with rotation_sd_deg, or give points that break the symmetry",
    raised="probability of other poses above that of an error that the cost of one allows",
    withholds=True,
    says="the data allow several poses, as of a symmetric shape; another pose has probability {probability:.2g}",
)
CONTRADICTED = Flag(
    name="better_pose",
    means="another map explains the sets better than this answer",
    cure="use the method tprl",
    raised="answer further from the most probable map than the tolerance",
    withholds=True,
    says="another map explains the sets better than the answer of this method",
)
FOLDED = Flag(
    name="folded_map",
    means="the map folds, mirrors or flattens the shape, or pairs few points",
    cure="use the method tprl, or check that the sets show the same side of the shape",
    raised="no sound map",
    withholds=True,
    says="the map folds, mirrors or flattens the shape, or pairs few points",
)
UNSURE = Flag(
    name="unsure",
    means="noise, outliers, hidden points or strong bending leave doubt of the transform",
    cure="measure more points, with less noise, or of more of the shape",
    raised="confidence below the threshold without another reason",
    withholds=True,
    says="noise of {noise:.2g} point distances, {hidden:.0f} % of the source and {stray:.0f} % of the target without "
    "partner leave doubt",
)

MATCHING_FLAGS = declared(UNRELATED, AMBIGUOUS, CONTRADICTED, FOLDED, UNSURE, FEW_POINTS, SAMPLED)
UNTRUSTED_FLAGS = withholding(MATCHING_FLAGS)


def doubts(measures: Floats, *, rivals: float, most: float) -> Iterator[Finding]:
    """Reasons for a confidence below its threshold, from the `tsis.matching.posterior.trust_measures` of an answer.

    ``rivals`` is the probability of other poses, ``most`` the greatest that a reliable answer may have.
    """
    hidden, stray, noise, far, unrelated, sound = (float(measures[place]) for place in (1, 2, 3, 4, 6, 7))
    found = []
    chance = math.exp(min(unrelated, 0.0))
    if chance > LIKELY_UNRELATED:
        found.append(UNRELATED.finding(probability=chance))
    if not sound:
        found.append(FOLDED.finding())
    if found:
        yield from found
        return
    if far > 1.0:
        found.append(CONTRADICTED.finding())
    elif rivals > most:
        found.append(AMBIGUOUS.finding(probability=rivals))
    if not found:
        hidden, stray = 100 * max(hidden, 0.0), 100 * max(stray, 0.0)
        found.append(UNSURE.finding(noise=math.exp(noise), hidden=hidden, stray=stray))
    yield from found
