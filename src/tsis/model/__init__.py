"""Immutable values with validation, shared by all packages: probes, phantoms, presses, images, estimates."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.model import budget as budget
    from tsis.model import calibration as calibration
    from tsis.model import content as content
    from tsis.model import estimate as estimate
    from tsis.model import exchange as exchange
    from tsis.model import flag as flag
    from tsis.model import gel_sensor as gel_sensor
    from tsis.model import image as image
    from tsis.model import phantom as phantom
    from tsis.model import press as press
    from tsis.model import probe as probe
    from tsis.model import require as require
else:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=[
            "budget",
            "calibration",
            "content",
            "estimate",
            "exchange",
            "flag",
            "gel_sensor",
            "image",
            "phantom",
            "press",
            "probe",
            "require",
        ],
    )
