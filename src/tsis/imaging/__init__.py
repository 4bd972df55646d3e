"""From frames to numbers: corrections, contact, features, profiles, colour."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.imaging import colour as colour
    from tsis.imaging import contact as contact
    from tsis.imaging import corrections as corrections
    from tsis.imaging import depth as depth
    from tsis.imaging import face_corners as face_corners
    from tsis.imaging import gel_change as gel_change
    from tsis.imaging import gel_contact as gel_contact
    from tsis.imaging import patch as patch
    from tsis.imaging import pixels as pixels
    from tsis.imaging import profile as profile
    from tsis.imaging import rendering as rendering
    from tsis.imaging import sensor as sensor
    from tsis.imaging import surface as surface
    from tsis.imaging.contact import find_contact as find_contact
    from tsis.imaging.patch import Features as Features
    from tsis.imaging.patch import features as features

if not TYPE_CHECKING:  # modules and names load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=[
            "colour",
            "contact",
            "corrections",
            "depth",
            "face_corners",
            "gel_change",
            "gel_contact",
            "patch",
            "pixels",
            "profile",
            "rendering",
            "sensor",
            "surface",
        ],
        submod_attrs={"patch": ["Features", "features"], "contact": ["find_contact"]},
    )
