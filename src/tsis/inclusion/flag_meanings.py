"""Every flag that an estimate of an inclusion may have, in words without numbers or names."""

from __future__ import annotations

from types import MappingProxyType

from tsis.inclusion.verdict import NAMES

FLAGS = MappingProxyType(
    {f"{name}_not_identified": f"the presses tell next to nothing of the {words}" for name, words in NAMES.items()}
    | {f"{name}_at_prior_end": f"the {words} piles up at an end of the prior" for name, words in NAMES.items()}
    | {
        "inclusion_uncertain": "whether there is an inclusion at all is uncertain",
        "no_reference": "there is no press on plain tissue: size and depth are less certain",
        "rings_left_out": "rings that are clipped or outside the picture were not used",
        "saturated": "pixels that the profile is read from are clipped",
        "cropped": "a part of the disc that the profile is read from lies outside the picture",
        "tilted": "a press on plain tissue is brighter on one side: the probe leans",
        "roundness_not_checked": "too little is seen to tell whether the change is round",
        "no_inclusion": "plain tissue explains the frames",
        "off_axis": "the inclusion lies too far from the probe's axis",
        "contact_not_whole": "the dome touches only in part on what was found",
        "not_one_round_inclusion": "what the target adds to plain tissue is not round",
        "presses_disagree": "each press fits an inclusion, but not the same one",
        "model_does_not_fit": "no inclusion explains the frames",
    }
)
