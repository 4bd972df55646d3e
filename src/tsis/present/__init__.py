"""One way to show a result: a page, which HTML, PDF, terminal and console show."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.present import calibration as calibration
    from tsis.present import daily_checks as daily_checks
    from tsis.present import design as design
    from tsis.present import document as document
    from tsis.present import figures as figures
    from tsis.present import gel_sensor as gel_sensor
    from tsis.present import hardness as hardness
    from tsis.present import html as html
    from tsis.present import images as images
    from tsis.present import inclusion as inclusion
    from tsis.present import indentation as indentation
    from tsis.present import kit as kit
    from tsis.present import labels as labels
    from tsis.present import lump_map as lump_map
    from tsis.present import matching as matching
    from tsis.present import page as page
    from tsis.present import pdf as pdf
    from tsis.present import precision as precision
    from tsis.present import records as records
    from tsis.present import study as study
    from tsis.present import target as target
    from tsis.present import terminal as terminal
    from tsis.present import tracking as tracking

if not TYPE_CHECKING:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=[
            "calibration",
            "daily_checks",
            "design",
            "document",
            "figures",
            "gel_sensor",
            "hardness",
            "html",
            "images",
            "inclusion",
            "indentation",
            "kit",
            "labels",
            "lump_map",
            "matching",
            "page",
            "pdf",
            "precision",
            "records",
            "study",
            "target",
            "terminal",
            "tracking",
        ],
    )
