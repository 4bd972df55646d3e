"""The tables that ship with the package, so that no first answer waits for them: `make tables`.

They are what the catalog's probes need under the default prior and that of breast tissue, and a virtual scan's map.
Each is what the product itself computes and caches; `tsis/tables/tables.toml` says what each is and gives the key under
which the product asks for it. `tests/files/test_shipped_tables.py` computes them again and compares.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
import tomli_w

import tsis
from tsis.catalog.priors import inclusion_prior_toml, parse_prior
from tsis.catalog.probes import list_probes
from tsis.files.cache import SHIPPED_KEYS, shipped_tables
from tsis.hardness.table import build_contact_table
from tsis.inclusion import InclusionPrior
from tsis.inclusion.posterior.uneven_tissue import build_field_table
from tsis.inclusion.reading import covered_presses
from tsis.inclusion.tissue import prior_on_tissue
from tsis.mechanics import press
from tsis.mechanics.finite_strain.neo_hookean_press import PressSeries
from tsis.mechanics.lump_kernel import lump_kernel
from tsis.mechanics.surrogate.correction_building import build_finite_correction
from tsis.optics.face_light import irradiance
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Iterator

FORCES_N = (0.5, 1.0)
OTHER_KPA = 15.0  # tissue that the default prior's table of finite strain does not hold, so that the wide one is built
TISSUE_PRIOR = "breast-ex-vivo"
TISSUE_PROBES = ("tsis-2011", "tsis-domed")  # the catalog's probes for inclusions
MAP_PROBE = "tsis-2011"  # of the virtual scans
WHAT = {
    "contact-tables": "contact of soft spheres with the probe's face, for the hardness estimate",
    "covered": "presses that the tissue covers whole, the surrogate of the inclusion estimate",
    "finite-press-states": "solved presses on a phantom from which others at finite strain continue",
    "finite-strain": "what finite strain adds to the surrogate's presses, for tissues of the shipped priors or others",
    "half-spaces": "compliance of a domed face on a half-space, as meshed for a press or by the virtual probe",
    "heterogeneity": "what uneven tissue does to the rings of a frame, for the inclusion estimate",
    "irradiance": "traced light on the face",
    "lump-kernel": "what a lump anywhere under the probe does to a press, for the map of a scan",
}


def main() -> None:
    """Delete the shipped tables and compute them anew, in about half an hour."""
    folder = shipped_tables()
    shutil.rmtree(folder, ignore_errors=True)
    with TemporaryDirectory() as cache:
        os.environ["TSIS_CACHE_DIR"] = cache
        keys: dict[str, dict[str, str]] = {}
        for name in compute_tables():
            for made in sorted(Path(cache).glob("*/*")):
                kind, key = made.parent.name, made.name
                if key in keys.setdefault(kind, {}).values():
                    continue
                if name in keys[kind]:
                    raise RuntimeError(f"{name} must make one table of {kind}; it made two")
                keys[kind][name] = key
                (folder / kind).mkdir(parents=True, exist_ok=True)
                shutil.copyfile(made, folder / kind / name)
    described = {kind: {"what": WHAT[kind], "command": "make tables", "keys": keys[kind]} for kind in sorted(keys)}
    (folder / SHIPPED_KEYS).write_text(tomli_w.dumps(described), encoding="utf-8")


def compute_tables() -> Iterator[str]:
    """Ask for everything that needs a table, as a user does; after each, the name of the tables that it may make."""
    for name in list_probes():
        build_contact_table(tsis.load_probe(name))
        yield name
    lump_kernel(tsis.load_probe(MAP_PROBE))
    yield MAP_PROBE
    for name in TISSUE_PROBES:
        probe, default = tsis.load_probe(name), InclusionPrior()
        tissue_prior = parse_prior(inclusion_prior_toml(TISSUE_PRIOR), InclusionPrior)
        others = {TISSUE_PRIOR: tissue_prior, "other-tissue": prior_on_tissue(default, OTHER_KPA)}
        for tissue, prior in {"default-prior": default, **others}.items():
            build_finite_correction(probe, prior.box())
            yield f"{name}-{tissue}"
        for label, prior in {name: default, f"{name}-{TISSUE_PRIOR}": tissue_prior}.items():
            build_field_table(probe, prior)
            covered_presses(probe, prior)
            yield label
        irradiance(probe)
        yield name
        PressSeries(probe).press(tsis.load_phantom("size-8"), force_n=FORCES_N[0])
        yield f"{name}-size-8"
    virtual = VirtualProbe(tsis.load_probe("tsis-domed"), rng=np.random.default_rng(0))
    phantom = tsis.load_phantom("size-8")
    press(virtual.probe, phantom, force_n=FORCES_N[0])
    yield "tsis-domed-press"
    VirtualProbe(virtual.probe, rng=np.random.default_rng(0), strain="small").press(phantom, force_n=FORCES_N[0])
    yield "tsis-domed-virtual-probe"
    images = [virtual.press(phantom, force_n=force) for force in FORCES_N]
    reference = [virtual.press(phantom.without_inclusion(), force_n=force) for force in FORCES_N]
    tsis.inclusion.estimate(images, probe=virtual.probe, calibration=virtual.calibration, reference=reference)
    yield "tsis-domed-estimate"  # which needs no other table


if __name__ == "__main__":
    main()
