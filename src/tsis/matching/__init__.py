"""Non-rigid point matching: correspondences of two point sets, and the map between them."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.matching import annealing as annealing
    from tsis.matching import bayesian_drift as bayesian_drift
    from tsis.matching import drift as drift
    from tsis.matching import flags as flags
    from tsis.matching import methods as methods
    from tsis.matching import neighbourhoods as neighbourhoods
    from tsis.matching import outline as outline
    from tsis.matching import planes as planes
    from tsis.matching import point_files as point_files
    from tsis.matching import pose_evidence as pose_evidence
    from tsis.matching import pose_search as pose_search
    from tsis.matching import posterior as posterior
    from tsis.matching import refinement as refinement
    from tsis.matching import registration as registration
    from tsis.matching import relaxation as relaxation
    from tsis.matching import shape_context as shape_context
    from tsis.matching import spline as spline
    from tsis.matching.registration import Registration as Registration
    from tsis.matching.registration import register as register

if not TYPE_CHECKING:  # modules and names load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=[
            "annealing",
            "bayesian_drift",
            "drift",
            "flags",
            "methods",
            "neighbourhoods",
            "outline",
            "planes",
            "point_files",
            "pose_evidence",
            "pose_search",
            "posterior",
            "refinement",
            "registration",
            "relaxation",
            "shape_context",
            "spline",
        ],
        submod_attrs={"registration": ["Registration", "register"]},
    )
