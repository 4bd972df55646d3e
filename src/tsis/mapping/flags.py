"""Flags of a map: each is declared once, with sentence, threshold and cure; `tsis.mapping.estimation` raises them."""

from __future__ import annotations

from tsis.model.estimate import IMPROBABLE
from tsis.model.flag import Flag, declared, withholding

SHALLOW_MM, NARROW_MM = 3.0, 2.0
# Probability from which a lump is listed: two a scan at this end would be a false lump in ten scans; and is told.
PRESENT, POSSIBLE = 0.95, 0.5
DEEP, DEEP_CHANGE = 0.3, 0.17  # force over modulus and squared radius; its part by which finite strain changes signals
FINITE_LOAD = 1.1  # force over modulus and squared radius up to which the tables of finite strain hold flat presses
UNSETTLED = 0.25  # between the halves of the sampling
LOOSE_CONTRAST = 4.0  # ratio of the ends of the 90 % interval from which only a bound is told
LARGE_BLIND = 0.1  # of the area
PRIORS_END, AT_END = 0.8, 1 / 3  # of the prior's largest unevenness; share of the samples above
HARD_MISFIT = 1.35  # mean square of the whitened residual above which no model error of a few per cent explains it

LUMP_SHALLOW = Flag(
    name="lump_shallow",
    means="a lump's top is so shallow that the model errs by more than 2 %",
    cure="press this lump by itself and use tsis examine",
    raised=f"depth of the top below {SHALLOW_MM:g} mm",
    says="The top of {lump} lies {depth_mm:.1f} mm under the skin, where the model errs by up to 7 % of the signal.",
)
LUMP_POSSIBLE = Flag(
    name="lump_possible",
    means="a lump is likely, but not likely enough to be listed",
    cure="press near it again",
    raised=f"probability from {POSSIBLE:g} to {PRESENT:g}",
    says="A lump is possible at x {x_mm:.0f} mm, y {y_mm:.0f} mm (probability {probability:.2f}): {cure}.",
)
LUMPS_CLOSE = Flag(
    name="lumps_close",
    means="two lumps lie so close that they act on each other",
    cure="press between them with closer places",
    raised=f"gap below {NARROW_MM:g} mm",
    says="{lump} and {other} are {gap_mm:.1f} mm apart: they act on each other, and their sizes are less certain.",
)
CONTRAST_NOT_IDENTIFIED = Flag(
    name="contrast_not_identified",
    means="the contrast of a lump is known only to lie above a bound",
    raised=f"contrast whose 90 % interval reaches the end of the prior or spans a factor of {LOOSE_CONTRAST:g}",
    says="The contrast of {lump} cannot be told: it lies above {bound:.2g}.",
)
NOT_COVERED = Flag(
    name="not_covered",
    means="parts of the area between presses lie in the blind zone",
    cure="press at the places that the map names next",
    raised=f"more than {100 * LARGE_BLIND:g} % of the area",
    says="{percent:.0f} % of the scanned area could hide a lump of {diameter_mm:g} mm with its top at {depth_mm:g} mm.",
)
UNEVEN_AT_END = Flag(
    name="uneven_at_prior_end",
    means="the tissue is as uneven as the prior allows: lumps may be unevenness and unevenness lumps",
    cure="give a prior with a larger heterogeneity_sd",
    raised=f"{AT_END:.0%} of the samples above {PRIORS_END:g} of the prior's largest unevenness",
    says="The tissue is at least as uneven as the prior allows, {end:g}: {cure}.",
)
MAP_DOES_NOT_FIT = Flag(
    name="map_does_not_fit",
    means="no spheres in uneven tissue explain the presses",
    cure="check places, scale and calibration, and the tissue's modulus and thickness in the prior",
    raised=f"chance below {IMPROBABLE:g} of a misfit of noise that is {HARD_MISFIT:g} times as large as stated",
    withholds=True,
    says="Lumps in uneven tissue do not explain the presses (chance below {chance}): {cure}.",
)
PRESSES_DEEP = Flag(
    name="presses_deep",
    means="presses are so deep that finite strain, which the map leaves out, changes a lump's signal by more than 5 %",
    cure="press more lightly, or up to the force that the sentence names map at strain 'finite'",
    raised=f"at small strain, median force above {DEEP:g} of the tissue's modulus times the face's squared radius",
    says="At {force_n:.2g} N on tissue of {young_kpa:.3g} kPa finite strain changes the signal of a lump beside the "
    "axis by some {percent:.0f} %, which a map at small strain leaves out: press more lightly; up to {finite_n:.2g} N "
    "a map at strain 'finite' corrects most of it for lumps on the axis.",
)
PRESSES_LEFT_OUT = Flag(
    name="presses_left_out",
    means="presses were not used",
    says="{count} of {all_presses} presses were left out: {reasons}",
)
SAMPLER_NOT_SETTLED = Flag(
    name="sampler_not_settled",
    means="the halves of the sampling differ",
    cure="give more steps",
    raised=f"halves differ by more than {UNSETTLED:g} in the probability of a number of lumps",
    says="The sampling has not settled: {cure}.",
)

MAP_FLAGS = declared(
    LUMP_SHALLOW,
    LUMP_POSSIBLE,
    LUMPS_CLOSE,
    CONTRAST_NOT_IDENTIFIED,
    NOT_COVERED,
    UNEVEN_AT_END,
    PRESSES_DEEP,
    PRESSES_LEFT_OUT,
    SAMPLER_NOT_SETTLED,
    MAP_DOES_NOT_FIT,
)
UNTRUSTED_MAP_FLAGS = withholding(MAP_FLAGS)
