"""Probes, phantoms, spheres, gel sensors and priors as TOML files."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from tsis.catalog import phantoms as phantoms
    from tsis.catalog import priors as priors
    from tsis.catalog import probes as probes
    from tsis.catalog import sensors as sensors
    from tsis.catalog.phantoms import load_phantom as load_phantom
    from tsis.catalog.probes import load_probe as load_probe
    from tsis.catalog.sensors import load_sensor as load_sensor
else:  # modules load when they are first used
    __getattr__, __dir__, _ = lazy_loader.attach(
        __name__,
        submodules=["phantoms", "priors", "probes", "sensors"],
        submod_attrs={"phantoms": ["load_phantom"], "probes": ["load_probe"], "sensors": ["load_sensor"]},
    )
