"""The tables that ship with the package, so that no first answer waits for them: `make tables`.

They are what the catalog's probes need at default settings: the contact tables of the hardness estimate; for the
inclusion estimate the light on the lit face, the surrogate of its presses, and what finite strain and uneven tissue add
to them; the solved presses from which others at finite strain continue; and half-spaces under domed faces. Each is what
the product itself computes and caches. `tests/files/test_shipped_tables.py` computes them again and compares.
"""

from __future__ import annotations

import os
import shutil

import numpy as np

import tsis
from tsis.catalog import list_probes
from tsis.files import shipped_tables
from tsis.hardness import build_contact_table
from tsis.inclusion import InclusionPrior, prior_on_tissue
from tsis.inclusion.posterior import build_field_table
from tsis.mechanics import press
from tsis.mechanics.finite_strain import PressSeries
from tsis.mechanics.surrogate import build_finite_correction
from tsis.virtual.probe import VirtualProbe

FORCES_N = (0.5, 1.0)
OTHER_KPA = 15.0  # tissue that the default prior's table of finite strain does not hold, so that the wide one is built
TISSUE_PROBES = ("tsis-2011", "tsis-domed")  # the catalog's probes for inclusions


def main() -> None:
    """Delete the shipped tables and compute them anew, in about half an hour."""
    folder = shipped_tables()
    shutil.rmtree(folder, ignore_errors=True)
    os.environ["TSIS_CACHE_DIR"] = str(folder)
    compute_tables()


def compute_tables() -> None:
    """Ask for everything that needs a table, as a user does."""
    for name in list_probes():
        build_contact_table(tsis.load_probe(name))
    for name in TISSUE_PROBES:
        for prior in (InclusionPrior(), prior_on_tissue(InclusionPrior(), OTHER_KPA)):
            build_finite_correction(tsis.load_probe(name), prior.box())
        build_field_table(tsis.load_probe(name), InclusionPrior())
        PressSeries(tsis.load_probe(name)).press(tsis.load_phantom("size-8"), force_n=FORCES_N[0])
    virtual = VirtualProbe(tsis.load_probe("tsis-domed"), rng=np.random.default_rng(0))
    phantom = tsis.load_phantom("size-8")
    press(virtual.probe, phantom, force_n=FORCES_N[0])
    VirtualProbe(virtual.probe, rng=np.random.default_rng(0), strain="small").press(phantom, force_n=FORCES_N[0])
    images = [virtual.press(phantom, force_n=force) for force in FORCES_N]
    reference = [virtual.press(phantom.without_inclusion(), force_n=force) for force in FORCES_N]
    tsis.inclusion.estimate(images, probe=virtual.probe, calibration=virtual.calibration, reference=reference)


if __name__ == "__main__":
    main()
