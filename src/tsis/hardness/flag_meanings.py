"""Every flag that an estimate of a hardness may have, in words without numbers or names."""

from __future__ import annotations

from types import MappingProxyType

FLAGS = MappingProxyType(
    {
        "young_kpa_not_identified": "the presses tell next to nothing of the modulus",
        "young_kpa_cut_off": "the modulus piles up at an end of the prior",
        "radius_unknown": "nobody gave the object's radius",
        "one_force": "all presses have one force, so that nothing tests the model",
        "saturated": "pixels of a contact are clipped",
        "not_round": "a contact is not round: no sphere on the probe's axis",
        "outside_table": "the sphere is flattened further than the mechanics were solved for",
        "model_does_not_fit": "forces, light and contact radii contradict each other",
    }
)
