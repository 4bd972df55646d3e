"""From frames of the camera to numbers: corrections, the contact's patch and circle, features, profiles, colour.

``features``, ``segment`` and ``height_surface`` are calls, so no file here bears those names: a module of the same name would
take the call's place when something imports it by its path.
"""

from tsis.imaging.colour import change_magnitude, colour_map
from tsis.imaging.contact import Contact, find_colour_contact, find_contact
from tsis.imaging.contact_features import Features, features
from tsis.imaging.correct import flatten, match_light, signal, subtract_background, subtract_dark
from tsis.imaging.height_surface import HeightSurface, height_surface
from tsis.imaging.patch import Patch, segment
from tsis.imaging.profile import RadialProfile, radial_profile

__all__ = [
    "Contact",
    "Features",
    "HeightSurface",
    "Patch",
    "RadialProfile",
    "change_magnitude",
    "colour_map",
    "features",
    "find_colour_contact",
    "find_contact",
    "flatten",
    "height_surface",
    "match_light",
    "radial_profile",
    "segment",
    "signal",
    "subtract_background",
    "subtract_dark",
]
