"""From frames of the camera to numbers: corrections, the contact's patch and circle, features, profiles, colour."""

from typing import TYPE_CHECKING

import lazy_loader

from tsis.imaging._colour import COLOUR_MAPS, change_magnitude, colour_map
from tsis.imaging._contact import Contact, find_colour_contact, find_contact
from tsis.imaging._contact_models import (
    CONTACT_MODELS,
    ContactModel,
    as_contact_model,
    rough_contact,
    rough_contact_slope,
)
from tsis.imaging._corrections import (
    SCALE_TOLERANCE,
    flatten,
    match_light,
    require_image,
    require_same_frame,
    signal,
    subtract_background,
    subtract_dark,
)
from tsis.imaging._filters import block_means
from tsis.imaging._gel_change import GelChange, gel_change, gel_levels, gel_reference
from tsis.imaging._gel_contacts import REASONS, GelContact, MarkerShift, contacts, find_gel_contact, marker_shift
from tsis.imaging._height_surface import HeightSurface, height_surface
from tsis.imaging._lost_light import LostLight, find_lost_light
from tsis.imaging._patch import (
    GAUSSIAN_MAD,
    NOISE_FACTOR,
    QUANTISATION,
    SMOOTH_PX,
    Features,
    Patch,
    features,
    pixel_noise,
    segment,
    smoothed,
)
from tsis.imaging._profile import RadialProfile, radial_profile
from tsis.imaging._render import render, render_reference
from tsis.imaging._sensor import LedDrift, Sensor, expose

__all__ = [
    "COLOUR_MAPS",
    "CONTACT_MODELS",
    "GAUSSIAN_MAD",
    "NOISE_FACTOR",
    "QUANTISATION",
    "REASONS",
    "SCALE_TOLERANCE",
    "SMOOTH_PX",
    "Contact",
    "ContactModel",
    "Features",
    "GelChange",
    "GelContact",
    "HeightSurface",
    "LedDrift",
    "LostLight",
    "MarkerShift",
    "Patch",
    "RadialProfile",
    "Sensor",
    "as_contact_model",
    "block_means",
    "change_magnitude",
    "colour_map",
    "contacts",
    "expose",
    "features",
    "find_colour_contact",
    "find_contact",
    "find_gel_contact",
    "find_lost_light",
    "flatten",
    "gel_change",
    "gel_levels",
    "gel_reference",
    "height_surface",
    "marker_shift",
    "match_light",
    "pixel_noise",
    "radial_profile",
    "render",
    "render_reference",
    "require_image",
    "require_same_frame",
    "rough_contact",
    "rough_contact_slope",
    "segment",
    "signal",
    "smoothed",
    "subtract_background",
    "subtract_dark",
]

if not TYPE_CHECKING:  # subpackages load when they are first used
    __getattr__ = lazy_loader.attach(__name__, ["depth"])[0]
