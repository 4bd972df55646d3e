"""The virtual probe: mechanics, light and camera without hardware."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.virtual import calibration_bench as calibration_bench
    from tsis.virtual import camera as camera
    from tsis.virtual import direct_contact as direct_contact
    from tsis.virtual import examinations as examinations
    from tsis.virtual import gel_frames as gel_frames
    from tsis.virtual import gel_sensor as gel_sensor
    from tsis.virtual import gige as gige
    from tsis.virtual import loading_machine as loading_machine
    from tsis.virtual import planned_probe as planned_probe
    from tsis.virtual import probe as probe
    from tsis.virtual import scan as scan
    from tsis.virtual.probe import VirtualProbe as VirtualProbe
else:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=[
            *("calibration_bench", "camera", "direct_contact", "examinations", "gel_frames", "gel_sensor", "gige"),
            *("loading_machine", "planned_probe", "probe", "scan"),
        ],
        submod_attrs={"probe": ["VirtualProbe"]},
    )
