"""Calibration of a probe: scale, light, force and response; the press guard."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.calibration import camera_reference as camera_reference
    from tsis.calibration import dents as dents
    from tsis.calibration import dot_board as dot_board
    from tsis.calibration import file as file
    from tsis.calibration import force_line as force_line
    from tsis.calibration import foreign_folder as foreign_folder
    from tsis.calibration import frames as frames
    from tsis.calibration import guard as guard
    from tsis.calibration import lamps as lamps
    from tsis.calibration import measured as measured
    from tsis.calibration import response as response
    from tsis.calibration import scale as scale
    from tsis.calibration import session as session
    from tsis.calibration import settling as settling
    from tsis.calibration import specification as specification
    from tsis.calibration.frames import load_calibration as load_calibration
    from tsis.calibration.frames import load_frames as load_frames

if not TYPE_CHECKING:  # modules and names load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=[
            "camera_reference",
            "dents",
            "dot_board",
            "file",
            "force_line",
            "foreign_folder",
            "frames",
            "guard",
            "lamps",
            "measured",
            "response",
            "scale",
            "session",
            "settling",
            "specification",
        ],
        submod_attrs={"frames": ["load_calibration", "load_frames"]},
    )
