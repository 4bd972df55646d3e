"""From frames of the camera to numbers: corrections, the contact's patch, features, profiles, colour."""

from tsis.imaging.correct import flatten, match_light, signal, subtract_background, subtract_dark
from tsis.imaging.features import Features, features
from tsis.imaging.profile import RadialProfile, radial_profile
from tsis.imaging.segment import Patch, segment

__all__ = [
    "Features",
    "Patch",
    "RadialProfile",
    "features",
    "flatten",
    "match_light",
    "radial_profile",
    "segment",
    "signal",
    "subtract_background",
    "subtract_dark",
]
