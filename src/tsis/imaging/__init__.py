"""From frames of the camera to numbers: corrections, the contact's patch and circle, features, profiles, colour.

``tsis.imaging.features`` and ``tsis.imaging.surface`` are the calls: the imports below bind them over the modules
of the same names.
"""

from tsis.imaging.colour import change_magnitude, colour_map, to_grey
from tsis.imaging.contact import Contact, find_colour_contact, find_contact
from tsis.imaging.correct import flatten, match_light, signal, subtract_background, subtract_dark
from tsis.imaging.features import Features, features
from tsis.imaging.profile import RadialProfile, radial_profile
from tsis.imaging.segment import Patch, segment
from tsis.imaging.surface import Surface, surface

__all__ = [
    "Contact",
    "Features",
    "Patch",
    "RadialProfile",
    "Surface",
    "change_magnitude",
    "colour_map",
    "features",
    "find_colour_contact",
    "find_contact",
    "flatten",
    "match_light",
    "radial_profile",
    "segment",
    "signal",
    "subtract_background",
    "subtract_dark",
    "surface",
    "to_grey",
]
