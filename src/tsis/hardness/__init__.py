"""Young's modulus of a pressed object, corrected for the probe's own compliance."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.hardness import contacts as contacts
    from tsis.hardness import curve_files as curve_files
    from tsis.hardness import estimation as estimation
    from tsis.hardness import film as film
    from tsis.hardness import flags as flags
    from tsis.hardness import force_curves as force_curves
    from tsis.hardness import gel as gel
    from tsis.hardness import posterior as posterior
    from tsis.hardness import reading as reading
    from tsis.hardness import shore as shore
    from tsis.hardness import sphere as sphere
    from tsis.hardness import strain_map as strain_map
    from tsis.hardness import table as table
    from tsis.hardness.estimation import estimate as estimate
    from tsis.hardness.force_curves import indentation as indentation
    from tsis.hardness.gel import estimate_from_contacts as estimate_from_contacts

if not TYPE_CHECKING:  # modules and names load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=[
            "contacts",
            "curve_files",
            "estimation",
            "film",
            "flags",
            "force_curves",
            "gel",
            "posterior",
            "reading",
            "shore",
            "sphere",
            "strain_map",
            "table",
        ],
        submod_attrs={
            "estimation": ["estimate"],
            "force_curves": ["indentation"],
            "gel": ["estimate_from_contacts"],
        },
    )
