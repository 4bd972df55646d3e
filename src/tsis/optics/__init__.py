"""Light in the probe: angles, guided modes, waves in a dented guide, rays."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.optics import angles as angles
    from tsis.optics import face_light as face_light
    from tsis.optics import propagation as propagation
    from tsis.optics import rays as rays
    from tsis.optics import slab as slab
    from tsis.optics.slab import GuidedModes as GuidedModes
    from tsis.optics.slab import guided_modes as guided_modes

if not TYPE_CHECKING:  # modules and names load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=["angles", "face_light", "propagation", "rays", "slab"],
        submod_attrs={"slab": ["GuidedModes", "guided_modes"]},
    )
