"""Flags of a modulus from a force curve: each is declared once, with its sentence, threshold and cure."""

from __future__ import annotations

from tsis.hardness.flags import WIDE
from tsis.model.flag import Flag, declared, withholding

NO_CONTACT = Flag(
    name="no_contact",
    means="the force does not rise beyond noise and drift",
    cure="press further, or check that the file holds the loading part, and force that is positive in compression",
    raised="rise below 6 sd of the residuals, or below 50 with fewer than 7 % of the points in contact",
    withholds=True,
    says="The force does not rise beyond noise and drift: {cure}.",
)
NOT_IDENTIFIED = Flag(
    name="young_kpa_not_identified",
    means="the curve does not determine the modulus",
    cure="press deeper, with a longer approach before contact",
    raised=f"ends of the 90 % interval further apart than a factor of {WIDE:g}",
    says="The modulus is not identifiable from this curve: {low:.3g} to {high:.3g} kPa.",
)
ADHESION = Flag(
    name="adhesion",
    means="the sample pulls at the indenter as it leaves",
    cure="wet the surface, or read the modulus from a deeper press",
    raised="pull below the baseline by more than 10 % of the peak and 6 sd of the noise",
    says="On leaving, the sample pulls with {percent:.0f} % of the peak force; the model knows no adhesion: {cure}.",
)
HOLD_RELAXES = Flag(
    name="hold_relaxes",
    means="the force changes while the indenter rests: the sample is viscoelastic",
    cure="state the speed beside the modulus, or press at several speeds",
    raised="more than 5 % of the peak force during a hold",
    says="During the hold the force changes by {percent:.0f} % of its peak: the modulus is that at this speed; {cure}.",
)
NO_BASELINE = Flag(
    name="no_baseline",
    means="the curve begins in contact, or nearly so",
    cure="begin further away",
    raised="fewer than 5 % of the points before contact",
    says="The curve has nearly no points before contact: {cure}.",
)
SHALLOW_PART = Flag(
    name="shallow_part",
    means="only the first part of the curve was used",
    raised="deeper than 0.5 of the ball's radius or 0.25 of the thickness",
    says="Only the first {depth_um:.3g} µm of {whole_um:.3g} µm were used: the model holds up to there.",
)
POOR_FIT = Flag(
    name="model_does_not_fit",
    means="the curve is not that of this indenter on a uniform layer",
    cure="check the indenter's shape and size, the unit of both columns and the compliance of the machine",
    raised="residuals above 8 % of the peak",
    withholds=True,
    says="The curve departs from that of this indenter by {percent:.0f} % of the peak: {cure}.",
)
BETTER, LEAST_RESIDUAL = 2.5, 0.005  # ratio of residuals; those of the stated shape over the range of the force
INDENTER_DOUBTFUL = Flag(
    name="indenter_doubtful",
    means="the curve is that of another indenter",
    cure="check the shape of the indenter, the thickness of the sample and that the curve is not cut",
    raised=f"residuals of another shape {BETTER:g} times smaller, those of the stated one above "
    f"{100 * LEAST_RESIDUAL:g} % of the range of the force",
    withholds=True,
    says="A {other} fits the curve {ratio:.1f} times better than the stated {stated}: {cure}.",
)
CHANGES_WITH_DEPTH = Flag(
    name="changes_with_depth",
    means="shallow parts of the curve give another modulus than the whole",
    cure="the sample may be layered, sticky or rough: state the depth beside the modulus",
    raised="moduli of the first 50 to 100 % of the depth scatter by more than twice the sd of the fit",
    says="Fits of the first 50 to 100 % of the depth scatter by {percent:.0f} %, which widens the interval: {cure}.",
)
SPIKE, LIKE_OTHERS = 0.3, 0.1  # of the range: a row this far from the median of five, whose neighbours are not
ROWS_REPLACED = Flag(
    name="rows_replaced",
    means="single rows stand far from their neighbours, as after a loose plug",
    cure="look at these rows in the file",
    raised=f"one row more than {SPIKE:g} of the whole range from its neighbours",
    says="Rows that stand alone far from their neighbours were replaced by the median of five: {count}. {advice}",
)
INDENTATION_FLAGS = declared(
    *(NO_CONTACT, NOT_IDENTIFIED, ADHESION, HOLD_RELAXES, NO_BASELINE, SHALLOW_PART, POOR_FIT, CHANGES_WITH_DEPTH),
    *(ROWS_REPLACED, INDENTER_DOUBTFUL),
)
UNTRUSTED_FLAGS = withholding(INDENTATION_FLAGS)
